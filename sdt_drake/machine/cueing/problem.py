"""The problem of cueing: the head's motion and percept in flight, and the limits of the device."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from sdt_drake.io.arguments import finite_number, whole_periods
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.machine.cueing.felt import felt
from sdt_drake.motion.plan import INTERPOLATION_PERIOD
from sdt_drake.motion.retiming import torque_of_periods
from sdt_drake.motion.trajectory import Motion
from sdt_drake.pilot.head import GRAVITY, check_head, head_motion
from sdt_drake.pilot.observer import PerceptionModel
from sdt_drake.pilot.thresholds import AXES, LINEAR
from sdt_drake.robot.dynamics import inverse_dynamics
from sdt_drake.robot.lacks import PLANNING
from sdt_drake.robot.robot import Robot

RATE = np.radians(1.58 * np.array(AXES))
"""Threshold of perception of the rotation about x, y, z [rad/s]; see `AXES`."""

VERTICAL = math.radians(1.6)
"""Threshold of perception of a tilt [rad]: pitch at 0.2 Hz (Suri & Clark 2020)."""

FORCE = max(LINEAR)
"""Threshold of perception of the specific force in any direction [m/s²]: that along z."""

SPEED_SHARE = 0.98
"""Share of the joints' speed limit that a motion uses [-]."""


_MAX_TILT = 1e-6  # of a vertical axis [rad]


def has_arm(robot: Robot) -> bool:
    """Return True if joint 1 turns about the vertical."""
    axis, _ = robot.joint_at_zero(robot.joint_names[0])
    down = robot.plant.gravity_field().gravity_vector() / GRAVITY
    return bool(np.linalg.norm(np.cross(axis, down)) < _MAX_TILT)


def check_program(robot: Robot, knot: float, period: float) -> None:
    """Refuse robots and times between knots [s] without a solution, for a period of motions [s]."""
    check_head(robot.having(*PLANNING))
    if robot.n < 2:
        raise InputError(f"{robot.path}: 1 joint, expected at least 2")
    whole_periods(knot, period, "knot")
    if knot > 1:
        raise InputError(f"{knot:g} s, expected at most 1 s", place="knot")


def resultant(value: float, name: str) -> float:
    """Check a resultant before a flight [G]."""
    if not 1 <= finite_number(value, name) <= 10:
        raise InputError(f"{value:g} G, expected 1 to 10 G", place=name)
    return float(value)


@dataclass(frozen=True)
class Weights:
    """Weights of squared errors, each over its threshold of perception [-]."""

    g: float = 1.0
    """Weight of the specific force."""
    vertical: float = 1.0
    """Weight of the felt vertical."""
    rotation: float = 1.0
    """Weight of the felt rotation."""
    acceleration: float = 1.0
    """Weight of the felt acceleration."""

    def times(self, factor: float) -> Weights:
        """Return the weights with a factor on that of G, if it is below 1 on all but rotation.

        With smaller and smaller factors the device comes to rest.
        """
        less = min(factor, 1.0)
        return Weights(
            factor * self.g, less * self.vertical, self.rotation, less * self.acceleration
        )


