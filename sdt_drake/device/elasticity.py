"""Elastic joints: a spring and a damper between each motor and its link."""

# Real annotations, for the check of the fields (sdt_drake.fields): they may not be postponed.
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sdt_drake.arrays import Array
from sdt_drake.errors import InputError
from sdt_drake.fields import setting

ENCODERS = ("motor", "link")


@dataclass(slots=True)
class Elasticity:
    """Elastic joints, given by their natural frequencies.

    Attributes:
        natural_frequency: of each link against its motor at a standstill, the other joints held,
            where the motion has its largest inertia; 0: this joint is rigid. By default all are.
        damping_ratio: of that oscillation.
        encoder: where the controller measures.
    """

    natural_frequency: list[float] = setting([], minimum=0, per_joint=True, unit="rad/s")
    damping_ratio: float = setting(0.01, minimum=0, unit="-")
    encoder: str = setting("motor", choices=ENCODERS)

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
    """k = omega² d - k_g and c = 2 zeta omega d, so that (k + k_g) / d = omega².

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
            f"plant.elasticity.natural_frequency: {omega[j]:g} rad/s, but gravity alone makes "
            f"joint {j + 1} swing with {alone:.4g}; expected more"
        )
    for j in np.flatnonzero(~(np.isfinite(k) & np.isfinite(c))):
        raise InputError(
            f"plant.elasticity: natural_frequency {omega[j]:g} rad/s and damping_ratio "
            f"{elasticity.damping_ratio:g} are too large for joint {j + 1}"
        )
    return Springs(elastic, k, c)
