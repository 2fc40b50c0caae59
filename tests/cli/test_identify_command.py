"""`sdt-drake identify` from end to end."""

from __future__ import annotations

import csv

import pytest
from known_truth import HEAVIER, recorded_of

from sdt_drake.io.tables import write_table
from sdt_drake.machine.identify.base_parameters import Unknown
from sdt_drake.robot.deviation import deviated
from sdt_drake.robot.robot import load_robot
from sdt_drake.run.scenario import load_scenario
from sdt_drake.show.reports.identification import FILES
from sdt_drake.studies.study import load_study


@pytest.fixture(scope="module")
def recording(robot, tmp_path_factory):
    """A recording of heavier frames, as a file."""
    recorded = recorded_of(deviated(robot, HEAVIER))
    path = tmp_path_factory.mktemp("recordings") / "run.csv"
    write_table(path, recorded.time, recorded.signals)
    return path


def test_a_recording_becomes_a_robot_a_scenario_and_a_study(call, recording, robot, tmp_path):
    out = tmp_path / "identified"
    done = call("identify", "sdt", recording, "--out", out, "--cutoff", "4")
    assert done.code == 0 and "base parameters of links and motors" in done.out
    assert "first moments hx, hy, hz (mass times" in done.out
    assert "consistent, held out" in done.out and "report.html written" in done.out
    assert {path.name for path in out.iterdir()} == {*FILES} - {"motion.csv"}
    better = load_robot(out / "robot.sdf")
    assert better.sdf != robot.sdf
    scenario = load_scenario(out / "scenario.yaml")
    assert scenario.plant.friction.coulomb is not None and len(scenario.plant.friction.coulomb) == 4
    study, base = load_study(out / "uncertainty.yaml")
    assert base.plant.deviation.along and len(study) == 100
    rows = list(csv.DictReader((out / "parameters.csv").open()))
    kinds = [row["kind"] for row in rows]
    assert kinds.count("base") == len(Unknown.everything(robot).base.words)
    assert all(float(row["std"]) > 0 for row in rows if row["kind"] == "base")
    assert "coulomb" in (out / "friction.yaml").read_text()
    page = (out / "report.html").read_text()
    assert ">-0.0 " not in page and " -0.0" not in page
    assert "error of the fed-forward load (A)" in page and page.count("<img") == 2


def test_a_written_robot_is_judged_by_another_recording_without_a_fit(
    call, recording, robot, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    other = recorded_of(deviated(robot, HEAVIER), seed=7)
    write_table("other.csv", other.time, other.signals)
    assert call("identify", "sdt", recording, "--out", "found", "--cutoff", "4").code == 0
    files = ("found/robot.sdf", "found/friction.yaml", "other.csv")
    done = call("identify", "--judge", *files, "--cutoff", "4")
    assert done.code == 0 and done.out.startswith("sdt: ")
    assert {path.name for path in tmp_path.iterdir()} == {"found", "other.csv"}
    rows = {line.split("  ")[0]: line.split()[-4:] for line in done.out.splitlines()}
    assert max(map(float, rows["robot and friction"])) < 2
    assert min(map(float, rows["robot without friction"])) > 4
    done = call("identify", "--judge", "sdt", "other.csv")  # the file as it is
    rows = {line.split("  ")[0]: line.split()[-4:] for line in done.out.splitlines()}
    assert rows["robot and friction"] == rows["robot without friction"]


BAD = [
    (["--held-out", "1.5"], '"1.5" for --held-out. Expected a number > 0 and < 1'),
    (["--cutoff", "0.1"], "anything below 0.1 Hz"),
    (["--cutoff", "900"], "--cutoff: 900 Hz"),
    (["--held-out", "0.9999"], "too short to fit"),
    (["--held-out", "0.0001"], "too short to hold out"),
    (["--only", "payload", "--payload", "seat"], "no moving link 'seat'"),
    (["--columns", "names.yaml"], "no column 'mean_1' (tau_mean)"),
]


@pytest.mark.parametrize("options, message", BAD)
def test_bad_input_is_one_line(call, recording, tmp_path, monkeypatch, options, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "names.yaml").write_text("tau_mean: ['mean_{k}']\n")
    done = call("identify", "sdt", recording, "--out", "identified", *options)
    assert done.code == 2 and message in done.err and done.err.count("\n") == 1
    assert not (tmp_path / "identified").exists()
