"""The torque-speed envelope of motors, and the widening of torque limits by coupling torques.

All functions accept numbers, or symbols of shape (n,).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pydrake.symbolic as sym
from numpy.typing import ArrayLike, NDArray

from sdt_drake.io.arrays import Array

_TINY = np.finfo(float).tiny


@dataclass(frozen=True, eq=False)
class Envelope:
    """The torque-speed envelope of motors, **motor side**. Torque falls linearly from n1 to n0."""

    n1: Array
    """Largest speed with full torque [rad/s], shape (n,); inf if unlimited."""
    n0: Array
    """Speed without driving torque [rad/s], > n1, shape (n,); inf if unlimited."""
    source: str
    """Origin of the speeds, as text."""

    @property
    def limits(self) -> bool:
        """True if any motor loses torque with speed."""
        return bool(np.isfinite(self.n0).any())

    @property
    def slope(self) -> Array:
        """Share of the torque that a motor loses per speed between n1 and n0 [s], shape (n,)."""
        limited = np.isfinite(self.n0)
        apart = np.subtract(self.n0, self.n1, out=np.ones_like(self.n0), where=limited)
        return np.where(limited, 1 / apart, 0.0)

    def available_fraction(self, motor_speed: ArrayLike) -> Array:
        """Return the available fraction of the driving torque [-], shape (..., n).

        Args:
            motor_speed: speed in the direction of the torque [rad/s], shape (..., n).
        """
        w = np.asarray(motor_speed)
        limited = np.isfinite(self.n0)
        n1, n0 = (np.where(limited, speed, no) for speed, no in ((self.n1, 0.0), (self.n0, 1.0)))
        return np.where(limited, 1 - _positive(1 - _positive((n0 - w) / (n0 - n1))), 1.0)

    def range(self, limit: Array, motor_speed: ArrayLike) -> tuple[Array, Array]:
        """Return the smallest and largest torque at a speed [N m], shape (..., n) each.

        Braking keeps the full torque.

        >>> motor = Envelope(np.array([10.0]), np.array([20.0]), "an example")
        >>> motor.range(np.array([5.0]), [15.0])
        (array([-5.]), array([2.5]))

        Args:
            limit: largest torque at low speed [N m], shape (n,).
            motor_speed: motor speed [rad/s], shape (..., n).
        """
        w = np.asarray(motor_speed)
        return -limit * self.available_fraction(-w), limit * self.available_fraction(w)


def widened(lower: Array, upper: Array, alleviating_torque: NDArray[Any]) -> tuple[Array, Array]:
    """Widen torque limits by the help of the other motors [N m], shape (..., n) each."""
    return lower - _positive(-alleviating_torque), upper + _positive(alleviating_torque)


def _positive(x: NDArray[Any]) -> Array:
    """Return max(x, 0). Symbols get a derivative at 0, where Drake's max has NaN."""
    if x.dtype != object:
        return np.maximum(x, 0.0)
    return np.array([sym.if_then_else(one > _TINY, one, sym.Expression(0)) for one in x])
