"""What a real device adds to a rigid, frictionless plant with ideal drives."""

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.fields import (
    EachJoint,
    EachJointOrNone,
    Input,
    NotNegative,
    Number,
    OneOf,
    Positive,
    Problems,
    setting,
)
from sdt_drake.robot.envelope import Envelope

# --- drives ----------------------------------------------------------------------------------

SHORTEST_PERIOD = 125e-6  # s; the speed loop of SINAMICS S120, servo control at 4 kHz


@dataclass
class Drive(Input):
    """What lies between the controller's law and the torque of the motors.

    Everything is ideal unless given. Lists have one value for each joint.
    """

    period: Number | None = setting(None, ge=SHORTEST_PERIOD, unit="s")
    """Sampling period of the speed loop; 125 µs to the interpolation period, which it must
    divide. Continuous by default."""
    torque_bandwidth: Positive | None = setting(None, unit="Hz")
    """-3 dB frequency of the torque loop, a first-order lag."""
    torque_error: EachJoint[Annotated[Number, Field(gt=-1, lt=1)]] | None = setting(None, unit="-")
    """The motors give (1 + torque_error) of the torque they should."""
    encoder_resolution: EachJoint[Annotated[Number, Field(ge=1)]] | None = setting(
        None, unit="1/rev", side="motor"
    )
    """Increments of each encoder per revolution **of the motor**; speed is then the difference
    of positions over `period`."""
    n1: EachJoint[Positive] | None = setting(None, unit="rad/s", side="motor")
    """Motor speed up to which the full torque is available; by default that of the motors of
    the catalogue that the device has."""
    n0: EachJoint[Positive] | None = setting(None, unit="rad/s", side="motor")
    """Motor speed at which none is left to accelerate any more; likewise."""
    reference_delay: NotNegative = setting(0.0, unit="s")
    """How late the reference and all that is computed from it arrives."""

    @property
    def envelope(self) -> Envelope | None:
        """The envelope that n1 and n0 give; None without them."""
        if self.n1 is None or self.n0 is None:
            return None
        n1, n0 = (np.array(speeds, dtype=float) for speeds in (self.n1, self.n0))
        return Envelope(n1, n0, "drive.n1 and drive.n0")

    def problems(self) -> Problems:
        if self.encoder_resolution is not None and self.period is None:
            yield "encoder_resolution", "needs period, to take the speed"
        if (self.n1 is None) != (self.n0 is None):
            yield "n1" if self.n1 is None else "n0", "missing, expected n1 and n0 or neither"
        elif self.n1 and self.n0 and any(a >= b for a, b in zip(self.n1, self.n0, strict=False)):
            yield "n0", f"{self.n0}, expected more than n1, {self.n1}, everywhere"


# --- elastic joints: a spring and a damper between each motor and its link -------------------

ENCODERS = ("motor", "link")


@dataclass
class Elasticity(Input):
    """Elastic joints, given by their natural frequencies."""

    natural_frequency: EachJointOrNone[NotNegative] = setting([], unit="rad/s")
    """Of each link against its motor at a standstill, the other joints held, where the motion
    has its largest inertia, of the robot without deviation; 0: this joint is rigid. By default
    all are."""
    damping_ratio: NotNegative = setting(0.01, unit="-")
    """Of that oscillation."""
    encoder: Annotated[str, OneOf(ENCODERS)] = "motor"
    """Where the controller measures."""

    @property
    def is_rigid(self) -> bool:
        """Whether no joint is elastic."""
        return not any(self.natural_frequency)


@dataclass(frozen=True, eq=False)
class Springs:
    """Springs and dampers, **joint side**; arrays of shape (n,), 0 at rigid joints.

    Attributes:
        elastic: which joints are.
        stiffness: k [N m/rad].
        damping: c [N m s/rad].
    """

    elastic: NDArray[np.bool_]
    stiffness: Array
    damping: Array


def springs_of(elasticity: Elasticity, inertia: Array, gravity_stiffness: Array) -> Springs:
    """Springs and dampers of a choice: k = omega² d - k_g and c = 2 zeta omega d, so that (k + k_g)
    / d = omega².

    Args:
        elasticity: gives omega and zeta.
        inertia: d, of the links that each spring turns, joint side [kg m²], shape (n,).
        gravity_stiffness: k_g, change of the joint's gravity torque with its angle [N m/rad],
            shape (n,).

    Raises:
        InputError: where gravity alone makes the link swing faster than omega.
    """
    omega = np.array(elasticity.natural_frequency, dtype=float)
    elastic = omega > 0
    with np.errstate(over="ignore"):
        k = np.where(elastic, omega**2 * inertia - gravity_stiffness, 0.0)
        c = np.where(elastic, 2 * elasticity.damping_ratio * omega * inertia, 0.0)
    for j in np.flatnonzero(elastic & (k <= 0)):
        alone = np.sqrt(gravity_stiffness[j] / inertia[j])
        raise InputError(
            f"{omega[j]:g} rad/s, but gravity alone makes "
            f"joint {j + 1} swing with {alone:.4g}; expected more",
            place="plant.elasticity.natural_frequency",
        )
    for j in np.flatnonzero(~(np.isfinite(k) & np.isfinite(c))):
        raise InputError(
            f"natural_frequency {omega[j]:g} rad/s and damping_ratio "
            f"{elasticity.damping_ratio:g} are too large for joint {j + 1}",
            place="plant.elasticity",
        )
    return Springs(elastic, k, c)


