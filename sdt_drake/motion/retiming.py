"""The retiming planner: the commanded path in the shortest time within the limits."""

import numpy as np
from pydrake.trajectories import PiecewisePolynomial

from sdt_drake.io.arguments import MAX_PERIODS
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.motion import plan
from sdt_drake.motion.command import Command
from sdt_drake.motion.trajectory import Motion
from sdt_drake.robot.dynamics import inverse_dynamics
from sdt_drake.robot.robot import Robot

_MAX_PASSES = 30
_SLOWDOWN = 0.97  # first factor on the path speed [-], if tighter limits do not help
_SLOWDOWN_POWER = 1.25  # growth of the factor: 0.97, 0.93, 0.89 ... 0.07 after 14 passes
_CELLS = 2000  # cells of the grid along the path, without those at its corners
_CORNER_JUMP = 0.02  # jump of the commanded acceleration at a corner, over its range [-]
_CORNER_DISTANCE = 1e-4  # s; distance of grid points from corners
_MIN_SHARE = 1e-6  # smallest factor of s'' in a torque, over that of s'^2
_ROUND_OFF = 1e-9  # round-off of s'^2 [-]
_MAX_SLOWDOWN = 100  # longest duration over the commanded one [-]
_FRICTION_TOLERANCE = 1e-3  # change of s' between passes with viscous friction [-]
_MIN_FRICTION_SPEED = 1e-3  # smallest s' in the linearised viscous friction [-]
_FULL_SPEED = 1 - 1e-6  # path speed at which a motion is not held back [-]
# Tolerances of the limits: torque down and up, speed of gears and joints, acceleration.
_TOLERANCES = np.array(
    [*[[plan.TORQUE_TOLERANCE]] * 2, *[[plan.SPEED_TOLERANCE]] * 2, [plan.ACCELERATION_TOLERANCE]]
)


def retime(
    robot: Robot,
    command: Command,
    *,
    period: float = plan.INTERPOLATION_PERIOD,
    torque_margin: float = 1.0,
    max_periods: int = MAX_PERIODS,
) -> plan.Plan:
    """Plan a motion along the commanded path; all joints slow down where a motor is too weak.

    The path is q(s) with the commanded time s. The result is the fastest s(t) with s' <= 1
    within the limits of torque, speed and acceleration. The method is time-optimal path
    parametrization by reachability analysis (Pham and Pham, IEEE T-RO 34(3) 2018).

    A feasible command is returned unchanged. Torques are within their limits at both ends of every
    period. Positions are off the path by up to a h² / 4 (acceleration a, period h), which does not
    accumulate.

    Drake's `Toppra` solves the same linear programs of two unknowns numerically. Its solver fails
    where the factor of s'' in a torque at its limit is round-off, as for a motor that holds a
    centrifugal load. Here they are solved in closed form.

    Args:
        robot: robot with its limits.
        command: commanded joint speeds.
        period: interpolation period [s].
        torque_margin: share of the motors' torque that may be used, in (0, 1].
        max_periods: largest number of periods of the motion.

    Raises:
        InputError: if the command does not fit the robot or the period; if the path leaves the
            position limits or cannot be held against gravity; if its start or end is in motion and
            beyond the limits; if the motion would last 100 times as long as commanded, or more than
            `max_periods`.

    >>> from sdt_drake.motion.command import load_command
    >>> from sdt_drake.robot.robot import load_robot
    >>> robot = load_robot()
    >>> plan = retime(robot, load_command("graveyard_spin", robot), torque_margin=0.01)
    >>> plan.commanded.duration, plan.motion.duration > 86
    (85.0, True)
    """
    commanded = plan.commanded_motion(robot, command, period)
    plan.check_stops(robot, commanded)
    torque = torque_margin * robot.effort_limit
    speeds = robot.gear_speed_limit, robot.velocity_limit
    limits = np.array([torque, torque, *speeds, robot.acceleration_limit])
    if not _excess(robot, commanded, torque_margin).any():
        return plan.checked_plan(robot, commanded, commanded, torque_margin)
    _check_gravity(robot, commanded, torque)
    path = _Path(robot, commanded, torque)
    # Sampling between the grid points adds torque. Each pass reduces the limits by the excess of
    # the pass before. If they no longer suffice to hold the links, the last timing is slowed down:
    # this reduces all torques but those of gravity.
    s, slower = path.fastest(limits), 1.0
    longest = min(_MAX_SLOWDOWN * commanded.duration, max_periods * period)
    for _ in range(_MAX_PASSES):
        if s is None or s.end_time() / slower > longest:
            break
        motion, path_speed = path.sampled(s, slower)
        excess = _excess(robot, motion, torque_margin)
        if not excess.any():
            held_back = np.repeat(path_speed[:, None] < _FULL_SPEED, robot.n, axis=1)
            return plan.checked_plan(robot, motion, commanded, torque_margin, held_back)
        limits = limits - 1.1 * excess  # 10 % more, as the last bit would take many passes
        within = path.fastest(limits) if slower == 1 else None
        s, slower = (s, _SLOWDOWN * slower**_SLOWDOWN_POWER) if within is None else (within, 1.0)
    raise _refusal(robot, command.name, commanded, torque, longest)


