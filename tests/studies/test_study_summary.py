"""Counts, percentiles, worst runs; shares of variance against closed forms."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from synthetic import make_table, small_table

from sdt_drake.studies.summary import (
    count_statuses,
    explained_share,
    percentiles,
    sensitivity,
    tornado,
    usable,
    worst_runs,
)


@pytest.fixture(scope="module")
def table():
    return make_table()


@pytest.fixture
def generator():
    return np.random.default_rng(3)


# --- counts ----------------------------------------------------------------------------------


def test_statuses_and_reasons(table):
    ok, infeasible = count_statuses(table)
    assert (ok.status, ok.runs, ok.reasons) == ("ok", 588, [])
    assert (infeasible.status, infeasible.runs) == ("infeasible", 12)
    # The numbers that are the same in all of them stay, and so does the joint.
    assert infeasible.reasons == [
        ("joint 2 needs … N m, expected at most 90 N m", 12, 7),
    ]


# --- distributions ---------------------------------------------------------------------------


def test_percentiles_are_of_the_runs_that_are_ok():
    y = np.array([*range(101), 1e9, np.nan])
    table = small_table(y, status=["ok"] * 101 + ["failed", "ok"])
    np.testing.assert_allclose(percentiles(table, "y"), [5, 25, 50, 75, 95, 99, 100])
    assert usable(table, "y").sum() == 101


def test_worst_runs(table):
    worst = worst_runs(table, "max_abs_speed_error", 4)
    values = table.outcome("max_abs_speed_error")
    assert list(worst.outcome("max_abs_speed_error")) == sorted(values[table.ok])[:-5:-1]
    assert set(worst.inputs["controller"]) == {"pi"}
    assert list(worst_runs(small_table([1, 2, 2, np.nan]), "y", 9).row) == [1, 2, 0]


# --- what matters ----------------------------------------------------------------------------


def test_the_ishigami_function(generator):
    """Ishigami and Homma, 1990, with a = 7, b = 0.1: first-order indices in closed form."""
    x = generator.uniform(-np.pi, np.pi, (20_000, 3))
    y = np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])
    v1, v2 = 0.5 * (1 + 0.1 * np.pi**4 / 5) ** 2, 7**2 / 8
    total = 7**2 / 8 + 0.1 * np.pi**4 / 5 + 0.1**2 * np.pi**8 / 18 + 0.5
    exact = (v1 / total, v2 / total, 0)
    assert exact == pytest.approx((0.314, 0.442, 0), abs=5e-4)
    for k in range(3):
        assert explained_share(x[:, k], y).value == pytest.approx(exact[k], abs=0.015)


@pytest.mark.parametrize("levels", [None, 12], ids=["numbers", "texts"])
def test_noise_explains_nothing_on_average(generator, levels):
    def draw():
        return generator.integers(levels, size=100).astype(str) if levels else generator.random(100)

    shares = [explained_share(draw(), generator.normal(size=100)) for _ in range(200)]
    shares, errors = np.array(shares).T
    # They say how far chance takes the share, a little more where groups are small.
    assert 0.8 * np.std(shares) < np.sqrt(np.mean(errors**2)) < 1.8 * np.std(shares)
    assert np.mean(shares) == pytest.approx(0, abs=4 * np.std(shares) / np.sqrt(200))
    assert np.min(shares) < 0


@pytest.mark.parametrize(("draws", "levels"), [(20, 20), (100, 4)])
def test_runs_of_one_draw_are_one_sample_of_what_is_drawn(generator, draws, levels):
    """y = x + g, with z drawn beside x, and each draw run at every level of g: z explains nothing,
    and neither takes the variance of g for its own."""
    g = np.tile(np.arange(levels) / levels, draws)
    exact = 1 / 12 / (1 / 12 + np.var(g))
    found = []
    for _ in range(100):
        x, z = generator.uniform(size=(2, draws)).repeat(levels, axis=1)
        table = dataclasses.replace(small_table(x + g, x=x, z=z, g=g), per_draw=levels)
        found.append([sensitivity(table, "y")[name] for name in "xzg"])
    values, errors = np.moveaxis(np.array(found), -1, 0)
    assert np.mean(values[:, 1]) == pytest.approx(0, abs=4 * np.std(values[:, 1]) / 10)
    assert np.mean(values[:, 0]) == pytest.approx(exact, abs=0.08)  # what few bins lose
    assert np.mean(values[:, 2]) == pytest.approx(1 - exact, abs=0.02)
    assert np.all(0.7 * values.std(axis=0)[:2] < errors.mean(axis=0)[:2])


@pytest.mark.parametrize(("rows", "columns"), [(2, 2), (20, 3)])
def test_in_a_full_grid_nothing_is_chance(rows, columns):
    """Less than chance would have given, 5 by 5 equal inputs explained 40 ± 14 % each."""
    x, z = (grid.ravel() for grid in np.indices((rows, columns)))
    y = 3.0 * x + np.sin(z)
    for one, own in ((x, 3.0 * x), (z.astype(str), np.sin(z))):
        share = explained_share(one, y, np.zeros(len(y), dtype=int))
        assert share == pytest.approx((np.var(own) / np.var(y), 0), rel=1e-12)
    # Some of its runs have failed.
    rest = np.arange(len(y)) % 7 > 0
    assert explained_share(x[rest], y[rest], np.zeros(rest.sum(), dtype=int)).error != 0


def test_where_nothing_can_be_said():
    x = np.arange(50.0)  # few runs, equal outcomes, a level for each run
    for few in ((x[:9], x[:9]), (x, 0 * x + 0.1), (x.astype(str), x)):
        assert np.isnan(explained_share(*few)).all()


def test_the_only_input_explains_all(generator):
    """However few runs: what bins lose is not taken for inputs that act together."""
    x = generator.uniform(size=24)
    assert sensitivity(small_table(np.exp(3 * x), x=x, y0=np.ones(24)), "y") == {"x": (1, 0)}
    assert np.isnan(sensitivity(small_table(np.ones(24), x=x), "y")["x"]).all()


def test_tornado_of_numbers():
    """y = x of 0..999: its fifths have the means 99.5 and 899.5."""
    x = np.arange(1000.0)
    x_swing, nothing = tornado(small_table(x, z=np.tile([0.0, 1.0], 500), x=x), "y")
    assert (x_swing.name, x_swing.low, x_swing.high) == ("x", 99.5, 899.5)
    assert x_swing.width == 800 and x_swing.low_level == ""
    assert nothing.name == "z" and nothing.width == pytest.approx(1)


def test_tornado_of_texts():
    (swing,) = tornado(small_table([1, 5, 3, 2, 6, 3], c=list("abcabc")), "y")
    assert (swing.low_level, swing.high_level) == ("a", "b")
    assert (swing.low, swing.high) == (1.5, 5.5)