@dataclass(frozen=True, eq=False)
class Problem:
    """The desired head motion at knots, and the limits of the device."""

    robot: Robot
    """The device with a frame `head`."""
    model: PerceptionModel
    """The perception model of the pilot."""
    knot: float
    """Time between knots [s]."""
    head: Array
    """Specific force [m/s²] and angular rate [rad/s] in flight, shape (N, 6)."""
    felt: Array
    """Felt gravity [G], rate [rad/s] and acceleration [m/s²] in flight, shape (N, 9)."""
    weight: Array
    """Weights of the errors of force and of percept at each knot [-], shape (N, 2)."""
    weights: Weights
    """Weights of the errors beside one another."""
    torque_share: float
    """Share of the motors' torque to use [-]; inf for unlimited torque."""
    lower: Array
    """Lower limits of the angles [rad], shape (n,)."""
    upper: Array
    """Upper limits of the angles [rad], shape (n,)."""
    arm: bool
    """True if joint 1 turns about the vertical, so that its angle is not felt."""
    shift: Array | float = 0.0
    """Shift of the limits in `excess`, shape (N, 4 n)."""
    angles: Array | None = None
    """Angles to come near instead of the flight [rad], shape (N, n); None for none."""
    first: Array | None = None
    """State of the observer at the first knot, where the joints' state is given, too, and an arm
    may turn at the end, shape (12,); None for angles to be found and rest at both ends."""

    @property
    def count(self) -> int:
        """Number of knots."""
        return len(self.head)

    def stops(self, arm: float) -> tuple[Array, Array]:
        """Return lower and upper limits of the angles [rad], those of an arm from -arm to arm."""
        ends = self.lower.copy(), self.upper.copy()
        if self.arm:
            ends[0][0], ends[1][0] = -arm, arm
        return ends

    @cached_property
    def scale(self) -> Array:
        """Factors from errors of force and percept to those of the cost, shape (N, 12)."""
        W = self.weights
        own = np.concatenate([
            np.full(3, math.sqrt(W.g) / FORCE), np.full(3, math.sqrt(W.vertical) / VERTICAL),
            math.sqrt(W.rotation) / RATE, math.sqrt(W.acceleration) / np.array(LINEAR),
        ])  # fmt: skip
        return np.sqrt(self.knot * np.repeat(self.weight, [3, 9], axis=1)) * own

    def error(self, states: Array, head: Array) -> Array:
        """Return the errors of force and percept in the cost, shape (..., N, 12)."""
        force = head[..., :3] - self.head[:, :3]
        percept = felt(self.model, states, head) - self.felt
        return self.scale * np.concatenate([force, percept], axis=-1)

    def excess(self, s: Array) -> tuple[Array, Array]:
        """Return the excess over limits, and the sides at which they are, shape (N, 4 n) each.

        The limits are those of torque, speed and acceleration, as shares, and of the angles [rad].
        """
        q, v, a = np.split(s, 3, axis=1)
        speed, acceleration = self.speeds
        used = [self.torque_use(s), v / speed, a / acceleration]
        above, below = q - self.upper, self.lower - q
        over = np.hstack([*(np.abs(x) - 1 for x in used), np.maximum(above, below)])
        return over, np.hstack([*map(np.sign, used), np.where(above > below, 1.0, -1.0)])

    @property
    def speeds(self) -> tuple[Array, Array]:
        """Limits of speed [rad/s] and acceleration [rad/s²], shape (n,) each."""
        return SPEED_SHARE * self.robot.top_speed, SPEED_SHARE * self.robot.acceleration_limit

    def torque_use(self, s: Array) -> Array:
        """Return the torque over its usable range, from -1 to 1, shape (..., n)."""
        q, v, a = (x.reshape(-1, self.robot.n) for x in np.split(s, 3, axis=-1))
        if not math.isfinite(self.torque_share):
            return np.zeros((*s.shape[:-1], self.robot.n))
        torque = self.robot.gear_torque(inverse_dynamics(self.robot, q, v, a))
        low, high = self.robot.torque_range(v, self.torque_share)
        used = (2 * torque - high - low) / np.maximum(high - low, 1e-9)
        return used.reshape(*s.shape[:-1], self.robot.n)

    def head_at(self, s: Array) -> Array:
        """Return specific force and rate of the head, shape (..., 6)."""
        head = head_motion(self.robot, *np.split(s.reshape(-1, s.shape[-1]), 3, axis=-1))
        both = np.hstack([head.specific_force, head.angular_velocity])
        return both.reshape(*s.shape[:-1], 6)


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Angles, speeds and accelerations of the joints at knots, shape (N, n) each; see `Problem`."""

    knot: float
    """Time between knots [s]."""
    q: Array
    v: Array
    a: Array
    merit: float = math.inf
    """The minimised cost of errors, jerk and limits."""
    states: Array | None = None
    """States of the pilot's observer, shape (N, 12); None if not known."""

    @property
    def parts(self) -> tuple[Array, Array, Array]:
        """The arrays q, v and a."""
        return self.q, self.v, self.a

    @property
    def jerk(self) -> Array:
        """The jerks between knots [rad/s³], shape (N - 1, n)."""
        return np.diff(self.a, axis=0) / self.knot

    @cached_property
    def motion(self) -> Motion:
        """The motion at the period of planned motions."""
        period = INTERPOLATION_PERIOD
        steps = round(self.knot / period)
        i, within = np.divmod(np.arange((len(self.q) - 1) * steps + 1), steps)
        i, t = np.minimum(i, len(self.q) - 2), (within * period)[:, None]
        t[-1] = self.knot
        v = self.v[i] + self.a[i] * t + self.jerk[i] * t**2 / 2
        v[[0, -1]] = 0.0
        return Motion.from_speeds(period, self.q[0], v)

    def refined(self) -> Trajectory:
        """Return the same trajectory with an additional knot in the middle between any two."""
        t = self.knot / 2
        q, v, a = (x[:-1] for x in self.parts)
        middles = (
            q + v * t + a * t**2 / 2 + self.jerk * t**3 / 6,
            v + a * t + self.jerk * t**2 / 2,
            a + self.jerk * t,
        )
        places = np.arange(1, len(self.q))
        both = zip(self.parts, middles, strict=True)
        q, v, a = (np.insert(x, places, middle, axis=0) for x, middle in both)
        return Trajectory(t, q, v, a)


@lru_cache(maxsize=64)  # asked for by the search, and for the figures
def torque_and_speed(robot: Robot, motion: Motion) -> tuple[Array, Array]:
    """Return torques [N m] and speeds [rad/s] at the starts, then the ends of periods, (2N, n)."""
    return np.vstack(torque_of_periods(robot, motion)), np.vstack([motion.v[:-1], motion.v[1:]])
