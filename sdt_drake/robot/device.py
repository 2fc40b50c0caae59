"""Drives, elastic joints and friction: deviations of a real device from an ideal one."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, get_args

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
    Positive,
    Problems,
    Values,
    field,
)

# --- drives ----------------------------------------------------------------------------------

MIN_PERIOD = 125e-6
"""Shortest drive period [s]: the speed loop of SINAMICS S120, servo control at 4 kHz."""


@dataclass(frozen=True)
class Drive(Input):
    """The drives between the controller's law and the motors' torque.

    Everything is ideal by default. Lists have one value for each joint.
    """

    period: Number | None = field(None, ge=MIN_PERIOD, unit="s")
    """Drive period: sample period of the speed loop, from 125 µs to the interpolation period, which
    it must divide. Continuous by default."""
    torque_bandwidth: Positive | None = field(None, unit="Hz")
    """-3 dB frequency of the torque loop, a first-order lag. Unlimited by default."""
    torque_error: EachJoint[Annotated[Number, Field(gt=-1, lt=1)]] | None = field(None, unit="-")
    """Relative error of the motors' torque: they give (1 + torque_error) times their command."""
    encoder_resolution: EachJoint[Annotated[Number, Field(ge=1)]] | None = field(
        None, unit="1/rev", side="motor"
    )
    """Increments of each encoder per revolution **of the motor**. The speed is then the difference
    of positions over `period`."""
    n1: EachJoint[Positive] | None = field(None, unit="rad/s", side="motor")
    """Motor speed up to which the full torque is available. Default: that of the device's motors in
    the catalogue."""
    n0: EachJoint[Positive] | None = field(None, unit="rad/s", side="motor")
    """Motor speed at which no driving torque is left. Default: that of the device's motors in the
    catalogue."""
    ripple_harmonics: Values[Positive] = field((), unit="-")
    """Orders of torque ripple, periods per revolution **of the motor**; none by default."""
    ripple_amplitude: Values[Annotated[Number, Field(ge=0, le=1)]] = field((), unit="-")
    """Amplitude of each order, a share of each motor's largest torque."""
    reference_delay: NotNegative = field(0.0, unit="s")
    """Delay of the planned motion and of the feedforward computed from it. Drives with a `period`
    take both at their next sample. Position loops sample positions when they take them."""

    @property
    def is_ideal_torque(self) -> bool:
        """True if the motors give the limited torque at once and exactly."""
        is_exact = self.torque_bandwidth is None and self.torque_error is None
        return is_exact and not self.ripple_harmonics

    def problems(self) -> Problems:
        if self.encoder_resolution is not None and self.period is None:
            yield "encoder_resolution", "needs period, to compute the speed"
        if len(self.ripple_amplitude) != len(self.ripple_harmonics):
            text = f"{len(self.ripple_amplitude)} value(s), expected {len(self.ripple_harmonics)}"
            yield "ripple_amplitude", f"{text}, one for each of ripple_harmonics"
        if (self.n1 is None) != (self.n0 is None):
            yield "n1" if self.n1 is None else "n0", "missing, expected n1 and n0 or neither"
        elif self.n1 and self.n0 and any(a >= b for a, b in zip(self.n1, self.n0, strict=False)):
            yield "n0", f"{[*self.n0]}, expected more than n1, {[*self.n1]}, everywhere"


# --- elastic joints: a spring and a damper between each motor and its link -------------------

Encoder = Literal["motor", "link"]
ENCODERS: tuple[Encoder, ...] = get_args(Encoder)


@dataclass(frozen=True)
class Elasticity(Input):
    """Elastic joints, given by their natural frequencies."""

    natural_frequency: EachJointOrNone[NotNegative] = field((), unit="rad/s")
    """Natural frequency of each link against its motor at a standstill, with the other joints held.
    It applies where the motion has its largest inertia, without deviations. 0: a rigid joint. All
    joints are rigid by default."""
    damping_ratio: NotNegative = field(0.01, unit="-")
    """Damping ratio of this oscillation."""
    encoder: Encoder = "motor"
    """Side of the joint where the controller measures."""
    backlash: EachJoint[Annotated[Number, Field(ge=0, le=1)]] | None = field(
        None, unit="rad", side="joint"
    )
    """Play of the gear of elastic joints, from end to end, in which no torque is transmitted. 0 by
    default."""

    def problems(self) -> Problems:
        plays = self.backlash or ()
        omegas = self.natural_frequency or (0.0,) * len(plays)
        for k, (play, omega) in enumerate(zip(plays, omegas, strict=False)):
            if play and not omega:
                yield f"backlash[{k + 1}]", f"{play:g}, needs natural_frequency[{k + 1}] > 0"

    @property
    def is_rigid(self) -> bool:
        """True if no joint is elastic."""
        return not any(self.natural_frequency)


@dataclass(frozen=True, eq=False)
class Springs:
    """Springs and dampers of elastic joints, **joint side**; each of shape (n,), 0 if rigid."""

    elastic: NDArray[np.bool_]
    """True for elastic joints."""
    stiffness: Array
    """k [N m/rad]."""
    damping: Array
    """c [N m s/rad]."""
    backlash: Array | float = 0.0
    """Play from end to end [rad]."""