# --- friction in the joints: Coulomb, viscous, Stribeck --------------------------------------

OVERFLOW_RATE = 400.0
"""How fast a bristle stretched beyond its limit slips back [1/s]: far above the control loops,
and slow enough for an explicit integrator at 5 ms."""

PRESLIDING_DAMPING_TIME = 0.005
"""Damping of a sticking joint over its stiffness [s]; assumed."""


@dataclass
class Friction(Input):
    """Friction of the joints, **joint side**; lists have one value for each joint.

    There is none by default.
    """

    coulomb: EachJoint[NotNegative] | None = setting(None, unit="N m", side="joint")
    """F_c, friction of a sliding joint at any speed, and the load that a joint at rest holds; 0
    by default."""
    viscous: EachJoint[NotNegative] | None = setting(None, unit="N m s/rad", side="joint")
    """b, beside the SDF's own damping; 0 by default."""
    breakaway: EachJoint[NotNegative] | None = setting(None, unit="N m", side="joint")
    """F_b, largest friction at low speed (Stribeck), at least `coulomb`, which is the default."""
    stribeck_speed: Positive = setting(0.02, unit="rad/s", side="joint")
    """v_s, at which friction has that peak."""
    presliding: Positive = setting(1e-05, unit="rad", side="joint")
    """z_c, how far a joint gives way before it slides."""
    offset: EachJoint[Number] | None = setting(None, unit="N m", side="joint")
    """F_0, what the motor carries beside all that, at any speed and at rest, as of a
    counterbalance that no link has; 0 by default."""

    @property
    def is_none(self) -> bool:
        """Whether there is no friction."""
        return self.coulomb is self.viscous is self.breakaway is self.offset is None

    def problems(self) -> Problems:
        largest, sliding = self.breakaway or [], self.coulomb or []
        if any(b < c for b, c in zip(largest, sliding, strict=False)):
            yield "breakaway", f"{largest}, expected at least coulomb, {sliding}"


@dataclass(frozen=True, eq=False)
class FrictionParameters:
    """`Friction` with its defaults filled in: arrays of shape (n,), joint side."""

    coulomb: Array
    viscous: Array
    breakaway: Array
    stribeck_speed: float
    presliding: float
    offset: Array


def friction_parameters(friction: Friction, n: int) -> FrictionParameters:
    """The friction of n joints."""

    def filled(values: list[float] | None, default: Array) -> Array:
        return default if values is None else np.array(values, dtype=float)

    coulomb = filled(friction.coulomb, np.zeros(n))
    return FrictionParameters(
        coulomb,
        filled(friction.viscous, np.zeros(n)),
        filled(friction.breakaway, coulomb),
        friction.stribeck_speed,
        friction.presliding,
        filled(friction.offset, np.zeros(n)),
    )


def stribeck(s: NDArray[Any]) -> Array:
    """Stribeck's term over its peak, at a speed over that of the peak: s exp((1 - s²) / 2)."""
    return np.asarray(s * np.exp((1 - s * s) / 2))


def speed_friction(friction: FrictionParameters, v: NDArray[Any]) -> Array:
    """Friction of joints at v [rad/s] but for Coulomb's, joint side [N m]; numbers or symbols.

    (F_b - F_c) (v / v_s) exp((1 - (v / v_s)²) / 2) + b v + F_0.
    """
    extra = friction.breakaway - friction.coulomb
    steady = friction.viscous * v + friction.offset
    return extra * stribeck(v / friction.stribeck_speed) + steady


def sliding_friction(friction: FrictionParameters, v: ArrayLike) -> Array:
    """Friction of joints that slide steadily at v [rad/s], shape (n,) or (N, n); F_0 at rest [N m].

    F_c sign(v) and `speed_friction`, joint side. The Stribeck term has its peak F_b - F_c at v_s.
    """
    v = np.asarray(v, dtype=float)
    return friction.coulomb * np.sign(v) + speed_friction(friction, v)


def sliding_stretch(friction: FrictionParameters, v: ArrayLike) -> Array:
    """z / z_c of bristles that slide steadily at v [rad/s]; 0 at rest [-]."""
    v = np.asarray(v, dtype=float)
    return np.sign(v) + v / (friction.presliding * OVERFLOW_RATE)
