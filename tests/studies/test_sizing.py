"""Sizing: files, what a table of runs says about the motors, and the command `size`."""

import csv
import dataclasses
import math
import re
import sqlite3

import numpy as np
import pytest
import yaml
from helpers.synthetic import table_of

from sdt_drake.cli.app import main
from sdt_drake.io.errors import InputError
from sdt_drake.io.resources import find_file
from sdt_drake.robot.motors import DeviceChoice
from sdt_drake.run.scenario import load_scenario
from sdt_drake.show.reports.sizing import sizing_report
from sdt_drake.studies.outcomes import outcome_names
from sdt_drake.studies.sizing import Candidate, Requirements, Sizing, candidates, load_sizing
from sdt_drake.studies.store import DATABASE
from sdt_drake.studies.summary import failures
from sdt_drake.studies.table import StudyTable
from sdt_drake.studies.verdicts import Verdict, front_of, judge_candidates, recommend

SHIPPED = "package://sdt/studies/sizing.yaml"
TEXT = find_file(SHIPPED).read_text(encoding="utf-8")

# --- files -----------------------------------------------------------------------------------


def test_shipped_sizing_covers_all_combinations():
    sizing, base = load_sizing(SHIPPED)
    study = sizing.study()
    seen = [study.inputs(i) for i in range(len(study))]
    assert len({tuple(inputs.values()) for inputs in seen}) == len(study) == 72 * 4 * 3
    order = [Candidate(tuple(x.values())[:4], x["structure_scale"]) for x in seen[::12]]
    assert order == candidates(sizing)
    scenario = base.changed(study.changes(base, seen[-1]))
    motors = ["AC-270", "TM-5270", "TM-2150", "TM-1430"]
    assert scenario.device == DeviceChoice(motors, fitted=["AC-203", "TM-3950"] + ["TM-2150"] * 2)
    assert (scenario.motion, scenario.controller.label) == ("post_roll", "p_pi+id")
    assert base.device.motors == base.device.fitted  # not touched


@pytest.fixture
def load(tmp_path):
    """Load the shipped sizing with another text in it."""

    def load_text(old: str, new: str):
        assert old in TEXT
        (tmp_path / "own.yaml").write_text(TEXT.replace(old, new), encoding="utf-8")
        return load_sizing(tmp_path / "own.yaml")

    return load_text


COUPLED = "package://sdt/scenarios/coupled_pi.yaml"
BAD = [
    ("coupled_pi.yaml", "axis_pi.yaml", "scenario: plant.kind axis, expected coupled, as the mass"),
    (COUPLED, "elastic.yaml", "scenario: plant.elasticity: elastic joints, expected rigid ones"),
    ("TM-3950, TM-5270]", "TM-3950, TM-5720]", "motors[2]: no motor 'TM-5720' in the catalogue"),
    ("[TM-716, TM-1430]", "[TM-716, TM-716]", "motors[4]: ['TM-716', 'TM-716'] has a value twice"),
    ("  fitted:", "  structure_scale: 2\n  fitted:", "device: motors and structure_scale come"),
    ("  fitted: [AC-203, TM-3950, TM-2150, TM-2150]", "  payload: payload", "device.fitted: mis"),
    ("[0.05, 0.25, 0.05, 0.1]", "[0.1, 0.1]", "requirements.max_abs_speed_error: 2 values, exp"),
]  # fmt: skip


@pytest.mark.parametrize("old, new, message", BAD, ids=[message[:50] for *_, message in BAD])
def test_bad_field_of_a_sizing_is_refused_with_the_file(load, tmp_path, old, new, message):
    scenario = yaml.safe_load(find_file(COUPLED).read_text(encoding="utf-8"))
    scenario["plant"]["elasticity"] = {"natural_frequency": [60.0] * 4}
    (tmp_path / "elastic.yaml").write_text(yaml.safe_dump(scenario))
    with pytest.raises(InputError, match="^" + re.escape(f"{tmp_path / 'own.yaml'}: {message}")):
        load(old, new)


def test_sizing_limits_by_outcome():
    limits = Requirements([0.1, 0.2], [90.0]).limits(2)
    assert [limits[f"max_abs_speed_error_{k}"] for k in (1, 2)] == [0.1, 0.2]
    assert limits["max_abs_position_error_2"] == pytest.approx(np.pi / 2)
    assert set(limits) <= set(outcome_names(load_sizing(SHIPPED)[1], 2))
    assert not any("position" in name for name in Requirements([0.1]).limits(2))
    assert "stop_share" not in limits


