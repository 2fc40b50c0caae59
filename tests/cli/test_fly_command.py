"""The command `fly`: its files, and what other commands do with the motion."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from sdt_drake.machine.fly import procedure
from sdt_drake.machine.fly.flight import read_flight
from sdt_drake.motion import load_plan
from sdt_drake.robot.robot import load_robot
from sdt_drake.show.reports.fly import FILES

QUICK = ["--approach", "4", "--departure", "4", "--knot", "0.4"]
KEYS = {
    "flight_starts_at", "g_error_rms", "felt_rotation_rms_deg_s", "felt_vertical_rms_deg",
    "alignment", "washout", "starts", "torque_share_max", "cpu_s", "perception_gains",
}  # fmt: skip


@pytest.fixture
def short(desk, monkeypatch):
    """Three seconds of the shipped flight, in load factors and degrees, with z down."""
    monkeypatch.setattr(procedure, "SEATS", (0.0,))
    flight = read_flight("turn")
    own = (flight.time >= 5) & (flight.time <= 8)
    down = [1, -1, -1]
    columns = np.column_stack([
        flight.time[own], flight.specific_force[own] * [1, -1, 1] / 9.81,
        np.degrees(flight.angular_rate[own] * down),
    ])  # fmt: skip
    np.savetxt("short.csv", columns, delimiter=",", header="time,NX,NY,NZ,P,Q,R", comments="")
    Path("own.yaml").write_text(
        "force: [NX, NY, NZ]\nomega: [P, Q, R]\nforce_unit: g\nomega_unit: deg/s\naxes: frd\n"
        "force_direction: [1, 1, -1]\n"
    )


def test_files_of_a_flight(short, good):
    said = good("fly", "sdt", "short.csv", "--columns", "own.yaml", "--out", "flown", *QUICK).out
    assert "suspicious" not in said
    assert {path.name for path in Path("flown").iterdir()} == set(FILES)
    numbers = json.loads(Path("flown/summary.json").read_text())
    assert set(numbers) >= KEYS
    assert f"{numbers['felt_rotation_rms_deg_s']:.1f}" in said
    report = Path("flown/report.md").read_text()
    for text in ("prediction of a model", "Patents may stand", "an arm turns", "## Starts"):
        assert text in report
    robot = load_robot()
    plan = load_plan("flown/motion.csv", robot, planner="retiming")
    assert not plan.limited.any()
    assert plan.longer == 0
    out = good("simulate", "coupled_pi", "--set", "motion=flown/motion.csv").out
    assert "on the coupled plant" in out


def test_columns_of_others_are_suspicious(short, good, refuse, desk):
    mapping = Path("own.yaml").read_text().replace("force_unit: g\n", "")
    Path("wrong.yaml").write_text(mapping)
    said = good(
        "fly", "sdt", "short.csv", "--columns", "wrong.yaml", "--out", "flown", "--alone", *QUICK
    ).out
    assert "suspicious: short: its force is 1.1" in said
    assert "in g? (force_unit: g)" in said
    refuse("fly", "sdt", "short.csv", "--out", "flown",
           saying=["no column 'f_x' (force), there are time, NX, NY, NZ, P, Q, R"])  # fmt: skip