def _excess(robot: Robot, motion: Motion, torque_margin: float) -> Array:
    """Return the largest excess over each limit, shape (5, n); 0 within it."""
    torque = np.vstack(torque_of_periods(robot, motion))
    lowest, highest = robot.torque_range(np.vstack([motion.v[:-1], motion.v[1:]]), torque_margin)
    at_gears, speed, acceleration = (
        np.abs(x).max(axis=0) for x in (robot.gear_speed(motion.v), motion.v, motion.vd)
    )
    beyond = np.array(
        [
            (lowest - torque).max(axis=0),
            (torque - highest).max(axis=0),
            at_gears - robot.gear_speed_limit,
            speed - robot.velocity_limit,
            acceleration - robot.acceleration_limit,
        ]
    )
    return np.where(beyond > _TOLERANCES, beyond, 0.0)


def torque_of_periods(robot: Robot, motion: Motion) -> tuple[Array, Array]:
    """Return torques at the start and at the end of every period [N m], shape (N, n) each.

    They are those at the outputs of the gears. Both have the acceleration of the period.
    """
    vd = motion.vd[:-1]
    return (
        _at_gears(robot, motion.q[:-1], motion.v[:-1], vd),
        _at_gears(robot, motion.q[1:], motion.v[1:], vd),
    )


def _at_gears(robot: Robot, q: Array, v: Array, vd: Array) -> Array:
    """Return torques with the motors' inertia at the outputs of the gears [N m], shape (N, n)."""
    return robot.gear_torque(inverse_dynamics(robot, q, v, vd))


