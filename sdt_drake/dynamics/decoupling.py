"""Algorithm 1: what the other joints do to a motor, split into load and alleviation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from sdt_drake.arrays import Array

SIGNS = ("consistent", "printed")


class Loads(NamedTuple):
    """Coupling torques of each joint on its motor, **motor side**, shape (n,) or (N, n).

    Attributes:
        load_torque: tau_LD, what the motor must overcome [N m].
        alleviating_torque: tau_alleviate, help of the other motors towards the wanted
            acceleration, with its sign [N m].
    """

    load_torque: Array
    alleviating_torque: Array


def decouple(
    inertial: ArrayLike,
    coupled: ArrayLike,
    gear_ratio: ArrayLike,
    sign: str = "consistent",
) -> Loads:
    """Algorithm 1 of the paper.

    The three branches are one expression. With own = d_kk vd_k, the help is that part of
    -tau_coupled which points along `own` and does not exceed it:

        r tau_alleviate = clip(-tau_coupled, min(own, 0), max(own, 0))
        r tau_LD        = tau_coupled + r tau_alleviate

    so tau_coupled = r (tau_LD - tau_alleviate) holds by construction. The paper prints the third
    branch (acceleration and coupling opposed, coupling the larger) as tau_LD = -tau_k / r, which
    breaks that identity by 2 tau_k; `sign="printed"` follows the print.

    Args:
        inertial: d_kk vd_k, joint side [N m], shape (n,) or (N, n).
        coupled: tau_coupled of Eq. 4, joint side [N m], same shape.
        gear_ratio: r, motor over joint speed [-], shape (n,).
        sign: "consistent" or "printed".
    """
    own, coupled = np.asarray(inertial, dtype=float), np.asarray(coupled, dtype=float)
    help_ = np.minimum(np.maximum(-coupled, np.minimum(own, 0.0)), np.maximum(own, 0.0))
    load = coupled + help_
    if sign == "printed":
        third = (np.sign(own) != np.sign(coupled)) & (np.abs(own) <= np.abs(coupled))
        load = np.where(third, -(own + coupled), load)
    return Loads(load / gear_ratio, help_ / gear_ratio)
