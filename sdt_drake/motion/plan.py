"""What every planner starts from, gives and checks; and how near a motion comes to every limit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sdt_drake.io.arguments import a, takes
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, whole_periods
from sdt_drake.io.shown import Shown, Summary, face, joint_count, of_joints
from sdt_drake.motion.command import Command
from sdt_drake.motion.trajectory import Loss, Motion
from sdt_drake.robot.dynamics import inverse_dynamics
from sdt_drake.robot.robot import Robot

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INTERPOLATION_PERIOD = 0.005  # s, published
TORQUE_TOLERANCE = 1e-6  # N m
SPEED_TOLERANCE = 1e-9  # rad/s; round-off of a commanded speed
ACCELERATION_TOLERANCE = 1e-6  # rad/s²; that of a speed, over a period
_ANGLE_TOLERANCE = 1e-4  # rad, and of its range; what an angle may lose to sampling
# Beyond any machine; what is near the largest numbers fails in the dynamics:
_ANY_ANGLE = 1e6  # rad
_ANY_SPEED = 1e4  # rad/s
_ANY_ACCELERATION = 1e6  # rad/s²
_REST = 1e-3  # rad/s; what is slower is at rest


@dataclass(frozen=True, eq=False, repr=False)
class Plan(Shown):
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

    def summary(self) -> Summary:
        title = f"of {joint_count(self.motion.n)}: {self.motion.in_time}"
        if self.longer > 0:
            title += f", {self.longer:.6g} s longer than commanded"
        columns = {
            "torque [N m]": (".1f", np.abs(self.torque).max(axis=0)),
            "held back [s]": (".3f", self.limited.sum(axis=0) * self.motion.period),
            "ends off by [deg]": (".2f", np.degrees(self.angle_lost)),
        }
        return of_joints(title, columns)

    @takes(robot=a(Robot, "sdt_drake.load_robot"))
    def plot(self, robot: Robot) -> Figure:
        """Torques and speeds of its robot, with their limits.

        Raises:
            InputError: for a robot of another number of joints.
        """
        return face().plots_motion.plan("Plan", robot, self, margins(robot, self.motion))

    def peak_use(self, robot: Robot) -> Array:
        """Largest |torque| over the motor's limit [-], shape (n,)."""
        return np.max(np.abs(self.torque), axis=0) / robot.effort_limit


def commanded_motion(robot: Robot, command: Command, period: float) -> Motion:
    """The command at the interpolation period, whether the robot can do it or not.

    Raises:
        InputError: if command, robot and period do not fit each other; if angles, speeds or
            accelerations are beyond any machine; if a joint loses more than 1e-4 rad and 1e-4 of
            the range of its angles, as something is too short for the period.
    """
    where = f"motion '{command.name}': "
    if len(command.q0) != robot.n:
        raise InputError(
            f"{where}{joint_count(len(command.q0))}, robot '{robot.name}' has {robot.n}",
            kind="joints",
        )
    count = whole_periods(command.duration, period, f"{where}duration")
    time = np.arange(count + 1.0) * period
    with np.errstate(over="ignore", invalid="ignore"):

        def check(values: Array, most: float, unit: str) -> None:
            for i, k in np.argwhere(~(np.abs(values) <= most)):
                raise InputError(
                    f"{where}{robot.joint(k)} at {time[i]:.3f} s: commanded {values[i, k]:.4g} "
                    f"{unit}, expected at most {most:g} {unit}, as of any machine"
                )

        v = command.speeds(time)
        check(v, _ANY_SPEED, "rad/s")
        motion = Motion.from_speeds(period, command.q0, v)
        check(motion.q, _ANY_ANGLE, "rad")
        check(motion.vd, _ANY_ACCELERATION, "rad/s²")
        _check_sampling(where, robot, command, motion)
    return motion


def _check_sampling(where: str, robot: Robot, command: Command, motion: Motion) -> None:
    """Refuse what is too short for the period: angles by trapezoids, at the corners of speed too.

    That is exact for a piece that is linear or along half a cosine, however short. The speed of an
    alignment is 0 where a piece ends; half-way it is not.
    """
    corners = command.corners()
    corners = np.union1d(corners, (corners[1:] + corners[:-1]) / 2)
    time = np.union1d(motion.time, corners[(corners > 0) & (corners < motion.duration)])
    v = command.speeds(time)
    steps = np.diff(time)[:, None] * (v[1:] + v[:-1]) / 2
    angle = motion.q[0] + np.vstack([np.zeros(motion.n), np.cumsum(steps, axis=0)])
    lost = np.abs(angle[np.searchsorted(time, motion.time)] - motion.q)
    beyond = ~(lost <= _ANGLE_TOLERANCE * (1 + np.ptp(angle, axis=0)))
    for i, k in np.argwhere(beyond):
        raise InputError(
            f"{where}{_place(robot, motion, i, k)}: commanded for so short that a period of "
            f"{motion.period:g} s loses {np.degrees(lost[:, k].max()):.3g} deg, expected a "
            "shorter period, or segments and swings of several periods"
        )


