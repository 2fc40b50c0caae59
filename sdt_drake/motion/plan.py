"""Plans, the checks that all planners share, and the margins of a motion to its limits."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sdt_drake.io.arguments import instance_of, takes, whole_periods
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.shown import Figure, Shown, Summary, higher, joint_count, of_joints
from sdt_drake.motion.command import Command
from sdt_drake.motion.trajectory import Loss, Motion
from sdt_drake.robot.dynamics import inverse_dynamics
from sdt_drake.robot.robot import Robot

INTERPOLATION_PERIOD = 0.005
"""Published interpolation period [s]."""
TORQUE_TOLERANCE = 1e-6  # N m
SPEED_TOLERANCE = 1e-9  # rad/s; round-off of a commanded speed
ACCELERATION_TOLERANCE = 1e-6  # rad/s²; SPEED_TOLERANCE over a period
_ANGLE_TOLERANCE = 1e-4  # rad, plus this share of the range; loss by sampling
# Plausible commands: no machine exceeds these, and inverse dynamics overflow far beyond them.
_MAX_ANGLE = 1e6  # rad
_MAX_SPEED = 1e4  # rad/s
_MAX_ACCELERATION = 1e6  # rad/s²
_MAX_REST_SPEED = 1e-3  # rad/s; a slower joint is at rest


@dataclass(frozen=True, eq=False, repr=False)
class Plan(Shown):
    """A planned motion within the robot's limits, and the torques that it needs."""

    motion: Motion
    """Planned motion."""
    torque: Array
    """Joint torque with rotor inertia at each sample, joint side [N m], shape (N + 1, n)."""
    limited: NDArray[np.bool_]
    """True where the planner held a joint back, shape (N + 1, n)."""
    torque_margin: float
    """Share of the motors' torque that the planner was allowed to use [-]."""
    commanded: Motion
    """Commanded motion at the same period."""
    loss: Loss | None = None
    """Loss by resampling of a motion file; None if nothing was resampled."""

    @property
    def longer(self) -> float:
        """Duration of the planned motion minus that of the commanded motion [s]."""
        return self.motion.duration - self.commanded.duration

    @property
    def angle_lost(self) -> Array:
        """Distance of the joints from their commanded angles at the end [rad], shape (n,)."""
        return np.abs(self.motion.q[-1] - self.commanded.q[-1])

    def summary(self) -> Summary:
        """Return duration, largest torques and the effect of the planner per joint."""
        title = f"of {joint_count(self.motion.n)}: {self.motion.in_time}"
        if self.longer > 0:
            title += f", {self.longer:.6g} s longer than commanded"
        columns = {
            "torque [N m]": (".1f", np.abs(self.torque).max(axis=0)),
            "held back [s]": (".3f", self.limited.sum(axis=0) * self.motion.period),
            "ends off by [deg]": (".2f", np.degrees(self.angle_lost)),
        }
        return of_joints(title, columns)

    @takes(robot=instance_of(Robot, "sdt_drake.load_robot"))
    def plot(self, robot: Robot) -> Figure:
        """Draw the torques and speeds of the motion with the limits of `robot`.

        Raises:
            InputError: if the robot has another number of joints.
        """
        return higher("show.figures.motions:plan")("Plan", robot, self, margins(robot, self.motion))

    def peak_use(self, robot: Robot) -> Array:
        """Return the largest share of each motor's torque limit [-], shape (n,)."""
        return np.max(np.abs(robot.gear_torque(self.torque)), axis=0) / robot.effort_limit


def commanded_motion(robot: Robot, command: Command, period: float) -> Motion:
    """Return the command sampled at the interpolation period, without a check of limits.

    Args:
        robot: robot with the joints of the command.
        command: commanded joint speeds.
        period: interpolation period [s].

    Raises:
        InputError: if the number of joints or the period does not fit the command; if angles,
            speeds or accelerations exceed 1e6 rad, 1e4 rad/s or 1e6 rad/s²; if sampling loses more
            than 1e-4 rad plus 1e-4 of the range of a joint's angles.
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

        def check(values: Array, limit: float, unit: str) -> None:
            for i, k in np.argwhere(~(np.abs(values) <= limit)):
                raise InputError(
                    f"{where}{robot.joint(k)} at {time[i]:.3f} s: commanded {values[i, k]:.4g} "
                    f"{unit}, expected at most {limit:g} {unit}"
                )

        v = command.speeds(time)
        check(v, _MAX_SPEED, "rad/s")
        motion = Motion.from_speeds(period, command.q0, v)
        check(motion.q, _MAX_ANGLE, "rad")
        check(motion.vd, _MAX_ACCELERATION, "rad/s²")
        _check_sampling(where, robot, command, motion)
    return motion


def _check_sampling(where: str, robot: Robot, command: Command, motion: Motion) -> None:
    """Refuse a command whose angles change too much by sampling.

    The exact angles are trapezoids between the samples, the corners of speed and their midpoints.
    They are exact for linear and cosine pieces of any length. The midpoints are for alignments,
    whose speed is 0 at both ends of a piece.
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
            f"{where}{_place(robot, motion, i, k)}: a period of {motion.period:g} s loses "
            f"{np.degrees(lost[:, k].max()):.3g} deg of the command, expected a shorter period, or "
            "segments and swings of several periods"
        )


