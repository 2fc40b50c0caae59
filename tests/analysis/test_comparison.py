"""Controllers side by side: the same numbers as each of them alone."""

from __future__ import annotations

import copy
import csv

import numpy as np
import pytest
from pydrake.systems.framework import Diagram

from sdt_drake.analysis.comparison import (
    compare,
    comparison_rows,
    felt_rows,
    with_controller,
    write_comparison,
)
from sdt_drake.analysis.perception import CHANNELS, felt_difference
from sdt_drake.analysis.tracking import motor_use, track
from sdt_drake.io.errors import InputError
from sdt_drake.io.fields import check
from sdt_drake.motion import Motion
from sdt_drake.robot.device import Friction
from sdt_drake.robot.head import head_motion_of_samples
from sdt_drake.run.kinds import CONTROLLERS
from sdt_drake.run.loop import make_loop
from sdt_drake.run.scenario import load_scenario
from sdt_drake.run.simulate import simulate

PERIOD = 0.005
LABELS = ("pi", "pi_ctc", "p_pi+id", "pi_scheduled+ctc", "inverse_dynamics")
COLUMNS = (
    "largest error [rad/s]",
    "RMS [rad/s]",
    "constant speed [rad/s]",
    "position [deg]",
    "torque RMS [%]",
    "torque peak [%]",
    "saturated [%]",
)
FELT = ["felt [% of time]", "largest rotation", "rotation about", "largest force", "force along"]


@pytest.fixture(scope="module")
def design(designed):
    """Joints 1 and 2 up to speed within 0.2 s and 1.1 s on; joint 3 keeps on accelerating."""
    t = PERIOD * np.arange(261)
    # Rounded, so that a constant speed is one number.
    v = np.round(np.outer(np.clip(t / 0.2, 0, 1), [0.02, 0.2, 0, 0]), 9)
    v[:, 2] = 0.02 * t
    motion = Motion.from_speeds(PERIOD, np.zeros(4), v)
    return designed("coupled_pi", motion=motion)


@pytest.fixture(scope="module")
def compared(design):
    return compare(design, LABELS)


def metrics(c):
    """The table's values by hand, (columns, n)."""
    run, limit = c.recording, np.array([203.2, 3950, 2150, 2150])
    tracking = track(run, c.design.motion)
    return np.array([
        np.abs(run.v - run.v_ref).max(axis=0),
        np.sqrt(np.mean((run.v - run.v_ref) ** 2, axis=0)),
        tracking.constant_speed_error,
        np.rad2deg(np.abs(run.q - run.q_ref).max(axis=0)),
        100 * np.sqrt(np.mean(run.tau_rms[1:] ** 2, axis=0)) / limit,
        100 * run.tau_peak.max(axis=0) / limit,
        100 * np.mean(run.saturated[1:], axis=0),
    ])  # fmt: skip


# --- runs ---------------------------------------------------------------------------------------


def test_one_run_for_each_label_in_order(compared):
    assert tuple(c.label for c in compared) == LABELS
    assert tuple(c.design.scenario.controller.label for c in compared) == LABELS


@pytest.mark.parametrize("i", range(len(LABELS)), ids=LABELS)
def test_same_numbers_as_the_run_alone(designed, design, compared, i):
    c = compared[i]
    alone = simulate(designed("coupled_pi", own(LABELS[i]), motion=design.motion))

    for name in ("q", "v", "tau_cmd", "tau", "load_torque"):
        np.testing.assert_array_equal(getattr(c.recording, name), getattr(alone, name), name)
    for of, expected in (
        (c.tracking, track(alone, design.motion)),
        (c.motors, motor_use(alone, design.robot)),
    ):
        for name, value in vars(expected).items():
            np.testing.assert_array_equal(getattr(of, name), value, name)


def own(label):
    name, _, feedforward = label.partition("+")
    return {"controller.kind": name, "controller.feedforward": feedforward or None}


