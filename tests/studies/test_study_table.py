"""The table of a study: designs and their front, statistics against closed forms, and reports."""

import re
from dataclasses import replace

import numpy as np
import pytest
from helpers.synthetic import small_table, table_of
from oracles.ishigami import FIRST_ORDER, ishigami

from sdt_drake.analysis.metrics import METRICS, family_of, metric_of
from sdt_drake.show.documents import Report
from sdt_drake.show.reports import study as report
from sdt_drake.show.reports import study_tables
from sdt_drake.studies.distributions import Uniform
from sdt_drake.studies.study import Variable
from sdt_drake.studies.summary import (
    explained_share,
    percentiles,
    sensitivity,
    tornado,
    worst_runs,
)
from sdt_drake.studies.table import pareto


def test_outcome_family_takes_the_worst_joint_with_a_number():
    columns = np.array([[1.0, np.nan, np.nan], [np.nan, 2.0, np.nan], [0.5, 3.0, np.nan]])
    names = [f"rms_speed_error_{k}" for k in (1, 2, 4)]
    table = table_of({}, dict(zip(names, columns, strict=True)))
    np.testing.assert_array_equal(table.outcome("rms_speed_error"), [1, 3, np.nan])
    np.testing.assert_array_equal(table.worst_joint("rms_speed_error")[:2], [1, 4])
    assert table.outcome(names[1]).equals(table.runs[names[1]])


def test_every_outcome_family_has_title_and_unit():
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
def test_pareto_front_equals_one_by_hand(cost, error, expected):
    assert pareto(cost, error).tolist() == list(map(bool, expected))


def test_design_counts_with_its_worst_run_and_not_if_one_fails():
    table = table_of(
        {"motor": ["a", "b"] * 4, "load": [1.0] * 4 + [2.0] * 4, "controller": list("ppqq") * 2},
        {
            "cost_1": [1.0, 2, 3, 4, 5, 1, 2, np.nan],
            "rms_speed_error_2": [8.0, 7, 6, 5, 4, 3, 2, 1],
        },
        ["ok"] * 6 + ["failed", "ok"],
        choices=("motor", "controller"),
    )
    designs = table.designs("cost_1", "rms_speed_error")  # a design's runs are rows k and k + 4
    assert designs.index.tolist() == [0, 1] and designs.index.name == "row"
    expected = {"motor": "ab", "controller": "pp", "cost_1": [5, 2], "rms_speed_error": [8, 7]}
    assert designs.to_dict("list") == {name: list(values) for name, values in expected.items()}


# --- counts and percentiles ------------------------------------------------------------------


def test_percentiles_and_worst_runs_ignore_failed_runs():
    y = np.array([*range(101), 1e9, np.nan])
    table = small_table(y, status=["ok"] * 101 + ["failed", "ok"])
    np.testing.assert_allclose(percentiles(table, "y"), [5, 25, 50, 75, 95, 99, 100])
    assert list(worst_runs(table, "y", 3).runs.index) == [100, 99, 98]
    assert list(worst_runs(small_table([1, 2, 2, np.nan]), "y", 9).runs.index) == [1, 2, 0]


# --- what matters ----------------------------------------------------------------------------


@pytest.fixture
def generator():
    return np.random.default_rng(3)


def test_explained_shares_of_ishigami_equal_closed_form(generator):
    x = generator.uniform(-np.pi, np.pi, (20_000, 3))
    found = [explained_share(x[:, k], ishigami(x)).value for k in range(3)]
    assert found == pytest.approx(FIRST_ORDER, abs=0.015)


def test_tornado_equals_one_by_hand():
    """Means of the fifths 0, 1, 2 and 8, 9, 10 of eleven numbers, and of the levels of a text."""
    x, text = np.arange(13.0), np.array(list("abababababacc"))
    y = 2 * x + 3 * (text == "b")
    table = small_table(y, ["ok"] * 11 + ["failed"] * 2, x=x, text=text, same=0 * x)
    found = tornado(table, "y")
    assert found.index.tolist() == ["x", "text"]
    assert found.loc["x"].tolist() == [(0 + 5 + 4) / 3, (16 + 21 + 20) / 3, "", "", 16]
    assert found.loc["text"].tolist() == [10, 13, "a", "b", 3]


def test_explained_shares_of_a_grid_equal_variances():
    """Of y = 3 a + b in every combination, Var(3 a) = 9/4 and Var(b) = 2/3 are the whole."""
    a, b = np.repeat([0.0, 1.0], 3), np.tile(["k", "l", "m"], 2)
    y = 3 * a + [0, 1, 2, 0, 1, 2]
    grid = replace(small_table(y, a=a, b=b), per_draw=6)
    found = sensitivity(grid, "y")
    np.testing.assert_allclose(found["value"], np.array([9 / 4, 2 / 3]) / (9 / 4 + 2 / 3))
    assert found.index.tolist() == ["a", "b"] and not found["error"].any()


@pytest.mark.parametrize("other", [0.0, 0.7])
def test_paired_runs_count_once_in_explained_shares(generator, other):
    """Another input adds its variance to the total, and explains nothing of the drawn one."""
    x = generator.uniform(0, 1, 200)
    y, twice = x + generator.normal(size=200), np.repeat(np.arange(200), 2)
    once = explained_share(x, y).value
    twofold = explained_share(x[twice], y[twice] + np.tile([-other, other], 200), twice).value
    assert twofold == pytest.approx(once * np.var(y) / (np.var(y) + other**2), rel=1e-9)


# --- report and figures ----------------------------------------------------------------------


def test_shares_within_their_standard_error_are_dashes_and_inputs_have_units():
    texts = [study_tables.percent_of(*x) for x in ((0.03, 0.04), (np.nan, np.nan), (0.13, 0.08))]
    assert texts == ["–", "–", "13 ± 8"]
    uniform = Uniform(0.5, 2.0)
    fields = {"value": "plant.deviation.payload_mass", "factor": "plant.friction.coulomb"}
    units = {apply: Variable("x", [name], apply, uniform).unit for apply, name in fields.items()}
    assert units == {"value": "kg", "factor": "factor"}
    assert Variable("", ["disturbance.amplitude"], "value", uniform).unit == ""
    table = replace(table_of({"x": [1.0], "y": [2.0]}, {"cost_1": [1.0]}), units={"x": "kg"})
    assert [*map(table.input_label, "xy")] == ["x [kg]", "y"]


def test_study_without_any_result_has_no_table_of_explained_variance():
    table = table_of({"x": [1.0, 2.0]}, {"cost_1": [np.nan, np.nan]})
    assert study_tables.sensitivity_tables(table, []) == []


def test_study_chapter_has_one_table_and_existing_figures(copied, undrawn):
    made = Report("many", [], [report.study_chapter(copied)])
    made.write_parts(copied.parent)
    text = made.markdown().removeprefix("# many\n\n")
    assert text.startswith("## Study many\n") and text.count("\n| --- |") == 1
    for name in re.findall(r"\]\((.*)\.png\)", text):  # as seen from the folder above
        assert (copied.parent / f"{name}.svg").is_file()
