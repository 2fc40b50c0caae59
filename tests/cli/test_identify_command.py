"""`sdt-drake identify` from end to end."""

import csv
import re

from known_truth import HEAVIER, recorded_of

from sdt_drake.io.tables import write_table
from sdt_drake.machine.identify.base_parameters import Unknown
from sdt_drake.robot.deviation import deviated
from sdt_drake.robot.robot import load_robot
from sdt_drake.run.scenario import load_scenario
from sdt_drake.studies.study import load_study


def test_a_recording_becomes_a_robot_a_scenario_and_a_study(call, robot, tmp_path):
    recorded = recorded_of(deviated(robot, HEAVIER))  # of heavier frames
    path, out = tmp_path / "run.csv", tmp_path / "identified"
    write_table(path, recorded.time, recorded.signals)
    done = call("identify", "sdt", path, "--out", out, "--cutoff", "4")
    assert done.code == 0 and "base parameters of links and motors" in done.out
    assert load_robot(out / "robot.sdf").sdf != robot.sdf
    assert len(load_scenario(out / "scenario.yaml").plant.friction.coulomb) == 4
    study, base = load_study(out / "uncertainty.yaml")
    assert base.plant.deviation.along and len(study) == 100
    rows = list(csv.DictReader((out / "parameters.csv").open()))
    stds = [float(row["std"]) for row in rows if row["kind"] == "base"]
    assert len(stds) == len(Unknown.everything(robot).base.words) and min(stds) > 0
    page = (out / "report.html").read_text()
    assert not re.search(r"[> ]-0\.0\b", page) and page.count("<img") == 2

    judged = call("identify", "--judge", out / "robot.sdf", out / "friction.yaml", path).out
    rows = {line.split("  ")[0]: line.split()[-4:] for line in judged.splitlines()}
    assert max(map(float, rows["robot and friction"])) < 2
    assert min(map(float, rows["robot without friction"])) > 4
