"""Linear least squares over time: the step of a Gauss-Newton method for a course of states."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dgesv  # quicker than `numpy.linalg.solve`

from sdt_drake.io.arrays import Array


@dataclass(frozen=True, eq=False)
class Quadratic:
    """The cost of changes dx of the states at N knots and du of the inputs between them.

    sum over knots of (dx' H dx / 2 + g' dx) + sum of effort |u + du|² / 2
    dx_{k+1} = A dx_k + B du_k,   dx_0 = S dz with any dz
    """

    H: Array
    """Shape (N, m, m), positive semidefinite."""
    g: Array
    """Shape (N, m)."""
    AB: Array
    """A beside B, shape (N - 1, m, m + n)."""
    S: Array
    """Shape (m, r)."""
    u: Array
    """Inputs, shape (N - 1, n)."""
    effort: float
    """Weight of the inputs."""


def smallest(cost: Quadratic, damping: Array) -> tuple[Array, Array]:
    """Return the changes dx and du of smallest cost.

    Args:
        cost: The cost.
        damping: Weight of dx² / 2 for each state, shape (m,).
    """
    m, n = cost.H.shape[1], cost.u.shape[1]
    H, effort = cost.H + np.diag(damping), cost.effort * np.eye(n)
    V, w = H[-1], cost.g[-1]
    feedback = np.empty((len(cost.u), n, m + 1))
    for k in range(len(cost.u) - 1, -1, -1):
        M, u = cost.AB[k], cost.u[k]
        Q, q = M.T @ (V @ M), M.T @ w
        right = np.concatenate([Q[m:, :m], (q[m:] + cost.effort * u)[:, None]], axis=1)
        feedback[k] = -dgesv(Q[m:, m:] + effort, right)[2]
        V = H[k] + Q[:m, :m] + Q[:m, m:] @ feedback[k, :, :m]
        w = cost.g[k] + q[:m] + Q[:m, m:] @ feedback[k, :, m]
    S, least = cost.S, 1e-9 * np.trace(V) / m * np.eye(cost.S.shape[1])
    z = -np.linalg.solve(S.T @ V @ S + least, S.T @ w)
    x = S @ z
    dx, du = [x], []
    for M, K in zip(cost.AB, feedback, strict=True):
        du.append(K[:, :m] @ x + K[:, m])
        x = M @ np.concatenate([x, du[-1]])
        dx.append(x)
    return np.array(dx), np.array(du)
