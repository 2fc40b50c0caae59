"""The planner that slows down: the commanded path, in the time that the motors need for it."""

from __future__ import annotations

import numpy as np
from pydrake.trajectories import PiecewisePolynomial

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import MOST_PERIODS, InputError
from sdt_drake.motion.command import Command
from sdt_drake.motion.plan import (
    ACCELERATION_TOLERANCE,
    INTERPOLATION_PERIOD,
    SPEED_TOLERANCE,
    TORQUE_TOLERANCE,
    Plan,
    check_stops,
    checked_plan,
    commanded_motion,
)
from sdt_drake.motion.trajectory import Motion
from sdt_drake.robot.dynamics import inverse_dynamics
from sdt_drake.robot.robot import Robot

_MOST_PASSES = 30
_SLOWER = 0.97  # first step of slowing a timing down
_GROWING = 1.25  # exponent; 0.97, 0.93, 0.89 ... 0.07 after 14 steps
_CELLS = 2000  # of the grid along the path, beside its corners
_CORNER = 0.02  # jump of a commanded acceleration, of its range
_NEAR = 1e-4  # s; how near to a corner the grid goes
_NO_SHARE = 1e-6  # of s'' in a torque, over that of s'^2
_ROUND_OFF = 1e-9  # of s'^2
_LONGEST = 100  # times the commanded duration; beyond, a motion is not what was wanted
_SAME_SPEED = 1e-3  # of s'; what it may still change with friction
_SLOWEST = 1e-3  # s' that friction is told of
_AS_COMMANDED = 1 - 1e-6  # path speed from which on a motion is not held back [-]
# Of the limits: torque down and up, speed, acceleration.
_SLACK = np.array(
    [[TORQUE_TOLERANCE], [TORQUE_TOLERANCE], [SPEED_TOLERANCE], [ACCELERATION_TOLERANCE]]
)


def retime(
    robot: Robot,
    command: Command,
    *,
    period: float = INTERPOLATION_PERIOD,
    torque_margin: float = 1.0,
) -> Plan:
    """Plan a motion that keeps the commanded path; where a motor is too weak, all joints slow down.

    The path is q(s), s the commanded time; the result is the s(t) that arrives first with torques,
    speeds and accelerations within their limits and s' <= 1 (time-optimal path parametrization by
    reachability analysis, Pham and Pham, IEEE T-RO 34(3) 2018). What is feasible stays as it is.

    Drake's `Toppra` does the same by linear programs, but their solver fails where s'' has nothing
    but round-off in a torque at its limit, as where a motor holds against a centrifugal load. These
    programs have two unknowns; here they are solved in closed form.

    Positions are off the path by up to a h² / 4 (acceleration a, period h); this does not add up.
    The torques are within their limits at both ends of every period.

    Args:
        robot: the robot.
        command: commanded joint speeds.
        period: interpolation period [s].
        torque_margin: share of the motors' torque that may be used, in (0, 1].

    Raises:
        InputError: if the command does not fit the robot or the period; if its path leaves the
            stops or cannot be held against gravity; if it starts or ends in motion too fast for the
            motors; if it would last 100 times as long as commanded, or a million periods.
    """
    commanded = commanded_motion(robot, command, period)
    check_stops(robot, commanded)
    torque = torque_margin * robot.effort_limit
    limits = np.array([torque, torque, robot.top_speed, robot.acceleration_limit])
    if not _excess(robot, commanded, torque_margin).any():
        return checked_plan(robot, commanded, commanded, torque_margin)
    _check_gravity(robot, commanded, torque)
    path = _Path(robot, commanded, torque)
    # The path does not know what sampling adds between the points of its grid. So each pass allows
    # it less, by what the pass before was over. If that leaves too little to hold the links, the
    # last timing is slowed down: beyond holding, all it needs gets less then.
    s, slower = path.fastest(limits), 1.0
    longest = min(_LONGEST * commanded.duration, MOST_PERIODS * period)
    for _ in range(_MOST_PASSES):
        if s is None or s.end_time() / slower > longest:
            break
        motion, path_speed = path.sampled(s, slower)
        excess = _excess(robot, motion, torque_margin)
        if not excess.any():
            held_back = np.repeat(path_speed[:, None] < _AS_COMMANDED, robot.n, axis=1)
            return checked_plan(robot, motion, commanded, torque_margin, held_back)
        limits = limits - 1.1 * excess  # a little more: the last bit would take many passes
        within = path.fastest(limits) if slower == 1 else None
        s, slower = (s, _SLOWER * slower**_GROWING) if within is None else (within, 1.0)
    raise _refusal(robot, command.name, commanded, torque, longest)


