"""The limits of the motors' torque: how much of it they have at which speed, and with help.

The laws take numbers, or symbols of shape (n,).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pydrake.symbolic as sym
from numpy.typing import ArrayLike, NDArray

from sdt_drake.io.arrays import Array

_TINY = np.finfo(float).tiny


@dataclass(frozen=True, eq=False)
class Envelope:
    """Speeds between which each motor loses its torque, **motor side**; arrays of shape (n,).

    Attributes:
        n1: up to which the full torque is available [rad/s]; inf for a motor without a limit.
        n0: at which none is left to drive with [rad/s], > n1; inf for a motor without a limit.
        source: where the speeds are from, for people.
    """

    n1: Array
    n0: Array
    source: str

    @property
    def limits(self) -> bool:
        """Whether any motor loses torque with its speed."""
        return bool(np.isfinite(self.n0).any())

    @property
    def slope(self) -> Array:
        """Share of its torque that a motor loses between n1 and n0, over their difference [s]."""
        limited = np.isfinite(self.n0)
        apart = np.subtract(self.n0, self.n1, out=np.ones_like(self.n0), where=limited)
        return np.where(limited, 1 / apart, 0.0)

    def left(self, motor_speed: ArrayLike) -> Array:
        """Share of the torque that is left to drive with [-].

        Args:
            motor_speed: in the direction of the torque [rad/s], shape (..., n).
        """
        w = np.asarray(motor_speed)
        limited = np.isfinite(self.n0)
        n1, n0 = (np.where(limited, speed, no) for speed, no in ((self.n1, 0.0), (self.n0, 1.0)))
        return np.where(limited, 1 - _positive(1 - _positive((n0 - w) / (n0 - n1))), 1.0)

    def range(self, limit: Array, motor_speed: ArrayLike) -> tuple[Array, Array]:
        """Least and largest torque at a speed; braking is not limited [N m], (..., n) each.

        Args:
            limit: largest torque at low speed [N m], shape (n,).
            motor_speed: [rad/s], shape (..., n).
        """
        w = np.asarray(motor_speed)
        return -limit * self.left(-w), limit * self.left(w)


def widened(lower: Array, upper: Array, alleviating_torque: NDArray[Any]) -> tuple[Array, Array]:
    """Limits, each moved away by what the other motors help to its side [N m], (..., n) each."""
    return lower - _positive(-alleviating_torque), upper + _positive(alleviating_torque)


def _positive(x: NDArray[Any]) -> Array:
    """max(x, 0); of symbols with a derivative at 0 as well: that of Drake's max is NaN there."""
    if x.dtype != object:
        return np.maximum(x, 0.0)
    return np.array([sym.if_then_else(one > _TINY, one, sym.Expression(0)) for one in x])
