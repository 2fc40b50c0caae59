"""Eq. 3: the inertia that a motor feels, and how it varies along a motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sdt_drake.arrays import Array
from sdt_drake.robot import Robot


def effective_inertia(robot: Robot, d_kk: ArrayLike) -> Array:
    """I_eff = I_m + d_kk / r² (Eq. 3), **motor side** [kg m²].

    Args:
        robot: gives the rotor inertias I_m and the gear ratios r.
        d_kk: diagonal of the links' mass matrix, joint side [kg m²], shape (n,) or (N, n).
    """
    return robot.rotor_inertia + np.asarray(d_kk) / robot.gear_ratio**2


def where_largest(d_kk: ArrayLike) -> NDArray[np.intp]:
    """First sample at which each joint's inertia is as large as it gets, round-off apart.

    Args:
        d_kk: diagonal of the links' mass matrix, joint side [kg m²], shape (N, n).

    Returns:
        Samples, shape (n,).
    """
    d_kk = np.asarray(d_kk)
    return np.argmax(d_kk >= (1 - 1e-9) * d_kk.max(axis=0), axis=0)


@dataclass(frozen=True, eq=False)
class InertiaRange:
    """How I_eff, motor side [kg m²], varies along a motion; each of shape (n,)."""

    maximum: Array
    median: Array
    minimum: Array

    @staticmethod
    def of(i_eff: Array) -> InertiaRange:
        """The range of I_eff of shape (N, n)."""
        return InertiaRange(
            maximum=np.max(i_eff, axis=0),
            median=np.median(i_eff, axis=0),
            minimum=np.min(i_eff, axis=0),
        )

    @property
    def variation_percent(self) -> Array:
        """(max - min) / max [%], as in Table 1. Round-off of a constant inertia is 0."""
        variation = 100 * (1 - self.minimum / self.maximum)
        return np.where(variation < 1e-9, 0.0, variation)
