"""The function of Ishigami and Homma, 1990, with a = 7 and b = 0.1, and its indices of Sobol.

Independent: variances of this function are known in closed form. The package estimates them from
samples.
"""

import numpy as np


def ishigami(x):
    """Values, shape (N,), at x of shape (N, 3), each uniform from -pi to pi."""
    return np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


_TOTAL = 7**2 / 8 + 0.1 * np.pi**4 / 5 + 0.1**2 * np.pi**8 / 18 + 0.5
FIRST_ORDER = [0.5 * (1 + 0.1 * np.pi**4 / 5) ** 2 / _TOTAL, 7**2 / 8 / _TOTAL, 0.0]
"""First-order indices in closed form."""
