"""What semicircular canals and otoliths tell of a motion of the head.

First-order models from the literature, linear and without the brain behind them: no velocity
storage (which makes felt rotation last 15-20 s instead of the cupula's 5.7 s), no vision, no
expectation. The otoliths tell the specific force as it is (unity).
"""

from __future__ import annotations

import math

import numpy as np

from sdt_drake.arrays import Array

CANAL = 5.7
"""tau: the cupula swings back [s] (Rader, Oman & Merfeld 2009, Table T4)."""

ADAPTATION = 80.0
"""tau_a: the nerve gets used to it [s] (same source)."""

UPRIGHT = 5.0
"""Of the subjective vertical [s]. Weak source: a student's script (GitHub
marcoscabanas/ahms-subjective-vertical), no primary one found."""

UNPERCEIVED_RATE = 2.5
"""Steady rotation slower than this is not perceived [deg/s] (Army Aviation AV0593)."""

_ON = 120.0  # how long a head is held still after a recording to see sensations fade [s]


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


def canals(omega: Array, period: float) -> Array:
    """Angular velocity that the canals tell [rad/s]; the shape of `omega`.

        omega_sensed / omega = tau tau_a s² / ((tau s + 1) (tau_a s + 1))

    in partial fractions, each a low pass that is exact for speeds that are straight between
    samples. A head that turns already at the first sample is taken to have done so for long: its
    canals tell nothing.

    Args:
        omega: of the head, in its axes [rad/s], shape (N, ...).
        period: [s].
    """
    apart = ADAPTATION - CANAL
    return (
        omega
        - ADAPTATION / apart * low_pass(omega, CANAL, period)
        + CANAL / apart * low_pass(omega, ADAPTATION, period)
    )


def felt_upright(specific_force: Array, period: float) -> Array:
    """Direction that the pilot takes for up, in the head's axes [-], shape (N, 3).

    Low pass of the specific force. It knows nothing of the canals: when the head turns fast, this
    follows UPRIGHT seconds late, where a pilot in fact would feel the turn.

    Args:
        specific_force: [m/s²], shape (N, 3).
        period: [s].
    """
    smooth = low_pass(specific_force, UPRIGHT, period)
    size = np.linalg.norm(smooth, axis=1, keepdims=True)
    return np.divide(smooth, size, out=np.zeros_like(smooth), where=size > 0)


def false_sensation_after_stop(omega: Array, period: float) -> Array:
    """How long the canals tell of a rotation about each axis after the head has stopped [s], (3,).

    Both by the rate that is not perceived when it stays: the head turns while it is faster, and
    the canals tell of a rotation until they first show less; the second, weaker sensation the other
    way, which comes with adaptation, is not counted. After the last sample the head is held still.
    NaN if it never turns, or still turns at the end.

    Args:
        omega: of the head, in its axes [rad/s], shape (N, 3).
        period: [s].
    """
    level = np.radians(UNPERCEIVED_RATE)
    turning = np.linalg.norm(omega, axis=1) >= level
    if turning[-1] or not turning.any():
        return np.full(3, np.nan)
    stopped = np.flatnonzero(turning)[-1] + 1
    still = np.zeros((round(_ON / period), 3))
    told = np.abs(canals(np.concatenate([omega, still]), period)[stopped:]) >= level
    return (~told).argmax(axis=0) * period
