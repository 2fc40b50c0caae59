"""The off-line planner of Section 2: commanded speeds to a motion within the motors' torques.

What every planner gives and checks stands here too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sdt_drake.dynamics import inverse_dynamics
from sdt_drake.errors import InputError, checked_number, whole_periods
from sdt_drake.motion.command import Command
from sdt_drake.motion.profile import CommandProfile
from sdt_drake.motion.resampling import Loss
from sdt_drake.motion.trajectory import Motion
from sdt_drake.robot import Robot

Array = NDArray[np.float64]

INTERPOLATION_PERIOD = 0.005  # s, published
TORQUE_TOLERANCE = 1e-6  # N m
SPEED_TOLERANCE = 1e-9  # rad/s; round-off of a commanded speed
ACCELERATION_TOLERANCE = 1e-6  # rad/s²; that of a speed, over a period
ANGLE_TOLERANCE = 1e-4  # rad, and of its range; what an angle may lose to sampling
# Beyond any machine; what is near the largest numbers fails in the dynamics:
_ANY_ANGLE = 1e6  # rad
_ANY_SPEED = 1e4  # rad/s
_ANY_ACCELERATION = 1e6  # rad/s²
# What an overpowered joint may slip, while it is off its command, before the motion is lost:
_SLIP = 0.01  # of the range of its commanded speeds, and
_SLIP_SPEED = 1e-3  # rad/s
_MAX_SWEEPS = 1000
_SHORTEST_LOOK, _LONGEST_LOOK = 16, 1024  # samples


@dataclass(frozen=True, eq=False)
class Plan:
    """A motion that the motors can do, and how hard they work.

    Attributes:
        motion: the reference.
        torque: joint torque with the motors' inertia at each sample, joint side [N m],
            shape (N + 1, n).
        limited: where the planner held a joint back, shape (N + 1, n).
        torque_margin: share of the motors' torque that was allowed [-].
        commanded: what was asked for, at the same period.
        loss: of the resampling of a CSV; None if nothing was resampled.
    """

    motion: Motion
    torque: Array
    limited: NDArray[np.bool_]
    torque_margin: float
    commanded: Motion
    loss: Loss | None = None

    @property
    def longer(self) -> float:
        """How much longer than commanded the motion lasts [s]."""
        return self.motion.duration - self.commanded.duration

    @property
    def angle_lost(self) -> Array:
        """How far the joints end from where they are commanded [rad], shape (n,)."""
        return np.abs(self.motion.q[-1] - self.commanded.q[-1])

    def peak_use(self, robot: Robot) -> Array:
        """Largest |torque| over the motor's limit [-], shape (n,)."""
        return np.max(np.abs(self.torque), axis=0) / robot.effort_limit


def plan_motion(
    robot: Robot,
    command: Command | CommandProfile,
    *,
    period: float = INTERPOLATION_PERIOD,
    torque_margin: float = 1.0,
) -> Plan:
    """Plan a motion; where a motor is too weak, its joint accelerates less and catches up later.

    The same where the command asks for more than the acceleration limits of the robot.

    The limiter looks one period ahead. It can lose a motion for good, when coupling torques grow
    beyond a motor before the speeds come down. So a motion is refused if a joint is driven away
    from its command with its motor at full torque, by more than 1 % of the range of its commanded
    speeds and 1e-3 rad/s, even if it would come back; or if it is not on its command at the end.

    Args:
        robot: the robot.
        command: commanded joint speeds.
        period: interpolation period [s].
        torque_margin: share of the motors' torque that may be used, in (0, 1].

    Raises:
        InputError: if the command does not fit the robot or the period, or the motion cannot be
            done: naming joint, time, what it needs and what there is.
    """
    commanded = commanded_motion(robot, command, period, torque_margin)
    v, limited = _limited_speeds(robot, commanded, torque_margin)
    motion = Motion.from_speeds(period, commanded.q[0], v)
    torque = check_motion(robot, motion, torque_margin=torque_margin)
    return Plan(motion, torque, limited, torque_margin, commanded)


