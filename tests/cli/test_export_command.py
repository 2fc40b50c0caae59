"""The command that exports a motion, and what a loop makes of its files."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from drive_readers import read_csv
from test_drive_files import RATED, drives_with, short_motion

from sdt_drake.cli.app import main
from sdt_drake.machine.drive_files import export, feed
from sdt_drake.motion import LearnedReference, Motion
from sdt_drake.run.design import make_design
from sdt_drake.run.scenario import ControllerChoice, Scenario
from sdt_drake.run.simulate import simulate


@pytest.fixture(scope="module")
def motion():
    return short_motion()


def test_export_tells_what_a_loop_makes_of_its_files(tmp_path, capsys, monkeypatch, motion):
    monkeypatch.chdir(tmp_path)
    motion.to_csv("m.csv")
    drive = "drives"
    assert main(["export", "m.csv", "--drive", drive, "--out", "x", "--cam-points", "60"]) == 0
    assert "cycle of 1 ms" in capsys.readouterr().out
    with (tmp_path / "x" / "read_back.csv").open() as file:
        rows = list(csv.DictReader(file))
    error = {}
    for row in rows:
        found = float(row["position_error_rad"])
        error[row["source"]] = max(found, error.get(row["source"], 0.0))
    # Set points command the mean speed of a cycle: the lag of half a hold is gone.
    assert error["set_points.csv"] == error["set_points.st"] < 0.2 * error["motion"]
    assert error["trajectory.yaml"] == pytest.approx(error["motion"], rel=1e-3)
    assert error["cam.csv"] == pytest.approx(error["motion, no torque"], rel=0.2)


@pytest.mark.parametrize(("kind", "has_torque"), [("p_pi", True), ("p_pi", False), ("pi_id", True)])
def test_what_was_learned_is_exported_as_it_flew(tmp_path, robot, motion, kind, has_torque):
    """With the torques that were fed forward beside it, and no others; errors are those against
    the planned motion, as `simulate` tells them."""
    scenario = Scenario(controller=ControllerChoice(kind=kind, omega_r=66.0))
    design = make_design(scenario, robot=robot, motion=motion)
    beside = motion.v + 2e-3 * np.sin(2 * np.pi * motion.time / 0.6)[:, None] ** 2
    beside[-1] = 0
    torque = 30 * np.sin(np.pi * motion.time / 0.6)[:, None] * [0.1, 1, 1, 1]
    beside = Motion.from_speeds(motion.period, motion.q[0], beside)
    design = design.given(LearnedReference(beside, torque if has_torque else None))
    drives = drives_with(cycle=0.005)
    exported = export(design, drives, tmp_path, cam_points=50, title="x")
    fed = np.zeros_like(torque) if design.tau_ff is None else design.tau_ff
    np.testing.assert_array_equal(fed, torque * has_torque if kind == "p_pi" else fed)
    told = read_csv(tmp_path / "set_points.csv", drives).torque
    np.testing.assert_allclose(told, 1000 * fed / RATED, atol=0.51)
    flown = np.abs(simulate(design).position_error).max(axis=0)
    errors = {x.source: x.position_error for x in feed(design, drives, exported)}
    np.testing.assert_allclose(errors["motion"], flown, rtol=5e-3, atol=1e-9)
    np.testing.assert_allclose(errors["trajectory.yaml"], flown, rtol=5e-3, atol=1e-9)
