"""The semicircular canals: the rate of the head that they signal.

The model is linear, from the literature, without vision, expectation or velocity storage, which
extends felt rotation from 5.7 s to 15-20 s; `sdt_drake.pilot.observer` has that.
"""

import math

import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.primitives import LinearSystem

from sdt_drake.io.arrays import Array

CUPULA = 5.7
"""Time constant tau of the cupula's return to rest [s] (Rader, Oman & Merfeld 2009, Table T4)."""

ADAPTATION = 80.0
"""Time constant tau_a of the adaptation of the nerve [s] (Rader, Oman & Merfeld 2009)."""


def canals(tau: ArrayLike, tau_a: ArrayLike) -> LinearSystem:
    """Make the canals of some axes: from the rate omega of the head to the signalled rate y_w.

        y_w / omega = tau s / (tau s + 1) tau_a s / (tau_a s + 1)

    States: what the cupula and then the nerve subtract from omega [rad/s]. Both are omega and 0
    after a long steady rotation.

    Args:
        tau: time constant of the cupula for each axis [s], shape (n,).
        tau_a: time constant of the nerve's adaptation [s], shape (n,).
    """
    cupula, nerve = np.diag(1 / np.atleast_1d(tau)), np.diag(1 / np.atleast_1d(tau_a))
    zero, one = np.zeros_like(cupula), np.eye(len(cupula))
    A = np.block([[-cupula, zero], [-nerve, -nerve]])
    return LinearSystem(A=A, B=np.vstack([cupula, nerve]), C=np.hstack([-one, -one]), D=one)


def sensed_rate(omega: Array, period: float) -> Array:
    """Return the angular rate that the canals signal [rad/s], in the shape of `omega`.

    It is exact for rates that are linear between samples. A head that turns at the first sample has
    long done so: its canals signal no rotation.

        >>> time = np.arange(0, 61, 0.01)
        >>> sensed = sensed_rate(np.minimum(time, 1), period=0.01)  # to 1 rad/s in 1 s
        >>> [f"{time[i]:.0f} s: {sensed[i]:.2f} rad/s" for i in (100, 600, 6000)]
        ['1 s: 0.91 rad/s', '6 s: 0.34 rad/s', '60 s: -0.04 rad/s']

    Args:
        omega: rate of the head in its axes [rad/s], shape (N, ...).
        period: sample period [s].
    """
    model = canals(CUPULA, ADAPTATION)
    poles, modes = np.linalg.eig(model.A())
    residues = (model.C() @ modes)[0] * np.linalg.solve(modes, model.B())[:, 0]
    # A mode r / (s - p) is a low pass with the time constant -1 / p and the gain -r / p.
    return omega - sum(
        r / p * low_pass(omega, -1 / p, period) for r, p in zip(residues, poles, strict=True)
    )


def low_pass(u: Array, time_constant: float, period: float) -> Array:
    """Return y of T y' + y = u, exact for u linear between samples, at rest before the start.

    y_{i+1} = phi y_i + (b - phi) u_i + (1 - b) u_{i+1}, phi = e^{-h/T}, b = (1 - phi) T / h.

    Args:
        u: input, shape (N, ...).
        time_constant: T [s].
        period: sample period h [s].
    """
    ratio = period / time_constant
    phi = math.exp(-ratio)
    b = -math.expm1(-ratio) / ratio
    w = np.concatenate([u[:1], (b - phi) * u[:-1] + (1 - b) * u[1:]])
    # y_i = sum over j of phi^j w_{i-j}. Sums of 2, 4, 8, ... terms follow from two of half as many.
    y, shift = w, 1
    while shift < len(y):
        y[shift:] += phi**shift * y[:-shift]
        shift *= 2
    return y