def test_sizing_with_stops_requires_that_no_limit_of_theirs_is_used_beyond_it(load):
    """The study simulates them, and their share is a requirement as any other."""
    old = "requirements:\n"
    stops = "  stops: {category: 1, deceleration: [0.5, 6, 1, 3], limits: {g: 3}}\n"
    sizing, base = load(old, old + stops)
    assert sizing.limits["stop_share"] == 1.0
    study = sizing.study()
    assert study.stops == sizing.requirements.stops
    assert set(sizing.limits) <= set(outcome_names(base, 4, study.stops))
    with pytest.raises(InputError, match=r"requirements\.stops\.limits: none, expected a limit"):
        load(old, old + stops.replace(", limits: {g: 3}", ""))


# --- the table -------------------------------------------------------------------------------

SMALL = Sizing(
    name="small",
    scenario="base.yaml",
    device=DeviceChoice(fitted=["AC-203", "TM-3950"]),
    motors=[["AC-150", "AC-203"], ["TM-2860", "TM-3950"]],
    structure_scales=[0.8, 1.0],
    motions=["leans", "package://sdt/motions/reference.yaml"],
    controllers=["pi", "pi_id"],
    requirements=Requirements([0.1, 0.2], [3.0]),
)
GOOD = {
    f"{name}_{k}": good
    for name, good in {
        "torque_at_speed_share": 0.5, "used_torque_share": 0.5, "winding_temperature": 0.4,
        "saturated_fraction": 0.0, "max_abs_speed_error": 0.02, "max_abs_position_error": 0.002,
    }.items()
    for k in (1, 2)
} | {"stretch": 0.0}  # fmt: skip


def sized(outcome, motions=SMALL.motions) -> StudyTable:
    """The table of a sizing with made-up outcomes: a dict, or a reason why there are none."""
    study = SMALL.study()
    inputs = [x for x in map(study.inputs, range(len(study))) if x["motion"] in motions]
    results = [outcome(x) for x in inputs]
    reasons = ["" if isinstance(result, dict) else result for result in results]
    numbers = [dict.fromkeys(GOOD, math.nan) if isinstance(x, str) else x for x in results]
    return table_of(
        {name: np.array([x[name] for x in inputs]) for name in inputs[0]},
        {name: np.array([x[name] for x in numbers]) for name in GOOD},
        ["infeasible" if reason else "ok" for reason in reasons],
        reasons,
    )


def judged(outcome, motions=SMALL.motions) -> list[Verdict]:
    return judge_candidates(SMALL, sized(outcome, motions))


def story(inputs):
    """`pi` needs the large motor on joint 2; the small one on joint 1 is too weak unscaled."""
    if inputs["motion"] == "leans":
        return GOOD
    if inputs["motor_1"] == "AC-150" and inputs["structure_scale"] == 1:
        return "joint 1 has 150 N m"
    error = 0.02
    if inputs["motor_2"] == "TM-2860":
        error = 0.3 if inputs["controller"] == "pi" else 0.15
    loads = {"used_torque_share_1": 0.9, "winding_temperature_2": 0.95}
    return GOOD | loads | {"max_abs_speed_error_2": error}


def beside(inputs):
    """Either light motor needs the heavy one of the other joint, one of them the full structure."""
    motors, scale = (inputs["motor_1"], inputs["motor_2"]), inputs["structure_scale"]
    hot = motors == ("AC-150", "TM-2860") or (motors == ("AC-203", "TM-2860") and scale < 1)
    return GOOD | {"winding_temperature_1": 1.2 if hot else 0.9}


def failing(inputs):
    """The heavier motor of joint 2 cannot be run, and with pi_id none can."""
    bad = inputs["motor_2"] == "TM-3950" or inputs["controller"] == "pi_id"
    return "no link 'payload'" if bad else GOOD | {"max_abs_speed_error_2": 0.3}


def weak(inputs):
    return "too weak"


@pytest.mark.parametrize("outcome", [story, beside, failing, weak])
def test_sizing_answer_agrees_with_its_table(outcome, file_regression):
    table = sized(outcome)
    if outcome is failing:
        table = dataclasses.replace(table, runs=table.runs.replace("infeasible", "failed"))
        assert failures(table) == "24 of 32 runs failed: no link 'payload' (row 1)"
    verdicts = judge_candidates(SMALL, table)
    lines = sizing_report(SMALL, verdicts, "").lines()
    assert front_of(verdicts).any() != lines[0].startswith("No motor set of 8")
    file_regression.check("\n".join(lines) + "\n", encoding="utf-8")


