"""Friction in the joints: Coulomb, viscous, Stribeck."""

# Real annotations, for the check of the fields (sdt_drake.fields): they may not be postponed.
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Optional

import numpy as np
from numpy.typing import ArrayLike

from sdt_drake.arrays import Array
from sdt_drake.fields import setting

OVERFLOW_RATE = 400.0
"""How fast a bristle stretched beyond its limit slips back [1/s]: far above the control loops,
and slow enough for an explicit integrator at 5 ms."""

PRESLIDING_DAMPING_TIME = 0.005
"""Damping of a sticking joint over its stiffness [s]; assumed."""


@dataclass(slots=True)
class Friction:
    """Friction of the joints, **joint side**; lists have one value for each joint. None by default.

    Attributes:
        coulomb: F_c, friction of a sliding joint at any speed, and the load that a joint at rest
            holds; 0 by default.
        viscous: b, beside the SDF's own damping; 0 by default.
        breakaway: F_b, largest friction at low speed (Stribeck), at least `coulomb`, which is the
            default.
        stribeck_speed: v_s, at which friction has that peak.
        presliding: z_c, how far a joint gives way before it slides.
    """

    coulomb: Optional[list[float]] = setting(
        None, minimum=0, per_joint=True, unit="N m", side="joint"
    )
    viscous: Optional[list[float]] = setting(
        None, minimum=0, per_joint=True, unit="N m s/rad", side="joint"
    )
    breakaway: Optional[list[float]] = setting(
        None, minimum=0, per_joint=True, unit="N m", side="joint"
    )
    stribeck_speed: float = setting(0.02, above=0, unit="rad/s", side="joint")
    presliding: float = setting(1e-5, above=0, unit="rad", side="joint")

    @property
    def is_none(self) -> bool:
        """Whether there is no friction."""
        return self.coulomb is self.viscous is self.breakaway is None

    def problems(self) -> Iterator[tuple[str, str]]:
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
    )


def sliding_friction(friction: FrictionParameters, v: ArrayLike) -> Array:
    """Friction of joints that slide steadily at v [rad/s], shape (n,) or (N, n); 0 at rest [N m].

    F_c sign(v) + (F_b - F_c) (v / v_s) exp((1 - (v / v_s)²) / 2) + b v, joint side. The Stribeck
    term has its peak F_b - F_c at v_s.
    """
    v = np.asarray(v, dtype=float)
    s = v / friction.stribeck_speed
    stribeck = (friction.breakaway - friction.coulomb) * s * np.exp((1 - s**2) / 2)
    return friction.coulomb * np.sign(v) + stribeck + friction.viscous * v


def sliding_stretch(friction: FrictionParameters, v: ArrayLike) -> Array:
    """z / z_c of bristles that slide steadily at v [rad/s]; 0 at rest [-]."""
    v = np.asarray(v, dtype=float)
    return np.sign(v) + v / (friction.presliding * OVERFLOW_RATE)
