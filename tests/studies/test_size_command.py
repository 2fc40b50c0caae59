"""`sdt-drake size` from a file to a recommendation, and what it refuses."""

from __future__ import annotations

import csv
import itertools
import sqlite3

import numpy as np
import pytest
import yaml

from sdt_drake.cli.app import main
from sdt_drake.run.scenario import load_scenario
from sdt_drake.studies.results import read_study_table
from sdt_drake.studies.sizing import Requirements
from sdt_drake.studies.store import DATABASE

SIZING = """\
scenario: coupled.yaml
device:
  fitted: [AC-203, TM-3950, TM-2150, TM-2150]
motors:
- [AC-203]
- [TM-716, TM-3950]
- [TM-1430]
- [TM-716]
motions: [short.yaml]
controllers: [pi, pi_id]
requirements:
  max_abs_speed_error: [0.05, 0.01, 0.05, 0.05]
  used_torque_share: 0.2
"""


@pytest.fixture
def size(desk, capfd):
    def run(text: str = SIZING, *arguments: str) -> tuple[int, str, str]:
        (desk / "own.yaml").write_text(text)
        code = main(["size", "own.yaml", *arguments])
        return code, *capfd.readouterr()

    return run


def test_from_a_file_to_a_recommendation(size, desk, undrawn):
    code, out, _ = size()
    folder = desk / "own"
    lines = (folder / "sizing.txt").read_text().splitlines()
    assert code == 0 and "\n".join(lines) in out
    best = "AC-203, TM-3950, TM-1430, TM-716"
    assert lines[0].startswith(
        f"The lightest motors that meet all requirements weigh 325 kg: {best}"
    )
    assert lines[-3] == "joint 2: with pi_id TM-3950 is enough"
    with (folder / "candidates.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    pairs = [(row["controller"], row["motor_2"]) for row in rows]
    assert pairs == list(itertools.product(["pi", "pi_id"], ["TM-716", "TM-3950"]))
    assert float(rows[2]["used_torque_share_2"]) > 0.2 > float(rows[3]["used_torque_share_2"])
    assert float(rows[3]["max_abs_speed_error_2"]) < 0.01 < float(rows[1]["max_abs_speed_error_2"])

    text = (folder / "report.md").read_text(encoding="utf-8")
    assert f"**{best}: 325 kg of motors are enough, with pi_id.**" in text
    # What it says to take into the scenario is a device.
    fields = yaml.safe_load(text.split("```")[1])
    made = load_scenario("coupled.yaml", {f"device.{k}": v for k, v in fields["device"].items()})
    assert made.device.motors == best.split(", ") and fields["controller"] == {"kind": "pi_id"}

    table = read_study_table(folder)
    names = Requirements([1.0], [1.0]).limits(4)
    assert all(np.isfinite(table.outcome(name)).all() for name in names)

    # A run that failed comes first, and is no success.
    with sqlite3.connect(folder / DATABASE) as database:
        failed = "no link 'payload'"
        database.execute("UPDATE rows SET status='failed', reason=? WHERE row=2", [failed])
    assert size(SIZING, "--resume")[0] == 1
    lines = (folder / "sizing.txt").read_text().splitlines()
    assert lines[0] == "1 of 4 runs failed: no link 'payload' (row 2)"


def test_where_no_set_is_enough_the_page_says_what_stands_in_the_way(size, desk, undrawn):
    weak = SIZING.replace("[TM-716, TM-3950]", "[TM-716]").replace("[pi, pi_id]", "[pi_id]")
    assert size(weak)[0] == 0
    text = (desk / "own" / "report.md").read_text(encoding="utf-8")
    assert text.split("\n\n")[1] == (
        "**No motor set of 1 meets all requirements.** They miss most often: with pi_id, torque "
        "used of joint 2."
    )
    assert "Offer stronger motors" in text and "```" not in text