def test_everything_but_the_controller_stays(design, compared):
    for c in compared:
        before, after = copy.deepcopy(design.scenario), copy.deepcopy(c.design.scenario)
        before.controller = after.controller = None
        assert before == after
        assert c.design.motion is design.motion and c.design.robot is design.robot
    assert design.scenario.controller.kind == "pi"


def leaves_of(system):
    if not isinstance(system, Diagram):
        return [system]
    return [leaf for inner in system.GetSystems() for leaf in leaves_of(inner)]


def test_blocks_are_the_systems_without_logs(compared):
    for c in compared:
        names = [leaf.get_name() for leaf in leaves_of(make_loop(c.design))]
        measuring = {name for name in names if name.startswith("log.")}
        assert {"log.signals", "log.meter", "log.state", "log.torques"} <= measuring
        assert c.blocks == len(names) - len(measuring)
    blocks = {c.label: c.blocks for c in compared}
    # The sum of feedback and feedforward, source and hold of the load torque.
    assert blocks["pi_ctc"] == blocks["pi"] + 3
    assert blocks["p_pi+id"] > blocks["pi"] < blocks["pi_scheduled+ctc"]


# --- the pilot ----------------------------------------------------------------------------------


def test_head_follows_as_its_recording_says(compared):
    for c in compared:
        run, robot = c.recording, c.design.robot
        reference, achieved = (
            head_motion_of_samples(robot, PERIOD, q, v)
            for q, v in ((run.q_ref, run.v_ref), (run.q, run.v))
        )
        expected = felt_difference(reference, achieved, PERIOD)
        np.testing.assert_array_equal(c.head.felt.multiples, expected.multiples)
        assert c.head is c.head  # computed once
    share = {c.label: c.head.felt.share for c in compared}
    assert share["pi"] > share["p_pi+id"] == share["inverse_dynamics"] == 0


def test_felt_rows_hold_the_metrics(compared):
    header, rows = felt_rows(compared)
    assert header == ["controller", *FELT]
    for c, (label, share, rotation, about, force, along) in zip(compared, rows, strict=True):
        felt = c.head.felt
        assert label == c.label
        assert float(share) == pytest.approx(100 * felt.share, abs=0.051)
        assert float(rotation) == pytest.approx(felt.largest[:3].max(), abs=0.0051)
        assert float(force) == pytest.approx(felt.largest[3:].max(), abs=0.0051)
        assert felt.largest[CHANNELS.index(about)] == felt.largest[:3].max()
        assert felt.largest[CHANNELS.index(along)] == felt.largest[3:].max()


# --- the table ----------------------------------------------------------------------------------


def test_rows_hold_the_metrics(compared):
    header, rows = comparison_rows(compared)

    assert header == ["controller", "joint", *COLUMNS]
    assert [row[0] for row in rows] == [x for label in LABELS for x in (label, "", "", "")]
    assert [row[1] for row in rows] == ["1 planetary", "2 roll", "3 pitch", "4 yaw"] * 5
    rounding = np.array([6e-5, 6e-6, 6e-5, 6e-4, 0.06, 0.06, 0.006])[:, None]
    for i, c in enumerate(compared):
        shown = np.array([row[2:] for row in rows[4 * i : 4 * i + 4]]).T
        expected = metrics(c)
        assert (shown == "–").tolist() == np.isnan(expected).tolist()
        shown = np.where(shown == "–", "nan", shown).astype(float)
        assert np.all(np.nan_to_num(np.abs(shown - expected)) < rounding)
    assert [row[4] for row in rows[2:4]] == ["–", "–"]


