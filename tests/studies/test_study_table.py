"""The table of a study: designs and their front, statistics against closed forms, and reports."""

import re

import numpy as np
import pytest
from synthetic import small_table, table_of

from sdt_drake.analysis.metrics import METRICS, family_of, metric_of
from sdt_drake.show.documents import render
from sdt_drake.show.reports import study as report
from sdt_drake.studies.summary import (
    explained_share,
    percentiles,
    worst_runs,
)
from sdt_drake.studies.table import pareto


def test_a_family_stands_for_the_worst_joint_that_has_a_number():
    columns = np.array([[1.0, np.nan, np.nan], [np.nan, 2.0, np.nan], [0.5, 3.0, np.nan]])
    names = [f"rms_speed_error_{k}" for k in (1, 2, 4)]
    table = table_of({}, dict(zip(names, columns, strict=True)))
    np.testing.assert_array_equal(table.outcome("rms_speed_error"), [1, 3, np.nan])
    np.testing.assert_array_equal(table.worst_joint("rms_speed_error")[:2], [1, 4])
    assert table.outcome(names[1]).equals(table.runs[names[1]])


def test_every_family_has_title_and_unit():
    for name, quantity in METRICS.items():
        assert family_of(f"{name}_2") == (name, 2) and family_of(name) == (name, None)
        assert metric_of(f"{name}_12") is quantity
    assert metric_of("max_abs_position_error_1").factor == pytest.approx(180 / np.pi)
    assert metric_of("peak_torque_share_1").factor == 100


@pytest.mark.parametrize(
    ("cost", "error", "expected"),
    [
        ([1, 2, 3, 4, 2, 5], [9, 5, 6, 1, 7, 1], [1, 1, 0, 1, 0, 0]),
        ([1, 1, 2, 2], [3, 3, 3, 3], [1, 1, 0, 0]),  # equal points are on it together
        ([0, np.nan, 2, np.inf], [np.nan, 0, 5, 1], [0, 0, 1, 1]),
    ],
)
def test_a_front_by_hand(cost, error, expected):
    assert pareto(cost, error).tolist() == list(map(bool, expected))


# --- counts and percentiles ------------------------------------------------------------------


def test_percentiles_and_worst_runs_are_of_the_runs_that_are_ok():
    y = np.array([*range(101), 1e9, np.nan])
    table = small_table(y, status=["ok"] * 101 + ["failed", "ok"])
    np.testing.assert_allclose(percentiles(table, "y"), [5, 25, 50, 75, 95, 99, 100])
    assert list(worst_runs(table, "y", 3).runs.index) == [100, 99, 98]
    assert list(worst_runs(small_table([1, 2, 2, np.nan]), "y", 9).runs.index) == [1, 2, 0]


# --- what matters ----------------------------------------------------------------------------


@pytest.fixture
def generator():
    return np.random.default_rng(3)


def test_the_ishigami_function(generator):
    """Ishigami and Homma, 1990, with a = 7, b = 0.1: first-order indices in closed form."""
    x = generator.uniform(-np.pi, np.pi, (20_000, 3))
    y = np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])
    v1, v2 = 0.5 * (1 + 0.1 * np.pi**4 / 5) ** 2, 7**2 / 8
    total = 7**2 / 8 + 0.1 * np.pi**4 / 5 + 0.1**2 * np.pi**8 / 18 + 0.5
    found = [explained_share(x[:, k], y).value for k in range(3)]
    assert found == pytest.approx([v1 / total, v2 / total, 0], abs=0.015)


# --- report and figures ----------------------------------------------------------------------


def test_a_chapter_has_what_matters_most(copied, undrawn):
    chapter = report.study_chapter(copied)
    text = render("study_chapter.md.j2", study=chapter)
    assert text.startswith("## Study many\n") and text.count("\n| --- |") == 1
    for name in re.findall(r"\]\((.*)\.png\)", text):  # as seen from the folder above
        assert (copied.parent / f"{name}.svg").is_file()
