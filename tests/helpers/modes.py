"""Modes of linear models, compared."""

import numpy as np


def moving(modes, least=1e-4):
    """Modes apart from those at rest."""
    return modes[np.abs(modes) > least]


def same(actual, expected, tolerance=1e-9):
    """Equal to a share of the largest value."""
    scale = np.abs(expected).max()
    np.testing.assert_allclose(actual, expected, rtol=0, atol=tolerance * scale)