def commanded_motion(
    robot: Robot, command: Command | CommandProfile, period: float, torque_margin: float
) -> Motion:
    """The command at the interpolation period, whether the robot can do it or not.

    Raises:
        InputError: if command, robot and period do not fit each other, or `torque_margin` is no
            share; if angles, speeds or accelerations are beyond any machine; if a joint loses more
            than 1e-4 rad and 1e-4 of the range of its angles, as something is too short for the
            period.
    """
    checked_number(period, "period", minimum=0, exclusive=True)
    if not 0 < torque_margin <= 1:
        raise InputError(
            f"torque_margin: {torque_margin}, expected a share of the motors' torque in (0, 1]"
        )
    start = command.start()
    if len(start) != robot.n:
        raise InputError(
            f"motion '{command.name}': {len(start)} joints, robot '{robot.name}' has {robot.n}"
        )
    count = whole_periods(command.duration, period, f"motion '{command.name}': duration")
    where = f"motion '{command.name}': "
    time = np.arange(count + 1) * period
    v = _speeds(where, robot, command, time)
    motion = Motion.from_speeds(period, start, v)
    _refuse_absurd(where, robot, time, motion.q, _ANY_ANGLE, "rad")
    _refuse_absurd(where, robot, time, motion.vd, _ANY_ACCELERATION, "rad/s²")
    _check_sampling(where, robot, command, motion)
    return motion


def _speeds(where: str, robot: Robot, command: Command | CommandProfile, time: Array) -> Array:
    with np.errstate(over="ignore", invalid="ignore"):
        v = command.speeds(time)
    _refuse_absurd(where, robot, time, v, _ANY_SPEED, "rad/s")
    return v


def _refuse_absurd(
    where: str, robot: Robot, time: Array, values: Array, most: float, unit: str
) -> None:
    beyond = ~(np.abs(values) <= most)
    if beyond.any():
        i, k = np.argwhere(beyond)[0]
        raise InputError(
            f"{where}joint {k + 1} '{robot.joint_names[k]}' at {time[i]:.3f} s: commanded "
            f"{values[i, k]:.4g} {unit}, expected at most {most:g} {unit}, as of any machine"
        )


def _check_sampling(
    where: str, robot: Robot, command: Command | CommandProfile, motion: Motion
) -> None:
    """Refuse what is too short for the period: angles by trapezoids, at the corners of speed too.

    That is exact for a piece that is linear or along half a cosine, however short. The speed of an
    alignment is 0 where a piece ends; half-way it is not.
    """
    corners = command.corners()
    corners = np.union1d(corners, (corners[1:] + corners[:-1]) / 2)
    time = np.union1d(motion.time, corners[(corners > 0) & (corners < motion.duration)])
    v = _speeds(where, robot, command, time)
    steps = np.diff(time)[:, None] * (v[1:] + v[:-1]) / 2
    angle = motion.q[0] + np.vstack([np.zeros(motion.n), np.cumsum(steps, axis=0)])
    lost = np.abs(angle[np.searchsorted(time, motion.time)] - motion.q)
    beyond = lost > ANGLE_TOLERANCE * (1 + np.ptp(angle, axis=0))
    if beyond.any():
        i, k = np.argwhere(beyond)[0]
        raise InputError(
            f"{where}joint {k + 1} '{robot.joint_names[k]}' at {motion.time[i]:.3f} s: commanded "
            f"for so short that a period of {motion.period:g} s loses "
            f"{np.degrees(lost[:, k].max()):.3g} deg, expected a shorter period, or segments and "
            "swings of several periods"
        )


def check_motion(robot: Robot, motion: Motion, *, torque_margin: float = 1.0) -> Array:
    """Joint torques that a motion needs, with the motors' inertia, joint side [N m], (N + 1, n).

    The torques are those at the samples. Until the next one positions and speeds go on, with the
    same acceleration; how far the torques then grow, `margins` tells.

    Raises:
        InputError: if the motion has another number of joints, or leaves the torque, speed,
            acceleration or position limits: naming joint, time, what it needs and what there is.
    """
    if motion.n != robot.n:
        raise InputError(f"motion: {motion.n} joints, robot '{robot.name}' has {robot.n}")
    torque = inverse_dynamics(robot, motion.q, motion.v, motion.vd)
    available = torque_margin * robot.effort_limit
    _refuse_beyond(robot, motion, "torque", "N m", torque, -available, available, TORQUE_TOLERANCE)
    speed = robot.velocity_limit
    _refuse_beyond(robot, motion, "speed", "rad/s", motion.v, -speed, speed, SPEED_TOLERANCE)
    limit, slack = robot.acceleration_limit, ACCELERATION_TOLERANCE
    _refuse_beyond(robot, motion, "acceleration", "rad/s²", motion.vd, -limit, limit, slack)
    check_stops(robot, motion)
    return torque


