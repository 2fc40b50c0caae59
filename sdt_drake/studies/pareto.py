"""What no other one beats: the Pareto front of two quantities of which less is better."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def pareto(cost: ArrayLike, error: ArrayLike) -> NDArray[np.bool_]:
    """Which points no other point beats: at most as much of both, and less of one.

    Of equal points all are kept, or none. A point with NaN is never kept and beats nothing.

    Args:
        cost, error: of each point, shape (N,).

    Returns:
        Shape (N,).
    """
    cost, error = np.asarray(cost, dtype=float), np.asarray(error, dtype=float)
    front = np.zeros(cost.shape, dtype=bool)
    best, last = np.inf, None  # least error so far, and the last point of the front
    for i in np.lexsort((error, cost)):  # by cost, then by error
        point = (cost[i], error[i])
        if np.isnan(point).any():
            continue
        front[i] = error[i] < best or point == last
        if front[i]:
            best, last = error[i], point
    return front
