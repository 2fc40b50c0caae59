from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import Context
from pydrake.systems.primitives import LinearSystem

from sdt_drake.io.arrays import Array


class Section(NamedTuple):
    """A filter of one signal, dx/dt = omega (A x + B u), y = C x + D u, with gain 1 at rest."""

    omega: float
    """Frequency [rad/s], > 0."""
    A: Array
    B: Array
    C: Array
    D: float


PASS = Section(1.0, np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), 1.0)
"""No filter, y = u."""


def _second_order(omega: float, damping: float, C: ArrayLike, D: float) -> Section:
    A = np.array([[0.0, 1.0], [-1.0, -2 * damping]])
    return Section(omega, A, np.array([[0.0], [1.0]]), np.atleast_2d(C), D)


def low_pass(omega: float, *, order: int = 2, damping: float = 0.5**0.5) -> Section:
    """Return omega / (s + omega) of order 1, or omega² / (s² + 2 damping omega s + omega²).

    The gain at omega [rad/s] is -3 dB, of order 2 with the default damping.
    """
    if order == 1:
        return Section(omega, -np.eye(1), np.eye(1), np.eye(1), 0.0)
    return _second_order(omega, damping, [1.0, 0.0], 0.0)


def notch(omega: float, *, depth: float, width: float) -> Section:
    """Return (s² + depth width omega s + omega²) / (s² + width omega s + omega²).

    The gain at omega [rad/s] is `depth`. `width` is the distance of the frequencies of -3 dB at a
    depth of 0, over omega.
    """
    return _second_order(omega, width / 2, [0.0, -(1 - depth) * width], 1.0)


def filter_of(
    sections: Sequence[Section], *, unit: ArrayLike = 1.0, period: float | None = None
) -> LinearSystem:
    """Return filters of the entries of a vector as a system of Drake.

    Args:
        sections: a filter for each entry.
        unit: unit of the states, in which error control of the integrator is absolute, (n,).
        period: sample period [s] of filters by Tustin's rule, exact at omega. Continuous by
            default.
    """
    from scipy.linalg import block_diag
    from scipy.signal import cont2discrete

    omegas = np.array([section.omega for section in sections])
    if period is not None:
        omegas = 2 / period * np.tan(omegas * period / 2)
    scale = np.broadcast_to(unit, omegas.shape)
    A = block_diag(*(w * x.A for w, x in zip(omegas, sections, strict=True)))
    B = block_diag(*(w * x.B / u for w, x, u in zip(omegas, sections, scale, strict=True)))
    C = block_diag(*(u * x.C for x, u in zip(sections, scale, strict=True)))
    D = np.diag([section.D for section in sections])
    if period is not None:
        A, B, C, D, _ = cont2discrete((A, B, C, D), period, "bilinear")
    return LinearSystem(A, B, C, D, period or 0.0)


def set_filter(system: LinearSystem, context: Context, signal: ArrayLike) -> None:
    """Set filters to the steady state of a constant signal, shape (n,)."""
    change = -system.A() if system.time_period() == 0 else np.eye(len(system.A())) - system.A()
    x = np.linalg.solve(change, system.B() @ np.asarray(signal))
    if system.time_period() == 0:
        context.SetContinuousState(x)
    else:
        context.SetDiscreteState(x)