def test_sizing_takes_the_worst_motion():
    first, second, *_ = judged(story)  # with pi, AC-150, TM-2860 at 0.8 and 1
    assert first.worst["max_abs_speed_error_2"] == (0.3, "reference")
    assert (first.error, first.mass) == (0.3, 70 + 110)  # kg, of the catalogue
    missed = "largest speed error of joint 2 is 0.3 rad/s in reference, allowed is 0.2"
    assert first.missed == (missed,)
    assert second.missed == ("reference is infeasible: joint 1 has 150 N m",)
    verdicts = judged(story, motions=["leans"])
    assert recommend(verdicts, "pi") is None
    assert all(v.missed == ("reference has not been run",) for v in verdicts)


@pytest.mark.parametrize(
    ("outcomes", "missed"),
    [
        # A number that is missing is not kept; a limit may be used to the full.
        ({"winding_temperature_1": math.nan}, ["winding temperature of joint 1 is nan % of rated"]),
        ({"used_torque_share_1": 1 + 1e-12, "torque_at_speed_share_1": 1 + 1e-12}, []),
        ({"max_abs_position_error_2": 0.1}, ["largest position error of joint 2 is 5.73 deg"]),
    ],
)
def test_missed_limits_have_readable_units(outcomes, missed):
    verdict = judged(lambda _: GOOD | outcomes)[0]
    assert [text.partition(" in ")[0] for text in verdict.missed] == missed


def test_page_without_sufficient_motors_names_the_missed_limits(tmp_path, undrawn):
    bad = GOOD | {"used_torque_share_2": 1.5}
    sizing_report(SMALL, judged(lambda x: bad), "").write(tmp_path)
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert "**No motor set of 8 meets all requirements.** They miss most often: with PI," in text
    assert "Offer stronger motors" in text and "```" not in text


# --- the command -----------------------------------------------------------------------------

OWN = """\
scenario: coupled.yaml
device: {fitted: [AC-203, TM-3950, TM-2150, TM-2150]}
motors: [[AC-203], [TM-716, TM-3950], [TM-1430], [TM-716]]
motions: [short.yaml]
controllers: [pi, pi_id]
requirements: {max_abs_speed_error: [0.05, 0.01, 0.05, 0.05], used_torque_share: 0.2}
"""


def test_size_command_writes_a_recommendation(desk, capfd, undrawn):
    (desk / "own.yaml").write_text(OWN)
    assert main(["size", "own.yaml"]) == 0
    said = (desk / "own" / "sizing.txt").read_text()
    assert capfd.readouterr().out.count(said) == 1
    best = "AC-203, TM-3950, TM-1430, TM-716"
    assert f"{best}: 325 kg of motors are enough, with PI + ID." in said
    rows = [*csv.DictReader((desk / "own" / "candidates.csv").open())]
    pairs = [f"{row['controller']} {row['motor_2']}" for row in rows]
    assert pairs == ["pi TM-716", "pi TM-3950", "pi_id TM-716", "pi_id TM-3950"]
    assert float(rows[2]["used_torque_share_2"]) > 0.2 > float(rows[3]["used_torque_share_2"])
    assert float(rows[3]["max_abs_speed_error_2"]) < 0.01 < float(rows[1]["max_abs_speed_error_2"])

    text = (desk / "own" / "report.md").read_text(encoding="utf-8")
    assert f"**{best}: 325 kg of motors are enough, with PI + ID.**" in text
    # What it says to take into the scenario is a device.
    fields = yaml.safe_load(text.split("```")[1])
    made = load_scenario("coupled.yaml", {f"device.{k}": v for k, v in fields["device"].items()})
    assert [*made.device.motors] == best.split(", ") and fields["controller"] == {"kind": "pi_id"}

    with sqlite3.connect(desk / "own" / DATABASE) as database:
        database.execute("UPDATE rows SET status='failed', reason='no link' WHERE row=2")
    assert main(["size", "own.yaml", "--resume"]) == 1
    said = (desk / "own" / "sizing.txt").read_text()
    assert said.startswith("1 of 4 runs failed: no link (row 2)\n")
