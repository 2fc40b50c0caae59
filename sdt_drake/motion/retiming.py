"""The planner that slows down: the commanded path, in the time that the motors need for it."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pydrake.multibody.optimization import Toppra
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import PrismaticJoint, SpatialInertia, UnitInertia
from pydrake.trajectories import PiecewisePolynomial

from sdt_drake.dynamics import inverse_dynamics
from sdt_drake.errors import InputError
from sdt_drake.motion.command import Command
from sdt_drake.motion.planner import (
    ACCELERATION_TOLERANCE,
    INTERPOLATION_PERIOD,
    SPEED_TOLERANCE,
    TORQUE_TOLERANCE,
    Plan,
    check_motion,
    check_stops,
    commanded_motion,
)
from sdt_drake.motion.profile import CommandProfile
from sdt_drake.motion.trajectory import Motion
from sdt_drake.robot import Robot

Array = NDArray[np.float64]

_MOST_PASSES = 30
_SLOWER = 0.9  # of the path speed that is allowed, if there is no timing
_CELLS = 2000  # of the grid along the path, beside its corners
_CORNER = 0.02  # jump of a commanded acceleration, of its range
_NEAR = 1e-4  # s; how near to a corner the grid goes; with 1e-6 the numbers of Toppra fail
_HEAVY = 0.5  # of its torque to stand still: gravity may be why there is no timing
_CLOCK_FORCE = 1e6  # N, on 1 kg: s'' may be whatever the joints allow
_LONGEST = 100  # times the commanded duration; beyond, a motion is not what was wanted
_AS_COMMANDED = 1 - 1e-6  # path speed from which on a motion is not held back [-]


def retime(
    robot: Robot,
    command: Command | CommandProfile,
    *,
    period: float = INTERPOLATION_PERIOD,
    margin: float = 1.0,
) -> Plan:
    """Plan a motion that keeps the commanded path; where a motor is too weak, all joints slow down.

    The path is q(s), s the commanded time; the result is the s(t) that arrives first with torques,
    speeds and accelerations within their limits and s' <= 1: nothing gets faster than commanded
    (time-optimal path parametrization by reachability analysis, Pham and Pham, IEEE T-RO 34(3)
    2018, by Drake's `Toppra`). A command that is feasible as it is comes back as it is.

    Positions are off the path by up to a h² / 4, a the acceleration and h the period, and this
    does not add up. The torques are within their limits at both ends of every period.

    Args:
        robot: the robot.
        command: commanded joint speeds.
        period: interpolation period [s].
        margin: share of the motors' torque that may be used, in (0, 1].

    Raises:
        InputError: if the command does not fit the robot or the period; if its path leaves the
            stops, or cannot be held against gravity: no timing helps there; if it starts or ends
            in motion too fast for the motors; if it would last 100 times as long as commanded.
    """
    commanded = commanded_motion(robot, command, period, margin)
    check_stops(robot, commanded)
    torque = margin * robot.effort_limit
    limits = available = _Limits(-torque, torque, robot.velocity_limit, robot.acceleration_limit)
    if not available.excess(robot, commanded).any():
        unlimited = np.zeros(commanded.q.shape, dtype=bool)
        torque = check_motion(robot, commanded, margin=margin)
        return Plan(commanded, torque, unlimited, margin, commanded)
    _check_gravity(robot, commanded, torque)
    way = np.abs(np.diff(commanded.q, axis=0)).sum(axis=0)
    _check_duration(command.name, commanded, (way / robot.velocity_limit).max())
    path = _Path(robot, commanded)
    # Toppra knows neither viscous friction nor what sampling adds between the points of its grid.
    # So each pass allows it less, by what the pass before was over. If that leaves too little to
    # hold the links, everything has to go slower: friction then takes less.
    left = _LONGEST * commanded.duration  # s of motion to try, in all passes
    for _ in range(_MOST_PASSES):
        s = path.fastest(limits)
        if s is None:
            within_speeds = 1 / max(1.0, _overspeed(robot, commanded).max())
            slower = min(_SLOWER * limits.path_speed, within_speeds)
            limits = replace(available, path_speed=slower)
            continue
        _check_duration(command.name, commanded, s.end_time())
        left -= s.end_time()
        if left < 0:
            break
        motion, path_speed = path.sampled(s)
        excess = available.excess(robot, motion)
        if not excess.any():
            torque = check_motion(robot, motion, margin=margin)
            slower = np.repeat(path_speed[:, None] < _AS_COMMANDED, robot.n, axis=1)
            return Plan(motion, torque, slower, margin, commanded)
        limits = limits.lowered(excess)
    raise _refusal(robot, command, commanded, available)


@dataclass(frozen=True, eq=False)
class _Limits:
    """What a motion may need.

    Attributes:
        lowest, highest: torque [N m], shape (n,).
        speed, acceleration: largest sizes [rad/s, rad/s²], shape (n,).
        path_speed: largest s' [-].
    """

    lowest: Array
    highest: Array
    speed: Array
    acceleration: Array
    path_speed: float = 1.0

    def excess(self, robot: Robot, motion: Motion) -> Array:
        """By how much a motion is beyond the first four at most, (4, n); 0 where it is not."""
        torque = np.vstack(torque_of_periods(robot, motion))
        rows = (
            (-torque.min(axis=0), -self.lowest, TORQUE_TOLERANCE),
            (torque.max(axis=0), self.highest, TORQUE_TOLERANCE),
            (np.abs(motion.v).max(axis=0), self.speed, SPEED_TOLERANCE),
            (np.abs(motion.vd).max(axis=0), self.acceleration, ACCELERATION_TOLERANCE),
        )
        return np.array([np.where(x > limit + slack, x - limit, 0.0) for x, limit, slack in rows])

    def lowered(self, excess: Array) -> _Limits:
        """Less by `excess`, and a little more: the last bit would take many passes."""
        lowest, highest, speed, acceleration = 1.1 * excess
        return _Limits(
            self.lowest + lowest,
            self.highest - highest,
            self.speed - speed,
            self.acceleration - acceleration,
            self.path_speed,
        )


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
    """The commanded path, with a clock: one more joint whose position is s.

    The clock turns s' <= 1 into a speed limit, and where all other joints rest, it still has a
    speed: Toppra needs q'(s) != 0.
    """

    def __init__(self, robot: Robot, commanded: Motion) -> None:
        self._commanded = commanded
        self._plant, self._clock = _plant_with_clock(robot)
        time = commanded.time
        with_clock = (
            np.insert(commanded.q, self._clock, time, axis=1),
            np.insert(commanded.v, self._clock, 1.0, axis=1),
        )
        # Exact: positions are quadratic between the samples.
        self._q = PiecewisePolynomial.CubicHermite(time, *(x.T for x in with_clock))
        self._grid = _grid(commanded)
        # At rest it may start from s' = 0; a command that starts in motion keeps its speed.
        self._ends = [float(v.any()) for v in (commanded.v[0], commanded.v[-1])]

    def fastest(self, limits: _Limits) -> PiecewisePolynomial | None:
        """The fastest s(t) within the limits; None if there is none."""
        if np.any(limits.lowest >= limits.highest) or np.any(limits.speed <= 0):
            return None
        problem = Toppra(self._q, self._plant, self._grid)
        for add, lower, upper, of_clock in (
            (problem.AddJointTorqueLimit, limits.lowest, limits.highest, _CLOCK_FORCE),
            (problem.AddJointVelocityLimit, -limits.speed, limits.speed, limits.path_speed),
            (problem.AddJointAccelerationLimit, -limits.acceleration, limits.acceleration, np.inf),
        ):
            if np.isfinite([*upper, of_clock]).any():
                add(
                    np.insert(lower, self._clock, -of_clock),
                    np.insert(upper, self._clock, of_clock),
                )
        # With limits close to nothing its numbers fail; Drake fails by a SystemExit then.
        with _quiet(), contextlib.suppress(RuntimeError, SystemExit):
            return problem.SolvePathParameterization(
                *(end * limits.path_speed for end in self._ends)
            )
        return None

    def sampled(self, s: PiecewisePolynomial) -> tuple[Motion, Array]:
        """The motion along s(t) at the interpolation period, and s' [-] at its samples, (N + 1,).

        A path that starts or ends at rest rests for a period there, so that it meets its end.
        """
        h, (first, last) = self._commanded.period, self._ends
        at_rest = [int(end == 0) for end in self._ends]
        count = int(np.ceil(s.end_time() / h - 1e-9)) + sum(at_rest)
        t = (np.arange(-1, count + 2) - at_rest[0]) * h
        s_t = s.vector_values(np.clip(t, 0, s.end_time()))[0]
        s_t += first * np.minimum(t, 0) + last * np.maximum(t - s.end_time(), 0)
        return Motion.from_positions(h, self._positions(s_t)), (s_t[2:] - s_t[:-2]) / (2 * h)

    def _positions(self, s: Array) -> Array:
        """Joint positions [rad], shape (N, n); at constant speed beyond the ends."""
        c = self._commanded
        within = np.clip(s, 0, c.duration)
        q = np.delete(self._q.vector_values(within).T, self._clock, axis=1)
        return q + (s - within)[:, None] * np.where(s[:, None] < 0, c.v[0], c.v[-1])


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Toppra logs as an error that there is no timing; here that is an answer."""
    log = logging.getLogger("drake")
    level = log.level
    log.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        log.setLevel(level)


def _plant_with_clock(robot: Robot) -> tuple[MultibodyPlant, int]:
    """The robot and, beside it, 1 kg that slides without weight; and which velocity is its."""
    plant = robot.make_open_plant()
    alone = plant.AddModelInstance("sdt_drake_clock")
    mass = SpatialInertia(1.0, np.zeros(3), UnitInertia.SolidSphere(1.0))
    body = plant.AddRigidBody("clock", alone, mass)
    joint = PrismaticJoint("clock", plant.world_frame(), body.body_frame(), [1, 0, 0])
    clock = plant.AddJoint(joint)
    plant.set_gravity_enabled(alone, False)
    plant.Finalize()
    return plant, clock.velocity_start()


def _grid(commanded: Motion) -> Array:
    """Where Toppra looks [s]: even cells, both sides of every corner, and close to the ends."""
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


def _check_gravity(robot: Robot, commanded: Motion, available: Array) -> None:
    """Refuse a path that a motor cannot hold: the slowest motion needs that torque too."""
    rest = np.zeros_like(commanded.q)
    holding = inverse_dynamics(robot, commanded.q, rest, rest)
    beyond = np.abs(holding) > available + TORQUE_TOLERANCE
    if beyond.any():
        i, k = np.argwhere(beyond)[0]
        raise InputError(
            f"motion refused: joint {k + 1} '{robot.joint_names[k]}', where it is commanded at "
            f"{commanded.time[i]:.3f} s, needs torque {holding[i, k]:.6g} N m to hold its links, "
            f"available ±{available[k]:.6g} N m; no slower motion needs less"
        )


def _check_duration(name: str, commanded: Motion, duration: float) -> None:
    """Refuse what would last much longer than commanded, `duration` [s] at least."""
    if duration > _LONGEST * commanded.duration:
        raise InputError(
            f"motion '{name}' refused: it would last {duration:.4g} s or longer, expected at most "
            f"{_LONGEST} times as long as commanded, {commanded.duration:g} s"
        )


def _overspeed(robot: Robot, commanded: Motion) -> Array:
    """Largest commanded speed over the limit [-], shape (n,)."""
    return np.abs(commanded.v).max(axis=0) / robot.velocity_limit


def _refusal(
    robot: Robot, command: Command | CommandProfile, commanded: Motion, available: _Limits
) -> InputError:
    """What stands in the way of any timing, as far as it can be told."""
    starts, ends = torque_of_periods(robot, commanded)
    for v, torque, when in (
        (commanded.v[0], starts[0], "start"),
        (commanded.v[-1], ends[-1], "end"),
    ):
        over = np.abs(torque) / available.highest
        k = int(np.argmax(over))
        if v.any() and over[k] > 1:
            return InputError(
                f"motion '{command.name}' refused: its {when} is commanded in motion, there joint "
                f"{k + 1} '{robot.joint_names[k]}' needs torque {torque[k]:.6g} N m, available "
                f"±{available.highest[k]:.6g} N m; a path can be slowed down from rest to rest"
            )
    rest = np.zeros_like(commanded.q)
    share = np.abs(inverse_dynamics(robot, commanded.q, rest, rest)) / available.highest
    i, k = np.unravel_index(np.argmax(share), share.shape)
    text = f"motion '{command.name}' refused: no timing of its path found that keeps the limits"
    overspeed = _overspeed(robot, commanded)
    if share[i, k] > _HEAVY:
        text += (
            f"; joint {k + 1} '{robot.joint_names[k]}', where it is commanded at "
            f"{commanded.time[i]:.3f} s, needs {100 * share[i, k]:.4g} % of its torque to stand "
            "still"
        )
    elif overspeed.max() > 1:
        k = int(np.argmax(overspeed))
        text += (
            f"; joint {k + 1} '{robot.joint_names[k]}' is commanded {overspeed[k]:.4g} times its "
            "largest speed"
        )
    return InputError(text)