def test_csv_holds_the_same_in_full(compared, tmp_path):
    write_comparison(compared, tmp_path / "new" / "table.csv")
    with (tmp_path / "new" / "table.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))

    assert list(rows[0]) == ["controller", "joint", *COLUMNS, "blocks", "needs", *FELT]
    assert len(rows) == 20
    for i, c in enumerate(compared):
        expected = metrics(c)
        for k, row in enumerate(rows[4 * i : 4 * i + 4]):
            assert (row["controller"], row["joint"]) == (c.label, str(k + 1))
            assert row["blocks"] == str(c.blocks) and row["needs"] == ", ".join(c.needs)
            values = [float(row[name] or "nan") for name in COLUMNS]
            np.testing.assert_allclose(values, expected[:, k], rtol=1e-14)
            assert float(row[FELT[0]]) == 100 * c.head.felt.share
            assert (row[FELT[2]], float(row[FELT[1]])) == c.head.felt.worst_rotation
            assert (row[FELT[4]], float(row[FELT[3]])) == c.head.felt.worst_force


# --- labels -------------------------------------------------------------------------------------


def scenario(**fields):
    made = load_scenario("package://sdt/scenarios/axis_pi.yaml")
    for name, value in fields.items():
        setattr(made.controller, name, value)
    return made


@pytest.mark.parametrize(
    ("label", "parts"),
    [
        ("pi", ("pi", "none")),
        ("pi_ctc", ("pi_ctc", "ctc")),
        ("pi_id", ("pi_id", "id")),
        ("p_pi", ("p_pi", "none")),
        ("p_pi+ctc", ("p_pi", "ctc")),
        ("p_pi+none", ("p_pi", "none")),
        ("pi_scheduled+id", ("pi_scheduled", "id")),
    ],
)
def test_a_label_is_a_kind_and_a_feedforward(label, parts):
    choice = with_controller(scenario(), label).controller
    assert (choice.kind, choice.feedforward_in_use) == parts


def test_a_label_without_feedforward_does_not_keep_that_of_the_scenario():
    before = scenario(kind="p_pi", feedforward="id")
    assert with_controller(before, "p_pi").controller.feedforward_in_use == "none"
    assert before.controller.feedforward == "id"


@pytest.mark.parametrize("label", ["pi", "pi_id", "p_pi", "pi_scheduled+ctc", "inverse_dynamics"])
def test_options_without_use_are_left_out(label):
    before = scenario(
        kind="p_pi",
        feedforward="id",
        feedforward_gain=[0.9] * 4,
        position_gain=[5.0] * 4,
        anti_windup=True,
        friction_compensation=True,
    )
    before.plant.friction = Friction([1.0] * 4)
    if label == "inverse_dynamics":
        before.plant.kind, before.plant.i_eff = "coupled", None
    untouched = copy.deepcopy(before)
    after = with_controller(before, label)

    check(after)
    assert before == untouched
    choice = after.controller
    assert choice.position_gain == ([5.0] * 4 if label == "p_pi" else None)
    has_feedforward = label in ("pi_id", "pi_scheduled+ctc")
    assert choice.feedforward_gain == ([0.9] * 4 if has_feedforward else None)
    assert choice.anti_windup == (label != "inverse_dynamics")
    assert choice.friction_compensation and choice.kp == before.controller.kp


@pytest.mark.parametrize(
    ("labels", "message"),
    [
        ([], "none given"),
        (["pi", "p_pi", "pi"], "'pi' is given twice"),
        (["p_pi", "p_pi+none"], "'p_pi+none' is given twice"),
        (["pi", "pid"], "'pid', expected one of " + ", ".join(CONTROLLERS)),
        ([""], "'', expected one of " + ", ".join(CONTROLLERS)),
        (["+id"], "'', expected one of " + ", ".join(CONTROLLERS)),
        (["p_pi+"], "feedforward of p_pi: '', expected one of none, ctc, id"),
        (["p_pi+id+ctc"], "feedforward of p_pi: 'id+ctc', expected one of none, ctc, id"),
        (["pi+id"], "'pi+id', but pi has its own feedforward"),
    ],
)
def test_bad_labels_are_refused(design, labels, message):
    with pytest.raises(InputError) as caught:
        compare(design, labels)
    assert str(caught.value).startswith("controllers: ") and message in str(caught.value)


def test_what_the_plant_rules_out_is_refused(designed, design):
    axis = designed("axis_pi", motion=design.motion)
    with pytest.raises(InputError, match=r"inverse_dynamics.*coupled"):
        compare(axis, ["pi", "inverse_dynamics"])