class _Path:
    """The commanded path q(s), with the torques and accelerations of motion along it.

    Torques and accelerations are linear in s'' and x = s'^2, apart from viscous friction. Friction
    is proportional to s', which is x over the s' of the previous pass: exact once the passes agree.
    In a cell of the grid s'' is constant and x linear in s.

    The falling line of a torque-speed envelope is an additional friction b: |torque| + b |q'| is at
    most the torque of that line at rest.
    """

    def __init__(self, robot: Robot, commanded: Motion, torque: Array) -> None:
        """Sample the path. `torque` is the torque limit at low speed [N m], shape (n,)."""
        self._commanded = commanded
        # Exact: positions are quadratic between the samples.
        self._q = PiecewisePolynomial.CubicHermite(commanded.time, commanded.q.T, commanded.v.T)
        self._grid = _grid(commanded)
        self._cell = np.diff(self._grid)
        q, self._dq, ddq = (self._q.derivative(k).vector_values(self._grid).T for k in range(3))
        self._dq_gears = robot.gear_speed(self._dq)
        # s' is 0 at an end at rest; at an end in motion it is 1, the commanded speed.
        self._ends = [float(_moves(v)) for v in (commanded.v[0], commanded.v[-1])]
        rest = np.zeros_like(q)
        gravity = _at_gears(robot, q, rest, rest)
        inertia = _at_gears(robot, q, rest, self._dq) - gravity
        friction = robot.gear_torque(robot.damping * self._dq)
        velocity = _at_gears(robot, q, self._dq, ddq) - gravity - friction
        of_s2, of_x, fixed, rubs = [inertia], [velocity], [gravity], [friction]
        self._more = []  # torque of the envelope's line at rest, minus the limit
        if robot.envelope is not None and robot.envelope.limits:
            lost = torque * robot.envelope.slope  # N m s/rad, over motor speed
            more = np.full(robot.n, np.inf)
            self._more = [np.multiply(lost, robot.envelope.n1, out=more, where=lost > 0)]
            of_s2, of_x, fixed = 2 * of_s2, 2 * of_x, 2 * fixed
            rubs.append(friction + lost * robot.gear_ratio * self._dq_gears)
        self._of_s2, self._of_x, self._friction = (
            np.hstack(x) for x in ([*of_s2, self._dq], [*of_x, ddq], [*rubs, rest])
        )
        ends = np.hstack([*fixed, rest])
        self._fixed = np.hstack([ends[:-1], ends[1:]])

    def fastest(self, limits: Array) -> PiecewisePolynomial | None:
        """Return the fastest s(t) within the limits; None if there is none."""
        if np.any(-limits[0] >= limits[1]) or np.any(limits[2:4] <= 0):
            return None
        speed = np.full(self._grid.shape, np.inf)  # no friction in the first pass
        for _ in range(_MAX_PASSES if self._friction.any() else 1):
            found = self._fastest(limits, speed)
            if found is None:
                return None
            change, speed = np.abs(found - speed), found
            if change.max() < _FRICTION_TOLERANCE:
                break
        pace = (speed[1:] + speed[:-1]) / 2
        if not pace.all():
            return None
        time = np.concatenate([[0.0], np.cumsum(self._cell / pace)])
        return PiecewisePolynomial.CubicHermite(time, self._grid[None], speed[None])

    def _fastest(self, limits: Array, before: Array) -> Array | None:
        """Return the largest s' at the grid points, with friction linearised at the s' `before`."""
        ratio, lowest, highest, most = self._bounds(limits, before)
        # Backward pass: the interval of x at each point from which the next one can be reached.
        low = high = self._ends[1]
        reach = [(low, high)]
        for i in reversed(range(len(most))):
            lowest[i, -1], highest[i, -1] = ratio[i, -1] * low, ratio[i, -1] * high
            # An s'' exists if no lower bound exceeds an upper one, for any two rows.
            slope = ratio[i] - ratio[i][:, None]
            bound = (highest[i] - lowest[i][:, None]) / np.where(slope == 0, np.nan, slope)
            low = np.max(bound, where=slope < 0, initial=0.0)
            high = np.min(bound, where=slope > 0, initial=most[i])
            if low > high + _ROUND_OFF:
                return None
            low = min(low, high)
            reach.append((low, high))
        # Forward pass: the largest s''.
        x = [self._ends[0]]
        low, high = reach.pop()
        if not low - _ROUND_OFF <= x[0] <= high + _ROUND_OFF:
            return None
        for i, (low, high) in enumerate(reversed(reach)):
            s2 = np.min(highest[i] - ratio[i] * x[i])
            x.append(min(max(x[i] + 2 * self._cell[i] * s2, low), high))
        return np.sqrt(x)

    def _bounds(self, limits: Array, before: Array) -> tuple[Array, Array, Array, Array]:
        """Return ratio, lowest, highest, (cells, rows + 1), and the largest x of each cell.

        lowest <= s'' + ratio x <= highest. The last column, for x at the end of the cell, is still
        empty. A torque with a negligible factor of s'' limits x alone: a motor that holds a link
        against the motion of others; a joint two points before it comes to rest evenly.
        """
        # Torques at both ends of each cell, by s'' and by x at its start: (cells, rows).
        of_x = self._of_x + self._friction / np.maximum(before, _MIN_FRICTION_SPEED)[:, None]
        at_end = self._of_s2[1:] + 2 * self._cell[:, None] * of_x[1:]
        of_s2 = np.hstack([self._of_s2[:-1], at_end])
        of_x = np.hstack([of_x[:-1], of_x[1:]])
        down, up, gear_speed, speed, acceleration = limits
        both = (
            np.hstack([-down, *(-down - more for more in self._more), -acceleration]),
            np.hstack([up, *(up + more for more in self._more), acceleration]),
        )
        sides = np.array([np.tile(side, 2) - self._fixed for side in both])
        alone = np.abs(of_s2) < _MIN_SHARE * np.abs(of_x)
        shared = ~alone & (of_s2 != 0)
        none = np.broadcast_to([[[-np.inf]], [[np.inf]]], sides.shape).copy()
        bounds = np.sort(np.divide(sides, of_s2, out=none, where=shared), axis=0)
        ratio = np.divide(of_x, of_s2, out=np.zeros(alone.shape), where=shared)
        lowest, highest, ratio = (np.pad(x, ((0, 0), (0, 1))) for x in (*bounds, ratio))
        ratio[:, -1] = 0.5 / self._cell
        x = np.divide(sides, of_x, out=np.full(sides.shape, np.inf), where=alone)
        gears, joints = np.abs(self._dq_gears[:-1]), np.abs(self._dq[:-1])
        overspeed = np.maximum((gears / gear_speed).max(axis=1), (joints / speed).max(axis=1))
        most = np.minimum(x.max(axis=0).min(axis=1), 1 / np.maximum(overspeed, 1.0) ** 2)
        return ratio, lowest, highest, most

    def sampled(self, s: PiecewisePolynomial, slower: float) -> tuple[Motion, Array]:
        """Return the motion by s(slower t), and s' [-] at its samples, shape (N + 1,).

        An end at rest gets a period of rest, so that the samples reach it.
        """
        h, (first, last) = self._commanded.period, self._ends
        at_rest = [int(end == 0) for end in self._ends]
        count = int(np.ceil(s.end_time() / slower / h - 1e-9)) + sum(at_rest)
        t = slower * (np.arange(-1, count + 2) - at_rest[0]) * h
        s_t = s.vector_values(np.clip(t, 0, s.end_time()))[0]
        s_t += first * np.minimum(t, 0) + last * np.maximum(t - s.end_time(), 0)
        return Motion.from_positions(h, self._positions(s_t)), (s_t[2:] - s_t[:-2]) / (2 * h)

    def _positions(self, s: Array) -> Array:
        """Return joint positions at `s` [rad], shape (N, n); at constant speed beyond the ends."""
        c = self._commanded
        within = np.clip(s, 0, c.duration)
        return self._q.vector_values(within).T + (s - within)[:, None] * np.where(
            s[:, None] < 0, c.v[0], c.v[-1]
        )