def check_stops(robot: Robot, motion: Motion) -> None:
    """Raise InputError if a joint leaves its position limits: naming joint, time and angle."""
    stops = robot.position_lower, robot.position_upper
    _refuse_beyond(robot, motion, "position", "rad", motion.q, *stops, 1e-9)


def _refuse_beyond(
    robot: Robot,
    motion: Motion,
    quantity: str,
    unit: str,
    values: Array,
    lower: Array,
    upper: Array,
    tolerance: float,
) -> None:
    beyond = (values < lower - tolerance) | (values > upper + tolerance)
    if beyond.any():
        i, k = np.argwhere(beyond)[0]
        raise InputError(
            f"joint {k + 1} '{robot.joint_names[k]}' at {motion.time[i]:.3f} s: needs {quantity} "
            f"{values[i, k]:.6g} {unit}, available {lower[k]:.6g} to {upper[k]:.6g} {unit}"
        )


def _limited_speeds(
    robot: Robot, commanded: Motion, torque_margin: float
) -> tuple[Array, NDArray[np.bool_]]:
    """Speeds that follow the command, shape (N + 1, n), as closely as the torques allow."""
    plant, context = robot.plant, robot.plant.CreateDefaultContext()
    available, period, command = torque_margin * robot.effort_limit, commanded.period, commanded.v
    largest = robot.acceleration_limit + ACCELERATION_TOLERANCE / 2
    guard = _LostMotionGuard(robot, command, period, available)
    limited = np.zeros(command.shape, dtype=bool)
    speeds = command.copy()
    q, v = commanded.q[0], command[0]
    i, look, last = 0, _SHORTEST_LOOK, len(command) - 1
    while i < last:
        # Most of a motion is its command. Following it is much faster than deciding on it.
        if not limited[i - 1].any():
            end = min(i + look, last)
            followed = _feasible_samples(robot, commanded, q, i, end, available, largest)
            look = min(2 * look, _LONGEST_LOOK) if i + followed == end else _SHORTEST_LOOK
            q = q + (commanded.q[i + followed] - commanded.q[i])
            i, v = i + followed, command[i + followed]
            if i == end:
                continue
        wanted = (command[i + 1] - v) / period
        wish = np.clip(wanted, -largest, largest)
        plant.SetPositions(context, q)
        plant.SetVelocities(context, v)
        M = plant.CalcMassMatrix(context)  # with the motors' inertia
        bias = (
            plant.CalcBiasTerm(context)
            + robot.damping * v
            - plant.CalcGravityGeneralizedForces(context)
        )
        vd = limit_accelerations(M, bias, wish, available)
        limited[i] = vd != wanted
        v_next = np.where(limited[i], v + vd * period, command[i + 1])
        guard.check(i, wish, vd, M @ vd + bias + M.diagonal() * (wish - vd))
        q = q + (v + v_next) * (period / 2)
        i, v = i + 1, v_next
        speeds[i] = v
    guard.check_end(v)
    return speeds, limited


def _feasible_samples(
    robot: Robot,
    commanded: Motion,
    q: Array,
    first: int,
    end: int,
    available: Array,
    largest: Array,
) -> int:
    """How many samples from `first` on, before `end`, can be as commanded; q is that of `first`."""
    rows = slice(first, end)
    vd = commanded.vd[rows]
    shifted = q + (commanded.q[rows] - commanded.q[first])
    torque = inverse_dynamics(robot, shifted, commanded.v[rows], vd)
    beyond = (np.abs(torque) > available) | (np.abs(vd) > largest)
    return int(np.argmax(beyond.any(axis=1))) if beyond.any() else end - first


