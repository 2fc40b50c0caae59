"""Gains of the PI speed controllers, and the feedforward torque."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.robot.dynamics import decouple
from sdt_drake.robot.robot import Robot

STRUCTURES = {"pi": 1.0, "p_in_feedback": 0.0}
"""Set-point weights by the names that controllers have in Figure 4: PI on the error, and I-P."""


@dataclass(frozen=True, eq=False)
class SpeedGains:
    """The gains of n speed controllers, **motor side**: from motor speed to motor torque."""

    kp: Array
    """K_PS, proportional gain [N m s/rad], shape (n,)."""
    ki: Array
    """K_IS, integral gain [N m/rad], shape (n,)."""


def tune(
    i_eff_max: ArrayLike, omega_r: float, zeta: ArrayLike, omega_ratio: float = 0.5
) -> SpeedGains:
    """Return the controller gains for a natural frequency and a damping ratio.

        K_IS = (ratio omega_r)² I_eff,max,    K_PS = 2 zeta sqrt(I_eff,max K_IS)

    The natural frequency is ratio omega_r at the largest inertia. The paper's ratio of 0.5 keeps
    the loop an octave below the structure.

    Args:
        i_eff_max: largest effective inertia, motor side [kg m²], shape (n,).
        omega_r: lowest natural frequency of the structure [rad/s].
        zeta: damping ratio at the largest inertia [-], shape (n,) or one for all.
        omega_ratio: omega_n / omega_r [-].

    Raises:
        InputError: if the gains overflow or underflow.

    >>> gains = tune([4.0], omega_r=10.0, zeta=1.0)
    >>> gains.ki.item(), gains.kp.item()
    (100.0, 40.0)
    """
    i_eff_max, zeta = np.asarray(i_eff_max, dtype=float), np.asarray(zeta, dtype=float)
    with np.errstate(over="ignore"):
        ki = np.square(omega_ratio * omega_r) * i_eff_max
        kp = 2 * zeta * np.sqrt(i_eff_max * ki)
    if not np.all(np.isfinite(kp)):
        raise InputError(
            f"gains too large for a number: inertia {i_eff_max.tolist()} kg m², "
            f"omega_r {omega_r:g} rad/s, zeta {zeta.tolist()}"
        )
    if np.any(kp <= 0) or np.any(ki <= 0):
        raise InputError(
            f"{omega_r:g} rad/s, expected more: the gains are too small for a number",
            place="omega_r",
        )
    return SpeedGains(kp=kp, ki=ki)


def natural_frequency(gains: SpeedGains, i_eff: ArrayLike) -> Array:
    """Return omega_n = sqrt(K_IS / I_eff) [rad/s] (Eq. 5); I_eff motor side [kg m²], shape (n,)."""
    return np.sqrt(gains.ki / np.asarray(i_eff))


def damping_ratio(gains: SpeedGains, i_eff: ArrayLike) -> Array:
    """Return zeta = K_PS / (2 sqrt(I_eff K_IS)) [-] (Eq. 6); I_eff motor side [kg m²], (n,)."""
    return gains.kp / (2 * np.sqrt(np.asarray(i_eff) * gains.ki))


def oscillation_frequency(gains: SpeedGains, i_eff: ArrayLike) -> Array:
    """Return omega_0 = omega_n sqrt(1 - zeta²) [rad/s], or 0 at zeta >= 1; I_eff in [kg m²]."""
    zeta = np.minimum(damping_ratio(gains, i_eff), 1.0)
    return natural_frequency(gains, i_eff) * np.sqrt(1 - zeta**2)


# --- torque feedforward ---------------------------------------------------------------------

FeedforwardKind = Literal["none", "ctc", "id"]
FEEDFORWARDS: tuple[FeedforwardKind, ...] = get_args(FeedforwardKind)
"""Feedforwards: none, the load torque of Algorithm 1, or the inverse dynamics."""


def feedforward_torque(
    feedforward: str, model: Robot, groups: Sequence[ArrayLike], vd: Array, sign: str
) -> Array:
    """Return the feedforward torque, **motor side** [N m], shape (n,) or (N, n).

        "ctc":  tau_LD of Algorithm 1
        "id":   (inertial + reaction + velocity + gravity + r² I_m vd) / r

    Args:
        feedforward: "none", "ctc" or "id".
        model: controller's model.
        groups: torque groups of the model (Eq. 2), joint side [N m]: inertial, reaction, velocity,
            gravity.
        vd: reference acceleration, joint side [rad/s²].
        sign: sign of Algorithm 1's third branch, one of `sdt_drake.robot.dynamics.SIGNS`.
    """
    inertial, reaction, velocity, gravity = (np.asarray(group) for group in groups)
    coupled = reaction + velocity + gravity
    if feedforward == "none":
        return np.zeros_like(inertial)
    if feedforward == "ctc":
        return decouple(inertial, coupled, model.gear_ratio, sign).load_torque
    return (inertial + coupled + model.reflected_inertia * vd) / model.gear_ratio