def _grid(commanded: Motion) -> Array:
    """Return grid points [s]: even cells, both sides of each corner, points close to the ends."""
    jump = np.abs(np.diff(commanded.vd, axis=0, prepend=0))
    corner = np.any(jump > _CORNER_JUMP * np.ptp(commanded.vd, axis=0), axis=1)
    corners = commanded.time[corner]
    end = commanded.duration
    near_ends = np.array([1e-3, 1e-2]) * commanded.period  # s' starts from 0 there
    even = np.linspace(0, end, 1 + min(_CELLS, len(commanded.time) - 1))
    points = np.concatenate([even, corners, corners - _CORNER_DISTANCE, near_ends, end - near_ends])
    points = np.unique(points[(points > 0) & (points < end)])
    apart = np.diff(points, prepend=0.0) > _CORNER_DISTANCE / 2
    inner = points[apart & (end - points > _CORNER_DISTANCE / 2)]
    return np.concatenate([[0.0], inner, [end]])


def _moves(v: Array) -> bool:
    """Return True if a joint moves at these speeds [rad/s], up to round-off."""
    return bool(np.any(np.abs(v) > plan.SPEED_TOLERANCE))


def _check_gravity(robot: Robot, commanded: Motion, available: Array) -> None:
    """Refuse a path that a motor cannot hold against gravity: slowing down does not help."""
    rest = np.zeros_like(commanded.q)
    holding = _at_gears(robot, commanded.q, rest, rest)
    beyond = np.abs(holding) > available + plan.TORQUE_TOLERANCE
    for i, k in np.argwhere(beyond):
        raise InputError(
            f"motion refused: {robot.joint(k)}, at its command of {commanded.time[i]:.3f} s, needs "
            f"torque {holding[i, k]:.6g} N m to hold its links, available ±{available[k]:.6g} N m; "
            "slowing down does not help"
        )


def _refusal(
    robot: Robot, name: str, commanded: Motion, available: Array, longest: float
) -> InputError:
    """Return the error for a path without a timing up to the longest [s]."""
    starts, ends = torque_of_periods(robot, commanded)
    for v, torque, when in (
        (commanded.v[0], starts[0], "start"),
        (commanded.v[-1], ends[-1], "end"),
    ):
        k = int(np.argmax(np.abs(torque) / available))
        if _moves(v) and np.abs(torque[k]) > available[k]:
            return InputError(
                f"motion '{name}' refused: at its {when}, in motion, {robot.joint(k)} needs torque "
                f"{torque[k]:.6g} N m, available ±{available[k]:.6g} N m; only a path from rest to "
                "rest can be slowed down there"
            )
    return InputError(
        f"motion '{name}' refused: no timing of its path within the limits was found that lasts at "
        f"most {longest / commanded.duration:.3g} times as long as commanded, "
        f"{commanded.duration:g} s"
    )
