"""Controllers side by side: the same numbers as each of them alone."""

import csv

import numpy as np
import pytest
from helpers.variants import kind as controller

from sdt_drake.analysis.comparison import (
    compare,
    comparison_rows,
    design_with,
    with_controller,
    write_comparison,
)
from sdt_drake.analysis.tracking import track
from sdt_drake.io.errors import InputError
from sdt_drake.motion import LearnedReference, Motion
from sdt_drake.robot.device import Friction
from sdt_drake.run.controllers import CONTROLLERS
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
        track(run).constant_speed_error,
        np.rad2deg(np.abs(run.q - run.q_ref).max(axis=0)),
        100 * np.sqrt(np.mean(run.tau_rms[1:] ** 2, axis=0)) / limit,
        100 * run.tau_peak.max(axis=0) / limit,
        100 * np.mean(run.saturated[1:], axis=0),
    ])  # fmt: skip


def test_comparison_tables_hold_metrics_and_csv_all_digits(compared, tmp_path):
    write_comparison(compared, tmp_path / "new" / "table.csv")
    with (tmp_path / "new" / "table.csv").open(encoding="utf-8", newline="") as file:
        lines = list(csv.DictReader(file))
    header, rows = comparison_rows(compared)
    assert header == ["controller", "joint", *COLUMNS]
    assert list(lines[0]) == [*header, "needs", *FELT]
    assert [row[0] for row in rows] == [x for label in LABELS for x in (label, "", "", "")]
    assert [row[1] for row in rows] == ["1 planetary", "2 roll", "3 pitch", "4 yaw"] * 5
    rounding = np.array([6e-5, 6e-6, 6e-5, 6e-4, 0.06, 0.06, 0.006])
    expected = np.concatenate([metrics(c).T for c in compared])
    shown = np.array([[x.replace("–", "nan") for x in row[2:]] for row in rows], dtype=float)
    assert np.all(np.nan_to_num(np.abs(shown - expected)) < rounding)
    np.testing.assert_array_equal(np.isnan(shown), np.isnan(expected))
    in_full = [[float(line[name] or "nan") for name in COLUMNS] for line in lines]
    np.testing.assert_allclose(in_full, expected, rtol=1e-14)
    for line, c in zip(lines, np.repeat(np.array(compared, dtype=object), 4), strict=True):
        told = [line[name] for name in ("controller", "needs")]
        assert told == [c.label, ", ".join(c.needs)]


def test_comparison_takes_learned_torque_and_refuses_other_feedforward(design):
    torque = np.full(design.reference.planned.q.shape, 50.0)
    learned = design.given(LearnedReference(design.reference.planned, torque))
    for run in compare(learned, ["pi", "inverse_dynamics"]):
        assert run.design.learned is learned.learned
        plain, alone = (design_with(x, run.label) for x in (design, learned))
        np.testing.assert_array_equal(run.recording.tau_cmd, simulate(alone).tau_cmd)
        assert np.abs(run.recording.tau_cmd - simulate(plain).tau_cmd).max() > 10
    with pytest.raises(InputError, match="design: has another torque feedforward"):
        compare(design.with_feedforward(torque), ["pi"])


# --- labels -------------------------------------------------------------------------------------


OWN = {"pi_ctc": "ctc", "pi_id": "id", "inverse_dynamics": "none"}


@pytest.mark.parametrize("label", [*CONTROLLERS, "p_pi+ctc", "pi_scheduled+id"])
def test_label_gives_kind_and_feedforward_and_keeps_options(label):
    kind, _, feedforward = label.partition("+")
    feedforward = feedforward or OWN.get(kind, "none")
    options = {"feedforward_gain": [0.9] * 4, "position_gain": [5.0] * 4, "anti_windup": True}
    fields = controller("p_pi+id", friction_compensation=True, **options)
    fields["plant.friction"] = Friction([1.0] * 4)
    if kind == "inverse_dynamics":
        fields |= {"plant.kind": "coupled", "plant.i_eff": None}
    before = load_scenario("axis_pi").changed(fields)
    choice = with_controller(before, label).controller
    assert choice.friction_compensation
    assert (choice.kind, choice.feedforward_in_use) == (kind, feedforward)
    position_gain = getattr(choice, "position_gain", None)
    assert position_gain == ((5.0,) * 4 if kind == "p_pi" else None)
    assert choice.feedforward_gain == ((0.9,) * 4 if feedforward != "none" else None)
    assert getattr(choice, "anti_windup", False) == (kind != "inverse_dynamics")
