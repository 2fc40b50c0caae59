"""The table of a study: checks, worst joints, parts; titles and units of its outcomes."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from synthetic import CONTROLLERS, make_table, table_of

from sdt_drake.analysis.metrics import METRICS, family_of, metric_of
from sdt_drake.studies import results
from sdt_drake.studies.distributions import Uniform
from sdt_drake.studies.sizing import load_sizing
from sdt_drake.studies.study import Study, Variable, load_study
from sdt_drake.studies.table import pareto


@pytest.fixture(scope="module")
def table():
    return make_table(50)


def test_the_family_stands_for_the_worst_joint(table):
    joint4, ok = table.outcomes["max_abs_speed_error_4"], table.ok
    np.testing.assert_array_equal(table.outcome("max_abs_speed_error"), joint4)
    assert set(table.worst_joint("max_abs_speed_error")[ok]) == {4}
    assert set(table.worst_joint("peak_torque_share")[ok]) == {1}
    assert table.outcome("max_abs_speed_error_2") is table.outcomes["max_abs_speed_error_2"]
    assert table.outcome("felt_share") is table.outcomes["felt_share"]


def test_a_joint_without_a_number_is_not_the_worst():
    columns = np.array([[1.0, np.nan, np.nan], [np.nan, 2.0, np.nan]])
    outcomes = dict(zip(("rms_speed_error_1", "rms_speed_error_2"), columns, strict=True))
    table = table_of({}, outcomes)
    np.testing.assert_array_equal(table.outcome("rms_speed_error"), [1, 2, np.nan])
    np.testing.assert_array_equal(table.worst_joint("rms_speed_error")[:2], [1, 2])


def test_groups_keep_every_run_once_and_the_order_of_the_levels(table):
    parts = table.groups
    assert list(parts) == list(CONTROLLERS)
    assert sorted(np.concatenate([part.row for part in parts.values()])) == list(table.row)
    for level, part in parts.items():
        assert set(part.inputs["controller"]) == {level}
        np.testing.assert_array_equal(part.inputs["payload"], table.inputs["payload"][::3])


def test_every_family_has_title_and_unit():
    for name, quantity in METRICS.items():
        assert family_of(f"{name}_2") == (name, 2) and family_of(name) == (name, None)
        assert metric_of(f"{name}_12") is quantity
        assert quantity.label == f"{quantity.title} [{quantity.unit}]"
    assert metric_of("max_abs_position_error_1").factor == pytest.approx(180 / math.pi)
    assert metric_of("peak_torque_share_1").factor == 100


def test_runs_of_one_draw_have_its_random_inputs():
    folder = Path(__file__).parents[2] / "diagrams" / "studies" / "monte_carlo"
    table = results.read_study_table(folder)
    assert list(table.groups["pi"].draw) == list(range(250))  # parts keep the numbers of rows
    friction = table.inputs["friction"].reshape(250, 4)
    assert np.all(friction == friction[:, :1]) and len(np.unique(friction)) == 250
    assert np.all(table.draw.reshape(250, 4) == np.arange(250)[:, None])


def test_what_a_designer_chooses():
    """Devices at random are not designs; motions are what designs have to stand."""
    monte_carlo, _ = load_study("package://sdt/studies/monte_carlo.yaml")
    assert results._choices(monte_carlo) is None
    for field in ("drive.torque_error[2]", "controller.model.payload_mass"):  # nor are errors
        by_chance = Variable("", [field], distribution=Uniform(-0.1, 0.1))
        assert results._choices(Study("s", variables=[by_chance])) is None
    sizing, _ = load_sizing("package://sdt/studies/sizing.yaml")
    motors = [f"motor_{k}" for k in (1, 2, 3, 4)]
    assert results._choices(sizing.study()) == (*motors, "structure_scale", "controller")


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
