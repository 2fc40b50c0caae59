"""First-order filters over samples, exact for signals that are straight between samples."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def low_pass(u: Array, time_constant: float, period: float) -> Array:
    """y of T y' + y = u, u straight between samples (first-order hold), at rest before the start.

    y_{i+1} = phi y_i + (b - phi) u_i + (1 - b) u_{i+1}, phi = e^{-h/T}, b = (1 - phi) T / h.

    Args:
        u: shape (N, ...).
        time_constant: T [s].
        period: h [s].
    """
    ratio = period / time_constant
    phi = math.exp(-ratio)
    b = -math.expm1(-ratio) / ratio
    w = np.concatenate([u[:1], (b - phi) * u[:-1] + (1 - b) * u[1:]])
    # y_i = sum over j of phi^j w_{i-j}: sums of 2, 4, 8, ... terms, each from two of half as many.
    y, shift = w, 1
    while shift < len(y):
        y[shift:] += phi**shift * y[:-shift]
        shift *= 2
    return y


def high_pass(u: Array, time_constant: float, period: float) -> Array:
    """T y' + y = T u': `u` less its low pass."""
    return u - low_pass(u, time_constant, period)