def checked_torque(robot: Robot, motion: Motion, *, torque_margin: float = 1.0) -> Array:
    """Joint torques that a motion needs, with the motors' inertia, joint side [N m], (N + 1, n).

    The torques are those at the samples. Until the next one positions and speeds go on, with the
    same acceleration; how far the torques then grow, `margins` tells.

    Raises:
        InputError: if the motion has another number of joints, or leaves the torque, speed,
            acceleration or position limits: naming joint, time, what it needs and what there is.
    """
    torque = inverse_dynamics(robot, motion.q, motion.v, motion.vd)
    asked, _ = _of_motors(robot, torque, motion.v)
    check_no_load_speed(robot, motion)
    fastest, quickest = robot.velocity_limit, robot.acceleration_limit
    for quantity, values, limits, slack in (
        ("torque [N m]", asked, robot.torque_range(motion.v, torque_margin), TORQUE_TOLERANCE),
        ("speed [rad/s]", motion.v, (-fastest, fastest), SPEED_TOLERANCE),
        ("acceleration [rad/s²]", motion.vd, (-quickest, quickest), ACCELERATION_TOLERANCE),
    ):
        _refuse_beyond(robot, motion, quantity, values, limits, slack)
    check_stops(robot, motion)
    return torque


def checked_plan(
    robot: Robot,
    motion: Motion,
    commanded: Motion,
    torque_margin: float,
    limited: NDArray[np.bool_] | None = None,
) -> Plan:
    """The plan of a motion; by default one in which no joint is held back.

    Raises:
        InputError: as `checked_torque`.
    """
    torque = checked_torque(robot, motion, torque_margin=torque_margin)
    free = np.zeros(motion.q.shape, dtype=np.bool_)
    return Plan(motion, torque, free if limited is None else limited, torque_margin, commanded)


def check_no_load_speed(robot: Robot, motion: Motion) -> None:
    """Raise InputError where a motor has no torque left to drive with, whatever is asked of it:
    naming joint, time and speed."""
    if robot.envelope is not None:
        most = robot.envelope.n0 / robot.gear_ratio
        why = f", the no-load speed (n0) by {robot.envelope.source}"
        _, v = _of_motors(robot, motion.v, motion.v)
        _refuse_beyond(robot, motion, "speed [rad/s]", v, (-most, most), SPEED_TOLERANCE, why)


def _of_motors(robot: Robot, torque: Array, v: Array) -> tuple[Array, Array]:
    """Torques and speeds of the motors, by the gear ratio of their own joints: what those would
    have, where no motor turns with another joint."""
    if not robot.is_coupled:
        return torque, v
    return robot.motor_torque(torque) * robot.gear_ratio, robot.of_motors(v) / robot.gear_ratio


def check_stops(robot: Robot, motion: Motion) -> None:
    """Raise InputError if a joint leaves its position limits: naming joint, time and angle."""
    stops = robot.position_lower, robot.position_upper
    _refuse_beyond(robot, motion, "position [rad]", motion.q, stops, 1e-9)


def _refuse_beyond(
    robot: Robot,
    motion: Motion,
    quantity: str,
    values: Array,
    limits: tuple[Array, Array],
    slack: float,
    why: str = "",
) -> None:
    lower, upper = (np.broadcast_to(limit, values.shape) for limit in limits)
    beyond = (values < lower - slack) | (values > upper + slack)
    for i, k in np.argwhere(beyond):
        name, unit = quantity.rstrip("]").split(" [")
        raise InputError(
            f"{_place(robot, motion, i, k)}: needs {name} {values[i, k]:.6g} {unit}, available "
            f"{lower[i, k]:.6g} to {upper[i, k]:.6g} {unit}{why}"
        )


def _place(robot: Robot, motion: Motion, i: int, k: int) -> str:
    return f"{robot.joint(k)} at {motion.time[i]:.3f} s"


def ends_in_motion(robot: Robot, motion: Motion) -> list[str]:
    """For people: each joint that starts or ends in motion, and its speed."""
    return [
        f"{robot.joint(k)} {when} at {v[k]:.4g} rad/s"
        for v, when in ((motion.v[0], "starts"), (motion.v[-1], "ends"))
        for k in np.flatnonzero(np.abs(v) > _REST).tolist()
    ]


# --- margins ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Tightest:
    """The sample at which a limit is used most.

    Attributes:
        joint: number of the joint, from 0.
        quantity: "torque", "torque at speed", "speed", "acceleration" or "position".
        share: of the limit that is used [-].
        time: [s].
    """

    joint: int
    quantity: str
    share: float
    time: float

    @property
    def left(self) -> float:
        """What is left of the limit [-]; negative if it is not kept."""
        return 1 - self.share


