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
from sdt_drake.analysis.perception import CHANNELS
from sdt_drake.analysis.tracking import track
from sdt_drake.io.errors import InputError
from sdt_drake.io.fields import check
from sdt_drake.motion import Motion
from sdt_drake.robot.device import Friction
from sdt_drake.run.kinds import CONTROLLERS
from sdt_drake.run.loop import make_loop
from sdt_drake.run.scenario import load_scenario
from sdt_drake.run.simulate import simulate

PERIOD = 0.005
LABELS = ("pi", "pi_ctc", "p_pi+id", "pi_scheduled+ctc", "inverse_dynamics")
COLUMNS = (
    "largest error [rad/s]", "RMS [rad/s]", "constant speed [rad/s]", "position [deg]",
    "torque RMS [%]", "torque peak [%]", "saturated [%]",
)  # fmt: skip
FELT = ["felt [% of time]", "largest rotation", "rotation about", "largest force", "force along"]


@pytest.fixture(scope="module")
def design(designed):
    """Joints 1 and 2 up to speed within 0.2 s and 1.1 s on; joint 3 keeps on accelerating."""
    t = PERIOD * np.arange(261)
    # Rounded, so that a constant speed is one number.
    v = np.round(np.outer(np.clip(t / 0.2, 0, 1), [0.02, 0.2, 0, 0]), 9)
    v[:, 2] = 0.02 * t
    return designed("coupled_pi", motion=Motion.from_speeds(PERIOD, np.zeros(4), v))


@pytest.fixture(scope="module")
def compared(design):
    return compare(design, LABELS)


def metrics(c):
    """The table's values by hand, (columns, n)."""
    run, limit = c.recording, np.array([203.2, 3950, 2150, 2150])
    return np.array([
        np.abs(run.v - run.v_ref).max(axis=0),
        np.sqrt(np.mean((run.v - run.v_ref) ** 2, axis=0)),
        track(run, c.design.motion).constant_speed_error,
        np.rad2deg(np.abs(run.q - run.q_ref).max(axis=0)),
        100 * np.sqrt(np.mean(run.tau_rms[1:] ** 2, axis=0)) / limit,
        100 * run.tau_peak.max(axis=0) / limit,
        100 * np.mean(run.saturated[1:], axis=0),
    ])  # fmt: skip


def leaves_of(system):
    if not isinstance(system, Diagram):
        return [system]
    return [leaf for inner in system.GetSystems() for leaf in leaves_of(inner)]


def test_each_run_is_that_of_its_controller_alone(designed, design, compared):
    assert tuple(c.label for c in compared) == LABELS
    assert tuple(c.design.scenario.controller.label for c in compared) == LABELS
    for c in compared:
        before, after = copy.deepcopy(design.scenario), copy.deepcopy(c.design.scenario)
        before.controller = after.controller = None
        assert before == after and c.design.motion is design.motion
        names = [leaf.get_name() for leaf in leaves_of(make_loop(c.design))]
        assert c.blocks == sum(not name.startswith("log.") for name in names) < len(names)
    fields = {"controller.kind": "p_pi", "controller.feedforward": "id"}
    alone = simulate(designed("coupled_pi", fields, motion=design.motion))
    for name in ("q", "v", "tau_cmd", "tau", "load_torque"):
        np.testing.assert_array_equal(getattr(compared[2].recording, name), getattr(alone, name))