def _excess(robot: Robot, motion: Motion, torque_margin: float) -> Array:
    """By how much a motion is at most beyond each limit, (4, n); 0 where it is not."""
    torque = np.vstack(torque_of_periods(robot, motion))
    lowest, highest = robot.torque_range(np.vstack([motion.v[:-1], motion.v[1:]]), torque_margin)
    speed, acceleration = (np.abs(x).max(axis=0) for x in (motion.v, motion.vd))
    beyond = np.array(
        [
            (lowest - torque).max(axis=0),
            (torque - highest).max(axis=0),
            speed - robot.top_speed,
            acceleration - robot.acceleration_limit,
        ]
    )
    return np.where(beyond > _SLACK, beyond, 0.0)


def torque_of_periods(robot: Robot, motion: Motion) -> tuple[Array, Array]:
    """Joint torques at the start and at the end of every period [N m], shape (N, n) each.

    The acceleration is the same at both; position and speed have moved on.
    """
    vd = motion.vd[:-1]
    return (
        inverse_dynamics(robot, motion.q[:-1], motion.v[:-1], vd),
        inverse_dynamics(robot, motion.q[1:], motion.v[1:], vd),
    )


class _Path:
    """The commanded path q(s), and what it takes to move along it.

    By s'' and x = s'^2 every torque and every acceleration is linear, but for viscous friction,
    which goes with s'. It is told as x / s', with the s' of the timing before: so it is right where
    that stays the same, and none at rest. s'' is the same all along a cell of the grid, so x is
    linear in s there.

    A torque-speed envelope is another torque with more friction b, which its falling line makes:
    |torque| + b |q'| is at most what that line would give at rest.
    """

    def __init__(self, robot: Robot, commanded: Motion, torque: Array) -> None:
        """Of a robot with this largest torque at low speed [N m]."""
        self._commanded = commanded
        # Exact: positions are quadratic between the samples.
        self._q = PiecewisePolynomial.CubicHermite(commanded.time, commanded.q.T, commanded.v.T)
        self._grid = _grid(commanded)
        self._cell = np.diff(self._grid)
        q, self._dq, ddq = (self._q.derivative(k).vector_values(self._grid).T for k in range(3))
        # At rest it may start from s' = 0; a command that starts in motion keeps its speed.
        self._ends = [float(_moves(v)) for v in (commanded.v[0], commanded.v[-1])]
        rest = np.zeros_like(q)
        gravity = inverse_dynamics(robot, q, rest, rest)
        inertia = inverse_dynamics(robot, q, rest, self._dq) - gravity
        friction = robot.damping * self._dq
        velocity = inverse_dynamics(robot, q, self._dq, ddq) - gravity - friction
        of_s2, of_x, fixed, rubs = [inertia], [velocity], [gravity], [friction]
        self._more = []  # torque at rest that the line of an envelope gives beyond the largest
        if robot.envelope is not None and robot.envelope.limits:
            lost = torque * robot.envelope.slope  # N m s/rad, by the speed of the motor
            more = np.full(robot.n, np.inf)
            self._more = [np.multiply(lost, robot.envelope.n1, out=more, where=lost > 0)]
            of_s2, of_x, fixed = 2 * of_s2, 2 * of_x, 2 * fixed
            rubs.append(friction + lost * robot.gear_ratio * self._dq)
        self._of_s2, self._of_x, self._friction = (
            np.hstack(x) for x in ([*of_s2, self._dq], [*of_x, ddq], [*rubs, rest])
        )
        ends = np.hstack([*fixed, rest])
        self._fixed = np.hstack([ends[:-1], ends[1:]])

    def fastest(self, limits: Array) -> PiecewisePolynomial | None:
        """The fastest s(t) within the limits; None if there is none."""
        if np.any(-limits[0] >= limits[1]) or np.any(limits[2] <= 0):
            return None
        speed = np.full(self._grid.shape, np.inf)  # at which there is no friction
        for _ in range(_MOST_PASSES if self._friction.any() else 1):
            found = self._fastest(limits, speed)
            if found is None:
                return None
            change, speed = np.abs(found - speed), found
            if change.max() < _SAME_SPEED:
                break
        pace = (speed[1:] + speed[:-1]) / 2
        if not pace.all():
            return None
        time = np.concatenate([[0.0], np.cumsum(self._cell / pace)])
        return PiecewisePolynomial.CubicHermite(time, self._grid[None], speed[None])

    def _fastest(self, limits: Array, before: Array) -> Array | None:
        """The largest s' at the points of the grid, with friction as told of the s' before."""
        ratio, lowest, highest, most = self._bounds(limits, before)
        # From the end: the x at each point from which the x at the next one can be reached.
        low = high = self._ends[1]
        reach = [(low, high)]
        for i in reversed(range(len(most))):
            lowest[i, -1], highest[i, -1] = ratio[i, -1] * low, ratio[i, -1] * high
            # There is an s'' if no lower bound is above an upper one, of any two rows.
            slope = ratio[i] - ratio[i][:, None]
            bound = (highest[i] - lowest[i][:, None]) / np.where(slope == 0, np.nan, slope)
            low = np.max(bound, where=slope < 0, initial=0.0)
            high = np.min(bound, where=slope > 0, initial=most[i])
            if low > high + _ROUND_OFF:
                return None
            low = min(low, high)
            reach.append((low, high))
        # From the start: the largest s''.
        x = [self._ends[0]]
        low, high = reach.pop()
        if not low - _ROUND_OFF <= x[0] <= high + _ROUND_OFF:
            return None
        for i, (low, high) in enumerate(reversed(reach)):
            s2 = np.min(highest[i] - ratio[i] * x[i])
            x.append(min(max(x[i] + 2 * self._cell[i] * s2, low), high))
        return np.sqrt(x)

    def _bounds(self, limits: Array, before: Array) -> tuple[Array, Array, Array, Array]:
        """lowest <= s'' + ratio x <= highest in each cell, (cells, rows + 1), and the largest x.

        The last column is for the x at the end of the cell, to be filled in. Where s'' has no
        share in a torque (a motor holds a link against what only others move; two points before a
        joint comes to rest evenly), it limits x alone: its s'' would be round-off by round-off.
        """
        # Both ends of each cell (columns), by s'' and the x of its start: (cells, rows).
        of_x = self._of_x + self._friction / np.maximum(before, _SLOWEST)[:, None]
        at_end = self._of_s2[1:] + 2 * self._cell[:, None] * of_x[1:]
        of_s2 = np.hstack([self._of_s2[:-1], at_end])
        of_x = np.hstack([of_x[:-1], of_x[1:]])
        down, up, speed, acceleration = limits
        both = (
            np.hstack([-down, *(-down - more for more in self._more), -acceleration]),
            np.hstack([up, *(up + more for more in self._more), acceleration]),
        )
        sides = np.array([np.tile(side, 2) - self._fixed for side in both])
        alone = np.abs(of_s2) < _NO_SHARE * np.abs(of_x)
        shared = ~alone & (of_s2 != 0)
        none = np.broadcast_to([[[-np.inf]], [[np.inf]]], sides.shape).copy()
        bounds = np.sort(np.divide(sides, of_s2, out=none, where=shared), axis=0)
        ratio = np.divide(of_x, of_s2, out=np.zeros(alone.shape), where=shared)
        lowest, highest, ratio = (np.pad(x, ((0, 0), (0, 1))) for x in (*bounds, ratio))
        ratio[:, -1] = 0.5 / self._cell
        x = np.divide(sides, of_x, out=np.full(sides.shape, np.inf), where=alone)
        overspeed = np.max(np.abs(self._dq[:-1]) / speed, axis=1)
        most = np.minimum(x.max(axis=0).min(axis=1), 1 / np.maximum(overspeed, 1.0) ** 2)
        return ratio, lowest, highest, most

    def sampled(self, s: PiecewisePolynomial, slower: float) -> tuple[Motion, Array]:
        """The motion by s(slower t) at the interpolation period; s' [-] at its samples, (N + 1,).

        A path that starts or ends at rest rests for a period there, so that it meets its end.
        """
        h, (first, last) = self._commanded.period, self._ends
        at_rest = [int(end == 0) for end in self._ends]
        count = int(np.ceil(s.end_time() / slower / h - 1e-9)) + sum(at_rest)
        t = slower * (np.arange(-1, count + 2) - at_rest[0]) * h
        s_t = s.vector_values(np.clip(t, 0, s.end_time()))[0]
        s_t += first * np.minimum(t, 0) + last * np.maximum(t - s.end_time(), 0)
        return Motion.from_positions(h, self._positions(s_t)), (s_t[2:] - s_t[:-2]) / (2 * h)

    def _positions(self, s: Array) -> Array:
        """Joint positions [rad], shape (N, n); at constant speed beyond the ends."""
        c = self._commanded
        within = np.clip(s, 0, c.duration)
        return self._q.vector_values(within).T + (s - within)[:, None] * np.where(
            s[:, None] < 0, c.v[0], c.v[-1]
        )


