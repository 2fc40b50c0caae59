"""The Pareto front against its definition."""

import numpy as np
import pytest

from sdt_drake.studies.pareto import pareto


@pytest.mark.parametrize(
    ("cost", "error", "expected"),
    [
        ([1, 2, 3, 4, 2, 5], [9, 5, 6, 1, 7, 1], [1, 1, 0, 1, 0, 0]),
        ([1, 1, 2, 2], [3, 3, 3, 3], [1, 1, 0, 0]),  # equal points are on it together
        ([1, 1, 1], [3, 2, 4], [0, 1, 0]),
        ([0, np.nan, 2, np.inf], [np.nan, 0, 5, 1], [0, 0, 1, 1]),
        ([], [], []),
        ([1], [1], [1]),
    ],
)
def test_by_hand(cost, error, expected):
    assert pareto(cost, error).tolist() == list(map(bool, expected))


def test_no_point_beats_one_of_the_front():
    rng = np.random.default_rng(0)
    cost, error = rng.integers(0, 12, size=(2, 200)).astype(float)  # many are equal
    error[rng.random(200) < 0.1] = np.nan
    as_good = (cost <= cost[:, None]) & (error <= error[:, None])
    better = (cost < cost[:, None]) | (error < error[:, None])
    beaten = (as_good & better).any(axis=1)
    np.testing.assert_array_equal(pareto(cost, error), ~beaten & ~np.isnan(error))
