"""The Pareto front against its definition."""

import numpy as np
import pytest

from sdt_drake.studies.pareto import pareto


def by_definition(cost, error):
    def beaten(i):
        return any(
            cost[j] <= cost[i]
            and error[j] <= error[i]
            and (cost[j] < cost[i] or error[j] < error[i])
            for j in range(len(cost))
        )

    known = ~np.isnan(cost) & ~np.isnan(error)
    return np.array([known[i] and not beaten(i) for i in range(len(cost))], dtype=bool)


def test_a_front_by_hand():
    cost, error = [1, 2, 3, 4, 2, 5], [9, 5, 6, 1, 7, 1]
    assert pareto(cost, error).tolist() == [True, True, False, True, False, False]


def test_equal_points_are_on_it_together():
    assert pareto([1, 1, 2, 2], [3, 3, 3, 3]).tolist() == [True, True, False, False]


def test_of_equal_cost_the_least_error_counts():
    assert pareto([1, 1, 1], [3, 2, 4]).tolist() == [False, True, False]


def test_what_is_not_known_is_not_on_it_and_beats_nothing():
    assert pareto([0, np.nan, 2, np.inf], [np.nan, 0, 5, 1]).tolist() == [False, False, True, True]


@pytest.mark.parametrize("n", [0, 1])
def test_few_points(n):
    assert pareto(np.ones(n), np.ones(n)).tolist() == [True] * n


@pytest.mark.parametrize("seed", range(20))
def test_any_points(seed):
    rng = np.random.default_rng(seed)
    cost, error = rng.integers(0, 12, size=(2, 80)).astype(float)  # many are equal
    error[rng.random(80) < 0.1] = np.nan
    np.testing.assert_array_equal(pareto(cost, error), by_definition(cost, error))
