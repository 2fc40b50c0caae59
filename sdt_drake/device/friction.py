"""Friction in the joints: Coulomb, viscous, Stribeck."""

# Drake's YAML loader reads the annotations of `Friction`: not postponed, Optional[...] in full.
from dataclasses import dataclass, fields
from typing import Optional

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sdt_drake.errors import InputError, checked_number, checked_vector

Array = NDArray[np.float64]

OVERFLOW_RATE = 400.0
"""How fast a bristle stretched beyond its limit slips back [1/s]: far above the control loops,
and slow enough for an explicit integrator at 5 ms."""

PRESLIDING_DAMPING_TIME = 0.005
"""Damping of a sticking joint over its stiffness [s]; assumed."""


@dataclass
class Friction:
    """Friction of the joints, **joint side**; lists have one value for each joint.

    Attributes:
        coulomb: F_c, friction of a sliding joint at any speed, and the load that a joint at rest
            holds [N m]; 0 by default.
        viscous: b [N m s/rad], beside the SDF's own damping; 0 by default.
        breakaway: F_b, largest friction at low speed (Stribeck) [N m], at least `coulomb`, which
            is the default.
        stribeck_speed: v_s, at which friction has that peak [rad/s].
        presliding: z_c, how far a joint gives way before it slides [rad].
    """

    coulomb: Optional[list[float]] = None  # noqa: UP045
    viscous: Optional[list[float]] = None  # noqa: UP045
    breakaway: Optional[list[float]] = None  # noqa: UP045
    stribeck_speed: float = 0.02
    presliding: float = 1e-5

    def validate(self, where: str) -> None:
        """Check what does not need the robot.

        Raises:
            InputError: naming the field below `where`.
        """
        for name in ("stribeck_speed", "presliding"):
            checked_number(getattr(self, name), f"{where}.{name}", minimum=0, exclusive=True)

    def validate_sizes(self, n: int, where: str) -> None:
        """Check that every list has n values >= 0, and breakaway >= coulomb.

        Raises:
            InputError: naming the field below `where`.
        """
        for field in fields(self):
            values = getattr(self, field.name)
            if values is not None and field.name in ("coulomb", "viscous", "breakaway"):
                array = checked_vector(values, n, f"{where}.{field.name}")
                if np.any(array < 0):
                    raise InputError(f"{where}.{field.name}: {values} contains a value < 0")
        friction = friction_parameters(self, n)
        if np.any(friction.breakaway < friction.coulomb):
            raise InputError(
                f"{where}.breakaway: {self.breakaway}, expected at least coulomb, "
                f"{friction.coulomb.tolist()}"
            )


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
