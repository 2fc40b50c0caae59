"""The table of a study: worst joints, groups, designs, and the front of the best of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from synthetic import table_of

from sdt_drake.analysis.metrics import METRICS, family_of, metric_of
from sdt_drake.studies import results
from sdt_drake.studies.distributions import Uniform
from sdt_drake.studies.sizing import load_sizing
from sdt_drake.studies.study import Study, Variable
from sdt_drake.studies.table import pareto


def test_a_family_stands_for_the_worst_joint_that_has_a_number():
    columns = np.array([[1.0, np.nan, np.nan], [np.nan, 2.0, np.nan], [0.5, 3.0, np.nan]])
    names = [f"rms_speed_error_{k}" for k in (1, 2, 4)]
    table = table_of({}, dict(zip(names, columns, strict=True)))
    np.testing.assert_array_equal(table.outcome("rms_speed_error"), [1, 3, np.nan])
    np.testing.assert_array_equal(table.worst_joint("rms_speed_error")[:2], [1, 4])
    assert table.outcome(names[1]) is table.outcomes[names[1]]


def test_every_family_has_title_and_unit():
    for name, quantity in METRICS.items():
        assert family_of(f"{name}_2") == (name, 2) and family_of(name) == (name, None)
        assert metric_of(f"{name}_12") is quantity
    assert metric_of("max_abs_position_error_1").factor == pytest.approx(180 / np.pi)
    assert metric_of("peak_torque_share_1").factor == 100


def test_runs_of_one_draw_have_its_random_inputs():
    folder = Path(__file__).parents[2] / "diagrams" / "studies" / "monte_carlo"
    table = results.read_study_table(folder)
    assert list(table.groups["pi"].draw) == list(range(250))  # parts keep the numbers of rows
    friction = table.inputs["friction"].reshape(250, 4)
    assert np.all(friction == friction[:, :1]) and len(np.unique(friction)) == 250


def test_what_a_designer_chooses():
    """Devices at random are not designs; motions are what designs have to stand."""
    for field in ("plant.friction.coulomb", "drive.torque_error[2]", "controller.model.coulomb"):
        by_chance = Variable("", [field], distribution=Uniform(-0.1, 0.1))
        assert results._choices(Study("s", variables=[by_chance])) is None
    sizing, _ = load_sizing("package://sdt/studies/sizing.yaml")
    motors = [f"motor_{k}" for k in (1, 2, 3, 4)]
    assert results._choices(sizing.study()) == (*motors, "structure_scale", "controller")


def test_a_design_is_as_good_as_the_worst_of_its_runs_and_out_if_one_failed():
    table = table_of(
        {"kind": np.array(list("abcabc")), "motion": np.array(["far"] * 3 + ["near"] * 3)},
        {"cost": np.array([1.0, 2, 3, 1, 4, 3]), "error": np.array([5.0, 6, 7, 6, 5, 0])},
        ["ok"] * 5 + ["infeasible"],
        choices=("kind",),
    )
    first, worst = table.designs("cost", "error")
    assert first.tolist() == [0, 1] and np.array(worst).tolist() == [[1, 4], [6, 6]]


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
