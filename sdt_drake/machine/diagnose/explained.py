"""Parts of a signal that columns explain, and parts that they leave."""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import orth

from sdt_drake.io.arrays import Array, Index
from sdt_drake.machine.diagnose import constants as c


def basis(columns: Array) -> Array:
    """Return orthonormal columns that span columns, shape (N, rank)."""
    return orth(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300), rcond=c.RANK)


def without(known: Array, values: Array) -> Array:
    """Return columns (or one) less the part that orthonormal columns explain."""
    return np.asarray(values - known @ (known.T @ values))


def share_explained(left: Array, columns: Array) -> float:
    """Return the share of a squared residual that columns explain [-]."""
    part = basis(columns).T @ left
    return float(part @ part) / max(float(left @ left), 1e-300)


def over_largest(v: Array) -> Array:
    """Return speeds over the largest one of each column [-]."""
    return v / np.maximum(np.abs(v).max(axis=0), 1e-12)


def like_friction(v: Array, widths: Sequence[float]) -> Array:
    """Return columns that stand for any friction: offset, viscous, and signs of some widths.

    Args:
        v: Speeds over the largest one [-], shape (N,).
        widths: Widths of the sign change over the largest speed [-].
    """
    return np.column_stack([np.ones_like(v), v, *(np.tanh(v / width) for width in widths)])


def entries(values: Array | Index, digits: int = 5) -> str:
    """Return values as a list in a mapping file."""
    return f"[{', '.join(f'{x:.{digits}g}' for x in values)}]"