def springs_of(elasticity: Elasticity, inertia: Array, gravity_stiffness: Array) -> Springs:
    """Compute springs and dampers from natural frequencies omega and damping ratio zeta.

    k = omega² d - k_g and c = 2 zeta omega d, so that (k + k_g) / d = omega².

    Args:
        elasticity: omega and zeta.
        inertia: d, inertia of the links beyond each spring, joint side [kg m²], shape (n,).
        gravity_stiffness: k_g, derivative of the joint's gravity torque with respect to its angle
            [N m/rad], shape (n,).

    Raises:
        InputError: gravity alone makes a link swing faster than omega.
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
    return Springs(elastic, k, c, 0.0 * k + (elasticity.backlash or 0.0))


# --- friction in the joints: Coulomb, viscous, Stribeck --------------------------------------

OVERFLOW_RATE = 400.0
"""Rate at which a bristle stretched beyond its limit relaxes [1/s]. It is far above the control
loops, and slow enough for an explicit integrator at 5 ms."""

PRESLIDING_DAMPING_TIME = 0.005
"""T, damping of a sticking joint divided by its stiffness [s]; assumed."""


@dataclass(frozen=True)
class Friction(Input):
    """Friction of the joints, **joint side**, none by default. Lists have one value per joint."""

    coulomb: EachJoint[NotNegative] | None = field(None, unit="N m", side="joint")
    """F_c, Coulomb friction: constant friction of a sliding joint, and the load that a joint holds
    at rest. 0 by default."""
    viscous: EachJoint[NotNegative] | None = field(None, unit="N m s/rad", side="joint")
    """b, viscous friction in addition to the SDF's damping. 0 by default."""
    breakaway: EachJoint[NotNegative] | None = field(None, unit="N m", side="joint")
    """F_b, largest friction at low speed (Stribeck), at least `coulomb`. Default: `coulomb`."""
    stribeck_speed: Positive = field(0.02, unit="rad/s", side="joint")
    """v_s, speed of the largest friction."""
    stribeck_speeds: EachJoint[Positive] | None = field(None, unit="rad/s", side="joint")
    """v_s of each joint, in place of `stribeck_speed`, which is that of all."""
    presliding: Positive = field(1e-05, unit="rad", side="joint")
    """z_c, deflection of a joint before it slides."""
    offset: EachJoint[Number] | None = field(None, unit="N m", side="joint")
    """F_0, constant torque at any speed and at rest, such as that of a counterbalance. 0 by
    default."""

    @property
    def is_none(self) -> bool:
        """True without friction."""
        return self.coulomb is self.viscous is self.breakaway is self.offset is None

    def problems(self) -> Problems:
        largest, sliding = [*(self.breakaway or ())], [*(self.coulomb or ())]
        if any(b < c for b, c in zip(largest, sliding, strict=False)):
            yield "breakaway", f"{largest}, expected at least coulomb, {sliding}"
        if self.stribeck_speeds and self.stribeck_speed != Friction.stribeck_speed:
            yield "stribeck_speed", "expected only without stribeck_speeds"


@dataclass(frozen=True, eq=False)
class FrictionParameters:
    """The friction of n joints, with all defaults: arrays of shape (n,), joint side."""

    coulomb: Array
    viscous: Array
    breakaway: Array
    stribeck_speed: Array
    presliding: float
    offset: Array


def friction_parameters(friction: Friction, n: int) -> FrictionParameters:
    """Return the friction of n joints as arrays, with all defaults."""

    def filled(values: Sequence[float] | None, default: Array) -> Array:
        return default if values is None else np.array(values, dtype=float)

    coulomb = filled(friction.coulomb, np.zeros(n))
    return FrictionParameters(
        coulomb,
        filled(friction.viscous, np.zeros(n)),
        filled(friction.breakaway, coulomb),
        filled(friction.stribeck_speeds, np.full(n, friction.stribeck_speed)),
        friction.presliding,
        filled(friction.offset, np.zeros(n)),
    )


def stribeck(s: NDArray[Any]) -> Array:
    """Return Stribeck's term relative to its peak, s exp((1 - s²) / 2), with s = v / v_s [-]."""
    return np.asarray(s * np.exp((1 - s * s) / 2))


def speed_friction(friction: FrictionParameters, v: NDArray[Any]) -> Array:
    """Return the friction without Coulomb's part at v [rad/s], joint side [N m].

    (F_b - F_c) (v / v_s) exp((1 - (v / v_s)²) / 2) + b v + F_0, for numbers or symbols.
    """
    extra = friction.breakaway - friction.coulomb
    steady = friction.viscous * v + friction.offset
    return extra * stribeck(v / friction.stribeck_speed) + steady


def sliding_friction(friction: FrictionParameters, v: ArrayLike) -> Array:
    """Return the friction at steady speed v [rad/s], joint side [N m], shape (n,) or (N, n).

    The friction is F_c sign(v) plus `speed_friction`. At rest it is F_0.

    >>> friction = friction_parameters(Friction(coulomb=[10], viscous=[2]), 1)
    >>> sliding_friction(friction, [-3.0])
    array([-16.])
    """
    v = np.asarray(v, dtype=float)
    return friction.coulomb * np.sign(v) + speed_friction(friction, v)


def sliding_stretch(friction: FrictionParameters, v: ArrayLike) -> Array:
    """Return the relative bristle deflection z / z_c at steady speed v [rad/s]; 0 at rest [-]."""
    v = np.asarray(v, dtype=float)
    return np.sign(v) + v / (friction.presliding * OVERFLOW_RATE)