def test_tables_hold_the_metrics_and_the_csv_all_digits(compared, tmp_path):
    write_comparison(compared, tmp_path / "new" / "table.csv")
    with (tmp_path / "new" / "table.csv").open(encoding="utf-8", newline="") as file:
        lines = list(csv.DictReader(file))
    assert list(lines[0]) == ["controller", "joint", *COLUMNS, "blocks", "needs", *FELT]
    header, rows = comparison_rows(compared)
    assert header == ["controller", "joint", *COLUMNS]
    assert [row[0] for row in rows] == [x for label in LABELS for x in (label, "", "", "")]
    assert [row[1] for row in rows] == ["1 planetary", "2 roll", "3 pitch", "4 yaw"] * 5
    rounding = np.array([6e-5, 6e-6, 6e-5, 6e-4, 0.06, 0.06, 0.006])
    expected = np.concatenate([metrics(c).T for c in compared])
    shown = np.array([[x.replace("–", "nan") for x in row[2:]] for row in rows], dtype=float)
    np.testing.assert_array_equal(np.isnan(shown), np.isnan(expected))
    assert (
        np.all(np.nan_to_num(np.abs(shown - expected)) < rounding) and np.isnan(shown[2:4, 2]).all()
    )
    in_full = [[float(line[name] or "nan") for name in COLUMNS] for line in lines]
    np.testing.assert_allclose(in_full, expected, rtol=1e-14)
    for i, line in enumerate(lines):
        c = compared[i // 4]
        assert (line["controller"], line["joint"]) == (c.label, str(i % 4 + 1))
        assert (line["blocks"], line["needs"]) == (str(c.blocks), ", ".join(c.needs))


def test_what_is_felt_is_the_largest_of_the_head(compared, tmp_path):
    header, rows = felt_rows(compared)
    assert header == ["controller", *FELT]
    for c, (label, share, rotation, about, force, along) in zip(compared, rows, strict=True):
        felt = c.head.felt
        assert label == c.label and float(share) == pytest.approx(100 * felt.share, abs=0.051)
        for size, channel, first in ((rotation, about, 0), (force, along, 3)):
            largest = felt.largest[first : first + 3].max()
            assert float(size) == pytest.approx(largest, abs=0.0051)
            assert felt.largest[CHANNELS.index(channel)] == largest
    share = {c.label: c.head.felt.share for c in compared}
    assert share["pi"] > share["p_pi+id"] == share["inverse_dynamics"] == 0


# --- labels -------------------------------------------------------------------------------------


def scenario(**fields):
    made = load_scenario("package://sdt/scenarios/axis_pi.yaml")
    for name, value in fields.items():
        setattr(made.controller, name, value)
    return made


OWN = {"pi_ctc": "ctc", "pi_id": "id", "inverse_dynamics": "none"}


@pytest.mark.parametrize("label", [*CONTROLLERS, "p_pi+ctc", "p_pi+none", "pi_scheduled+id"])
def test_a_label_is_a_kind_and_a_feedforward_and_keeps_options_of_use(label):
    kind, _, feedforward = label.partition("+")
    feedforward = feedforward or OWN.get(kind, "none")
    options = {"feedforward_gain": [0.9] * 4, "position_gain": [5.0] * 4, "anti_windup": True}
    before = scenario(kind="p_pi", feedforward="id", friction_compensation=True, **options)
    before.plant.friction = Friction([1.0] * 4)
    if kind == "inverse_dynamics":
        before.plant.kind, before.plant.i_eff = "coupled", None
    untouched = copy.deepcopy(before)
    after = with_controller(before, label)
    check(after)
    choice = after.controller
    assert before == untouched and choice.friction_compensation
    assert (choice.kind, choice.feedforward_in_use) == (kind, feedforward)
    assert choice.position_gain == ([5.0] * 4 if kind == "p_pi" else None)
    assert choice.feedforward_gain == ([0.9] * 4 if feedforward != "none" else None)
    assert choice.anti_windup == (kind != "inverse_dynamics")


@pytest.mark.parametrize(
    ("labels", "message"),
    [
        ([], "none given"),
        ("pi", r"expected a list of labels: \['pi'\]"),
        ([1], "expected a list"),
        (["pi", "p_pi", "pi"], "'pi' is given twice"),
        (["p_pi", "p_pi+none"], "'p_pi.none' is given twice"),
        (["pi", "pid"], "'pid', expected one of " + ", ".join(CONTROLLERS)),
        (["+id"], "'', expected one of"),
        (["p_pi+"], "feedforward of p_pi: '', expected one of none, ctc, id"),
        (["p_pi+id+ctc"], "'id.ctc', expected one of none, ctc, id"),
        (["pi+id"], "'pi.id', but pi has its own feedforward"),
        (["pi", "inverse_dynamics"], "coupled"),
    ],
)
def test_bad_labels_are_refused(designed, design, labels, message):
    with pytest.raises(InputError, match=message):
        compare(designed("axis_pi", motion=design.motion), labels)