def checked_torque(robot: Robot, motion: Motion, *, torque_margin: float = 1.0) -> Array:
    """Check a motion against all limits and return its joint torques.

    Args:
        robot: robot with its limits.
        motion: motion of its joints.
        torque_margin: share of the motors' torque that may be used, in (0, 1].

    Returns:
        Torques with rotor inertia at the samples, joint side [N m], shape (N + 1, n). `margins`
        reports their growth until the next sample.

    Raises:
        InputError: if the number of joints does not fit; if a torque, speed, acceleration or
            position is beyond its limit, with joint, time, needed and available value.
    """
    torque = inverse_dynamics(robot, motion.q, motion.v, motion.vd)
    at_gears = robot.gear_torque(torque)
    check_no_load_speed(robot, motion)
    v_max, vd_max = robot.velocity_limit, robot.acceleration_limit
    torque_name = "torque at its motor's gear [N m]" if robot.is_coupled else "torque [N m]"
    for quantity, values, limits, slack in (
        (torque_name, at_gears, robot.torque_range(motion.v, torque_margin), TORQUE_TOLERANCE),
        ("speed [rad/s]", motion.v, (-v_max, v_max), SPEED_TOLERANCE),
        ("acceleration [rad/s²]", motion.vd, (-vd_max, vd_max), ACCELERATION_TOLERANCE),
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
    """Check a motion and return its plan; by default no joint was held back.

    Raises:
        InputError: as `checked_torque`.
    """
    torque = checked_torque(robot, motion, torque_margin=torque_margin)
    free = np.zeros(motion.q.shape, dtype=np.bool_)
    return Plan(motion, torque, free if limited is None else limited, torque_margin, commanded)


def check_no_load_speed(robot: Robot, motion: Motion) -> None:
    """Raise InputError with joint and time if a motor exceeds its no-load speed."""
    if robot.envelope is not None:
        limit, v = robot.gear_speed_limit, robot.gear_speed(motion.v)
        why = f", the no-load speed (n0) by {robot.envelope.source}"
        _refuse_beyond(robot, motion, "speed [rad/s]", v, (-limit, limit), SPEED_TOLERANCE, why)


def check_stops(robot: Robot, motion: Motion) -> None:
    """Raise InputError with joint, time and angle if a joint leaves its position limits."""
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
    """Raise InputError at the first sample beyond the lower or upper limits by more than slack."""
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
    """Return a phrase with the speed of each joint that starts or ends in motion."""
    return [
        f"{robot.joint(k)} {when} at {v[k]:.4g} rad/s"
        for v, when in ((motion.v[0], "starts"), (motion.v[-1], "ends"))
        for k in np.flatnonzero(np.abs(v) > _MAX_REST_SPEED).tolist()
    ]


# --- margins ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Tightest:
    """The sample with the smallest margin."""

    joint: int
    """Index of the joint, from 0."""
    quantity: str
    """Limit: "torque", "torque at speed", "speed", "acceleration" or "position"."""
    share: float
    """Used share of the limit [-]."""
    time: float
    """[s]"""

    @property
    def left(self) -> float:
        """Margin: unused share of the limit [-]; negative beyond the limit."""
        return 1 - self.share


@dataclass(frozen=True, eq=False)
class Margins:
    """The margins of a motion to the limits of a robot, joint side.

    Torques are those at the outputs of the motors' gears. They are the joints' torques unless a
    motor turns with two joints.
    """

    time: Array
    """Times of the samples [s], shape (N + 1,)."""
    torque: Array
    """Torque with rotor inertia at the samples [N m], shape (N + 1, n)."""
    lowest: Array
    """Lowest available torque at the speed of each sample [N m], shape (N + 1, n)."""
    highest: Array
    """Highest available torque at the speed of each sample [N m], shape (N + 1, n)."""
    rms_torque: Array
    """RMS torque over the motion [N m], shape (n,)."""
    growth: Array
    """Peak of |torque| between the samples minus the peak at them, at least 0 [N m], shape (n,)."""
    to_stop: Array
    """Smallest distance to a position limit [rad], shape (n,); inf without one."""
    share: dict[str, Array]
    """Used share of each limit of the robot [-], by quantity (see `Tightest`), (N + 1, n)."""

    @property
    def peak_torque(self) -> Array:
        """Largest |torque| at the samples [N m], shape (n,)."""
        return np.abs(self.torque).max(axis=0)

    def tightest(self, joint: int) -> Tightest:
        """Return the sample with the smallest margin of joint index `joint`, from 0."""
        places = []
        for quantity, share in self.share.items():
            i = int(share[:, joint].argmax())
            places.append(Tightest(joint, quantity, float(share[i, joint]), float(self.time[i])))
        return max(places, key=lambda place: place.share)

    @property
    def smallest(self) -> Tightest:
        """Sample with the smallest margin of the whole motion."""
        return max(map(self.tightest, range(len(self.rms_torque))), key=lambda place: place.share)


def margins(robot: Robot, motion: Motion) -> Margins:
    """Compute the margins of a motion to torque, speed, acceleration and position limits.

    The torque-speed envelope of the motors reduces the torque in the direction of motion, not the
    braking torque. The share of a position limit is measured from the middle between two limits, or
    from the start of the motion towards a single one.

    Args:
        robot: robot with its limits.
        motion: motion of its joints; it may exceed the limits.

    Raises:
        InputError: if the motion has another number of joints.

    >>> from sdt_drake.motion.load import load_plan
    >>> from sdt_drake.robot.robot import load_robot
    >>> place = margins(load_robot(), load_plan("reference").motion).smallest
    >>> place.joint, place.quantity, place.time, round(place.left, 3)
    (1, 'torque', 9.0, 0.072)
    """
    torque = robot.gear_torque(inverse_dynamics(robot, motion.q, motion.v, motion.vd))
    lowest, highest = robot.torque_range(motion.v)
    needed = np.abs(torque)
    # Between samples angles and speeds change little and monotonically: the ends are checked.
    end = robot.gear_torque(inverse_dynamics(robot, motion.q[1:], motion.v[1:], motion.vd[:-1]))
    share = {"torque": needed / robot.effort_limit}
    if robot.envelope is not None and robot.envelope.limits:
        available = np.where(torque > 0, highest, -lowest)
        # No torque is available at n0: the share of any needed torque is infinite.
        share["torque at speed"] = np.divide(
            needed,
            available,
            out=np.where(needed <= TORQUE_TOLERANCE, 0.0, np.inf),
            where=available > 0,
        )
    if np.isfinite(robot.top_speed).any():
        share["speed"] = robot.speed_share(motion.v)
    if np.isfinite(robot.acceleration_limit).any():
        share["acceleration"] = np.abs(motion.vd) / robot.acceleration_limit
    lower, upper = robot.position_lower, robot.position_upper
    if np.isfinite([lower, upper]).any():
        share["position"] = _position_share(motion.q, lower, upper)
    return Margins(
        time=motion.time,
        torque=torque,
        lowest=lowest,
        highest=highest,
        rms_torque=np.sqrt(np.mean(torque[:-1] ** 2, axis=0)),  # the last sample has no duration
        growth=np.maximum(np.abs(end).max(axis=0) - needed.max(axis=0), 0),
        to_stop=np.minimum(motion.q - lower, upper - motion.q).min(axis=0),
        share=share,
    )


def _position_share(q: Array, lower: Array, upper: Array) -> Array:
    """Return the used share of the way to the position limits [-], (N + 1, n); 0 without them."""
    both = np.isfinite(lower) & np.isfinite(upper)
    with np.errstate(invalid="ignore", divide="ignore"):
        start = np.where(both, (lower + upper) / 2, q[0])
        up, down = (q - start) / (upper - start), (start - q) / (start - lower)
    at_stop = (q <= lower) | (q >= upper)  # also for a start at the limit, without a way to it
    return np.fmax(np.fmax(up, down), at_stop.astype(float))
