"""How near a motion comes to every limit of the robot, and where it is tightest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from sdt_drake.arrays import Array
from sdt_drake.dynamics import inverse_dynamics
from sdt_drake.motion.trajectory import Motion
from sdt_drake.robot import Robot


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


def margins(
    robot: Robot,
    motion: Motion,
    *,
    n1: ArrayLike | None = None,
    n0: ArrayLike | None = None,
) -> Margins:
    """Hold a motion against torque, speed, acceleration and position limits.

    A position is measured from the middle between two stops; towards a single one from where the
    motion starts.

    Args:
        robot: the robot.
        motion: the motion; it may be beyond the limits.
        n1, n0: motor speeds up to which the full torque is available, and at which none is left to
            drive with [rad/s], **motor side**, shape (n,), 0 < n1 < n0; as of a scenario's drive.
            Torque against the motion (braking) is not reduced. No envelope by default.
    """
    torque = inverse_dynamics(robot, motion.q, motion.v, motion.vd)
    limit = np.broadcast_to(robot.effort_limit, torque.shape)
    lowest, highest = -limit, limit
    share = {"torque": np.abs(torque) / limit}
    if n1 is not None:
        # What is left of each motor's torque to drive with at its speed.
        motor_speed = robot.gear_ratio * np.abs(motion.v)
        rated, no_load = np.asarray(n1), np.asarray(n0)
        left = np.clip((no_load - motor_speed) / (no_load - rated), 0, 1)
        lowest = np.where(motion.v < 0, left, 1) * lowest
        highest = np.where(motion.v > 0, left, 1) * highest
        available = np.where(torque > 0, highest, -lowest)
        # At n0 nothing is left: what is asked for there is beyond any share.
        share["torque at speed"] = np.divide(
            np.abs(torque), available, out=np.where(torque == 0, 0.0, np.inf), where=available > 0
        )
    for quantity, values, limit in (
        ("speed", motion.v, robot.velocity_limit),
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
    return np.fmax(np.fmax(up, down), 0)


def _growth(robot: Robot, motion: Motion, torque: Array) -> Array:
    """By how much |torque| exceeds its peak at the samples until the next one, shape (n,)."""
    # Position and speed move on a little and one way, so the ends of a period tell.
    end = inverse_dynamics(robot, motion.q[1:], motion.v[1:], motion.vd[:-1])
    return np.maximum(np.abs(end).max(axis=0) - np.abs(torque).max(axis=0), 0)
