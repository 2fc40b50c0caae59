"""The torque-speed envelope of motors: how much of their torque they have at which speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from sdt_drake.io.arrays import Array


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
        w = np.asarray(motor_speed, dtype=float)
        limited = np.isfinite(self.n0)
        n1, n0 = (np.where(limited, speed, no) for speed, no in ((self.n1, 0.0), (self.n0, 1.0)))
        return np.where(limited, np.clip((n0 - w) / (n0 - n1), 0, 1), 1.0)

    def range(self, limit: Array, motor_speed: ArrayLike) -> tuple[Array, Array]:
        """Least and largest torque at a speed; braking is not limited [N m], (..., n) each.

        Args:
            limit: largest torque at low speed [N m], shape (n,).
            motor_speed: [rad/s], shape (..., n).
        """
        w = np.asarray(motor_speed, dtype=float)
        return -limit * self.left(-w), limit * self.left(w)