def _grid(commanded: Motion) -> Array:
    """Where to look [s]: even cells, both sides of every corner, and close to the ends."""
    jump = np.abs(np.diff(commanded.vd, axis=0, prepend=0))
    corner = np.any(jump > _CORNER * np.ptp(commanded.vd, axis=0), axis=1)
    corners = commanded.time[corner]
    end = commanded.duration
    near_ends = np.array([1e-3, 1e-2]) * commanded.period  # there s' comes from 0
    even = np.linspace(0, end, 1 + min(_CELLS, len(commanded.time) - 1))
    points = np.concatenate([even, corners, corners - _NEAR, near_ends, end - near_ends])
    points = np.unique(points[(points > 0) & (points < end)])
    apart = np.diff(points, prepend=0.0) > _NEAR / 2
    inner = points[apart & (end - points > _NEAR / 2)]
    return np.concatenate([[0.0], inner, [end]])


def _moves(v: Array) -> bool:
    """Whether a joint is commanded to move with these speeds, round-off apart."""
    return bool(np.any(np.abs(v) > SPEED_TOLERANCE))


def _check_gravity(robot: Robot, commanded: Motion, available: Array) -> None:
    """Refuse a path that a motor cannot hold: the slowest motion needs that torque too."""
    rest = np.zeros_like(commanded.q)
    holding = inverse_dynamics(robot, commanded.q, rest, rest)
    beyond = np.abs(holding) > available + TORQUE_TOLERANCE
    for i, k in np.argwhere(beyond):
        raise InputError(
            f"motion refused: {robot.joint(k)}, where it is commanded at "
            f"{commanded.time[i]:.3f} s, needs torque {holding[i, k]:.6g} N m to hold its links, "
            f"available ±{available[k]:.6g} N m; no slower motion needs less"
        )


def _refusal(
    robot: Robot, name: str, commanded: Motion, available: Array, longest: float
) -> InputError:
    """What stands in the way of any timing up to the longest [s], as far as it can be told."""
    starts, ends = torque_of_periods(robot, commanded)
    for v, torque, when in (
        (commanded.v[0], starts[0], "start"),
        (commanded.v[-1], ends[-1], "end"),
    ):
        k = int(np.argmax(np.abs(torque) / available))
        if _moves(v) and np.abs(torque[k]) > available[k]:
            return InputError(
                f"motion '{name}' refused: its {when} is commanded in motion, there "
                f"{robot.joint(k)} needs torque {torque[k]:.6g} N m, available "
                f"±{available[k]:.6g} N m; a path can be slowed down from rest to rest"
            )
    return InputError(
        f"motion '{name}' refused: no timing of its path was found that keeps the limits and lasts "
        f"at most {longest / commanded.duration:.3g} times as long as commanded, "
        f"{commanded.duration:g} s"
    )