def limit_accelerations(M: Array, bias: Array, wanted: Array, available: Array) -> Array:
    """Accelerations [rad/s²] towards `wanted` with |M vd + bias| <= `available` [N m].

    Joint after joint from the tip to the base, each as near to its wish as the others leave it,
    until it is known which motors are at their limit; those joints' accelerations then follow
    from their torques. These sweeps are coordinate descent on

        1/2 (vd - wanted)' M (vd - wanted) + (M wanted + bias)' vd + available' |vd - wanted|,

    which is strictly convex because M is positive definite: there is always one solution, in
    which each joint has its wish or its motor gives all it has, and the sweeps converge to it.
    """
    vd = wanted.copy()
    diagonal = M.diagonal()
    for _ in range(_MAX_SWEEPS):
        for k in reversed(range(len(vd))):
            rest = M[k] @ vd - diagonal[k] * vd[k] + bias[k]
            lowest = (-available[k] - rest) / diagonal[k]
            highest = (available[k] - rest) / diagonal[k]
            vd[k] = min(max(wanted[k], lowest), highest)
        solution = _with_motors_at_limit(M, bias, wanted, available, vd)
        if solution is not None:
            return solution
    raise InputError(f"accelerations within the torque limits not found in {_MAX_SWEEPS} sweeps")


def _with_motors_at_limit(
    M: Array, bias: Array, wanted: Array, available: Array, estimate: Array
) -> Array | None:
    """The solution, if `estimate` shows rightly which joints cannot have their wish."""
    limited = estimate != wanted
    if not limited.any():
        return estimate
    short = np.sign(wanted - estimate)[limited]  # direction in which the motor gives all it has
    vd = wanted.copy()
    rest = bias[limited] + M[np.ix_(limited, ~limited)] @ wanted[~limited]
    vd[limited] = np.linalg.solve(M[np.ix_(limited, limited)], short * available[limited] - rest)
    excess = np.abs(M @ vd + bias) - available
    holds = np.all(excess <= TORQUE_TOLERANCE / 2) and np.all(short * (wanted - vd)[limited] >= 0)
    return vd if holds else None


class _LostMotionGuard:
    """Notices a joint that its motor can no longer hold to its command.

    A limited joint lags, but still accelerates towards its command. One that is driven away from
    it, with its motor at full torque, is overpowered; it slips.
    """

    def __init__(self, robot: Robot, command: Array, period: float, available: Array) -> None:
        self._robot = robot
        self._command = command
        self._period = period
        self._available = available
        self._largest_slip = _SLIP * np.ptp(command, axis=0) + _SLIP_SPEED
        self._slip = np.zeros(robot.n)
        self._onset = np.full(robot.n, -1)
        self._needed = np.zeros(robot.n)

    def check(self, i: int, wanted: Array, vd: Array, torque: Array) -> None:
        """Refuse a joint that has slipped too far by the end of period i.

        `wanted` and `vd` [rad/s²] are what each joint wishes and gets; `torque` [N m] is what it
        would need for its wish, beside what the others really do.
        """
        limited = vd != wanted
        start = limited & (self._onset < 0)
        self._onset[start] = i
        self._needed[start] = torque[start]
        self._onset[~limited] = -1
        away = limited & (vd * wanted <= 0)
        self._slip = np.where(limited, self._slip + away * np.abs(vd) * self._period, 0.0)
        lost = self._slip > self._largest_slip
        if lost.any():
            k = int(np.argmax(self._slip / self._largest_slip))
            self._refuse(
                k,
                f"by {(i + 1) * self._period:.3f} s it is driven {self._slip[k]:.4g} rad/s away "
                f"from its command, allowed are {self._largest_slip[k]:.4g} rad/s",
            )

    def check_end(self, v: Array) -> None:
        """Refuse a joint that is not back on its command at the end."""
        off = np.abs(v - self._command[-1]) > SPEED_TOLERANCE
        if off.any():
            k = int(np.argmax(off))
            self._refuse(
                k,
                f"it ends at {v[k]:.4g} rad/s, commanded is {self._command[-1, k]:.4g} rad/s",
            )

    def _refuse(self, k: int, outcome: str) -> None:
        raise InputError(
            f"motion refused: joint {k + 1} '{self._robot.joint_names[k]}' at "
            f"{self._onset[k] * self._period:.3f} s needs torque {self._needed[k]:.6g} N m, "
            f"available ±{self._available[k]:.6g} N m; {outcome}"
        )