@dataclass(frozen=True, eq=False)
class Margins:
    """A motion against the limits of the robot; joint side.

    Attributes:
        time: of the samples [s], shape (N + 1,).
        torque: joint torque with the motors' inertia at the samples [N m], shape (N + 1, n).
        lowest, highest: torque that the motors can give [N m], shape (N + 1, n): at any speed, or
            what their torque-speed envelope leaves of it.
        rms_torque: over the motion [N m], shape (n,).
        growth: how much larger |torque| is between the samples than at them, at most [N m],
            shape (n,).
        to_stop: smallest angle to a stop [rad], shape (n,); inf where there is none.
        share: share of each limit that is used [-], by quantity, shape (N + 1, n). Only limits
            that the robot has.
    """

    time: Array
    torque: Array
    lowest: Array
    highest: Array
    rms_torque: Array
    growth: Array
    to_stop: Array
    share: dict[str, Array]

    @property
    def peak_torque(self) -> Array:
        """Largest |torque| [N m], shape (n,)."""
        return np.abs(self.torque).max(axis=0)

    def tightest(self, joint: int) -> Tightest:
        """Where joint number `joint`, from 0, has the smallest margin."""
        places = []
        for quantity, share in self.share.items():
            i = int(share[:, joint].argmax())
            places.append(Tightest(joint, quantity, float(share[i, joint]), float(self.time[i])))
        return max(places, key=lambda place: place.share)

    @property
    def smallest(self) -> Tightest:
        """Where the whole motion has its smallest margin."""
        return max(map(self.tightest, range(len(self.rms_torque))), key=lambda place: place.share)


def margins(robot: Robot, motion: Motion) -> Margins:
    """Hold a motion against torque, speed, acceleration and position limits.

    Torque against the motion (braking) is not reduced by the torque-speed envelope of the motors.

    A position is measured from the middle between two stops; towards a single one from where the
    motion starts.

    Args:
        robot: the robot, with the envelope of its motors, if any.
        motion: the motion; it may be beyond the limits.

    Raises:
        InputError: for a motion of another number of joints.
    """
    torque = inverse_dynamics(robot, motion.q, motion.v, motion.vd)
    limit = np.broadcast_to(robot.effort_limit, torque.shape)
    lowest, highest = robot.torque_range(motion.v)
    signed, v = _of_motors(robot, torque, motion.v)
    asked = np.abs(signed)
    share = {"torque": asked / limit}
    if robot.envelope is not None and robot.envelope.limits:
        available = np.where(signed > 0, highest, -lowest)
        # At n0 nothing is left: what is asked for there is beyond any share.
        share["torque at speed"] = np.divide(
            asked,
            available,
            out=np.where(asked <= TORQUE_TOLERANCE, 0.0, np.inf),
            where=available > 0,
        )
    for quantity, values, limit in (
        ("speed", v, robot.top_speed),
        ("acceleration", motion.vd, robot.acceleration_limit),
    ):
        if np.isfinite(limit).any():
            share[quantity] = np.abs(values) / limit
    lower, upper = robot.position_lower, robot.position_upper
    if np.isfinite([lower, upper]).any():
        share["position"] = _position_share(motion.q, lower, upper)
    return Margins(
        time=motion.time,
        torque=torque,
        lowest=lowest,
        highest=highest,
        rms_torque=np.sqrt(np.mean(torque[:-1] ** 2, axis=0)),  # the last sample lasts no time
        growth=_growth(robot, motion, torque),
        to_stop=np.minimum(motion.q - lower, upper - motion.q).min(axis=0),
        share=share,
    )


def _position_share(q: Array, lower: Array, upper: Array) -> Array:
    """How much of the way to the stops is used, shape (N + 1, n); 0 where there are none."""
    both = np.isfinite(lower) & np.isfinite(upper)
    with np.errstate(invalid="ignore", divide="ignore"):
        start = np.where(both, (lower + upper) / 2, q[0])
        up, down = (q - start) / (upper - start), (start - q) / (start - lower)
    at_stop = (q <= lower) | (q >= upper)  # also where it starts there, and there is no way to it
    return np.fmax(np.fmax(up, down), at_stop.astype(float))


def _growth(robot: Robot, motion: Motion, torque: Array) -> Array:
    """By how much |torque| exceeds its peak at the samples until the next one, shape (n,)."""
    # Position and speed move on a little and one way, so the ends of a period tell.
    end = inverse_dynamics(robot, motion.q[1:], motion.v[1:], motion.vd[:-1])
    return np.maximum(np.abs(end).max(axis=0) - np.abs(torque).max(axis=0), 0)
