"""Sizing files, and what a table of runs says about the motors."""

from __future__ import annotations

import dataclasses
import math
import re

import numpy as np
import pytest
import yaml
from synthetic import table_of

from sdt_drake.io.errors import InputError
from sdt_drake.io.resources import find_file
from sdt_drake.robot.motors import DeviceChoice
from sdt_drake.studies.sizing import Candidate, Requirements, Sizing, candidates, load_sizing
from sdt_drake.studies.summary import failures
from sdt_drake.studies.table import StudyTable
from sdt_drake.studies.verdicts import (
    Verdict,
    front_of,
    judge_candidates,
    lightest_motor,
    recommend,
    sizing_lines,
)

SHIPPED = "package://sdt/studies/sizing.yaml"
TEXT = find_file(SHIPPED).read_text(encoding="utf-8")


@pytest.fixture
def load(tmp_path):
    def load_text(text: str):
        path = tmp_path / "own.yaml"
        path.write_text(text, encoding="utf-8")
        return load_sizing(path)

    return load_text


# --- files -----------------------------------------------------------------------------------


def test_the_shipped_sizing_is_a_study_of_all_combinations():
    sizing, base = load_sizing(SHIPPED)
    study = sizing.study()
    seen = [study.inputs(i) for i in range(len(study))]
    assert len({tuple(inputs.values()) for inputs in seen}) == len(study) == 72 * 4 * 3
    order = [Candidate(tuple(x.values())[:4], x["structure_scale"]) for x in seen[::12]]
    assert order == candidates(sizing)
    scenario = study.scenario_of(base, seen[-1])
    motors = ["AC-270", "TM-5270", "TM-2150", "TM-1430"]
    assert scenario.device == DeviceChoice(motors, fitted=["AC-203", "TM-3950"] + ["TM-2150"] * 2)
    assert (scenario.motion, scenario.controller.label) == ("post_roll", "p_pi+id")
    assert base.device.motors == base.device.fitted  # not touched


def test_a_base_without_known_motors_has_the_strongest(load):
    """The lightest may be too weak for a motion, and then nothing would be tried."""
    fitted = "[AC-203, TM-3950, TM-2150, TM-2150]"
    base = load(TEXT.replace(fitted, "['', '', TM-716, '']"))[1]
    assert base.device.motors == ["AC-270", "TM-5270", "TM-716", "TM-1430"]


def test_elastic_joints_are_refused(load, tmp_path):
    name = "package://sdt/scenarios/coupled_pi.yaml"
    scenario = yaml.safe_load(find_file(name).read_text(encoding="utf-8"))
    scenario["plant"]["elasticity"] = {"natural_frequency": [60.0] * 4}
    (tmp_path / "elastic.yaml").write_text(yaml.safe_dump(scenario))
    with pytest.raises(InputError, match=r"plant\.elasticity: .* expected rigid"):
        load(TEXT.replace(name, "elastic.yaml"))


BAD = [
    ("coupled_pi.yaml", "axis_pi.yaml", "scenario: plant.kind axis, expected coupled, as the mass"),
    ("TM-3950, TM-5270]", "TM-3950, TM-5720]", "motors[2]: no motor 'TM-5720' in the catalogue"),
    ("[TM-716, TM-1430]", "[TM-716, TM-716]", "motors[4]: ['TM-716', 'TM-716'] has a value twice"),
    ("  fitted:", "  structure_scale: 2\n  fitted:", "device: motors and structure_scale come"),
    ("  fitted: [AC-203, TM-3950, TM-2150, TM-2150]", "  payload: payload", "device.fitted: mis"),
    ("inversion, post", "inversoin, post", "motions[3]: inversoin: no such motion, did you"),
    ("[0.05, 0.25, 0.05, 0.1]", "[0.1, 0.1]", "requirements.max_abs_speed_error: 2 values, exp"),
]  # fmt: skip


@pytest.mark.parametrize("old, new, message", BAD, ids=[message[:50] for *_, message in BAD])
def test_a_bad_field_is_refused_with_the_file(load, tmp_path, old, new, message):
    assert old in TEXT
    where = f"{tmp_path / 'own.yaml'}: {message}"
    with pytest.raises(InputError, match="^" + re.escape(where)):
        load(TEXT.replace(old, new))


def test_limits_by_outcome():
    limits = Requirements([0.1, 0.2], [90.0], winding_temperature=0.8).limits(2)
    assert [limits[f"max_abs_speed_error_{k}"] for k in (1, 2)] == [0.1, 0.2]
    assert limits["max_abs_position_error_2"] == pytest.approx(np.pi / 2)
    assert limits["winding_temperature_1"] == limits["winding_temperature_2"] == 0.8
    assert limits["stretch"] == 0
    assert not any("position" in name for name in Requirements([0.1]).limits(2))


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
TORQUE = {"TM-2860": 2860.0, "TM-3950": 3950.0}
GOOD = {
    f"{name}_{k}": good
    for name, good in {
        "torque_at_speed_share": 0.5, "used_torque_share": 0.5, "winding_temperature": 0.4,
        "saturated_fraction": 0.0, "max_abs_speed_error": 0.02, "max_abs_position_error": 0.002,
    }.items()
    for k in (1, 2)
} | {"stretch": 0.0}  # fmt: skip


def sized(outcome, keep) -> StudyTable:
    """The table of a sizing with made-up outcomes: a dict, or a reason why there are none."""
    study = SMALL.study()
    inputs = [x for x in map(study.inputs, range(len(study))) if keep(x)]
    results = [outcome(x) for x in inputs]
    ok = [isinstance(result, dict) for result in results]
    numbers = [r if o else dict.fromkeys(GOOD, math.nan) for r, o in zip(results, ok, strict=True)]
    return table_of(
        {name: np.array([x[name] for x in inputs]) for name in inputs[0]},
        {name: np.array([x[name] for x in numbers]) for name in GOOD},
        np.where(ok, "ok", "infeasible"),
        ["" if o else r for r, o in zip(results, ok, strict=True)],
    )


def story(inputs):
    """`pi` needs the large motor on joint 2; the small one on joint 1 is too weak unscaled."""
    reference = inputs["motion"] != "leans"
    if reference and inputs["motor_1"] == "AC-150" and inputs["structure_scale"] == 1:
        return "joint 1 has 150 N m"
    error = 0.02
    if reference and inputs["motor_2"] == "TM-2860":
        error = 0.3 if inputs["controller"] == "pi" else 0.15
    return {
        **GOOD,
        "max_abs_speed_error_2": error,
        "used_torque_share_1": 0.9 if reference else 0.1,
        "winding_temperature_2": 0.95 if reference else 0.1,
    }


def judged(outcome, keep=bool) -> list[Verdict]:
    return judge_candidates(SMALL, sized(outcome, keep))


def test_the_worst_motion_counts_and_the_lightest_that_keeps_all_is_recommended():
    verdicts = judged(story)
    first = verdicts[0]  # pi, AC-150, TM-2860, 0.8
    assert first.worst["max_abs_speed_error_2"] == (0.3, "reference")
    assert (first.error, first.mass) == (0.3, 70 + 110)  # kg, of the catalogue
    assert first.missed == (
        "largest speed error of joint 2 is 0.3 rad/s in reference, allowed is 0.2",
    )
    assert verdicts[1].missed == ("reference is infeasible: joint 1 has 150 N m",)
    assert recommend(verdicts, "pi").candidate == Candidate(("AC-150", "TM-3950"), 0.8)
    assert lightest_motor(SMALL, verdicts, "pi", 2) == "TM-3950"


def test_light_motors_count_more_than_a_light_structure():
    def verdict(mass, scale, error):
        candidate = Candidate(("AC-150", "TM-2860"), scale)
        return Verdict(candidate, "pi", mass, error, {}, {}, (), (), True)

    light, slender, exact = verdict(180, 1.0, 0.1), verdict(190, 0.8, 0.1), verdict(180, 1.0, 0.05)
    assert recommend([slender, light], "pi") is light
    assert recommend([light, exact], "pi") is exact


def beside(inputs):
    """Either light motor needs the heavy one of the other joint."""
    light = (inputs["motor_1"], inputs["motor_2"]) == ("AC-150", "TM-2860")
    return GOOD | {"winding_temperature_1": 1.2 if light else 0.9}


def failing(inputs):
    """The heavier motor of joint 2 cannot be run, and with pi_id none can."""
    bad = inputs["motor_2"] == "TM-3950" or inputs["controller"] == "pi_id"
    return "no link 'payload'" if bad else GOOD | {"max_abs_speed_error_2": 0.3}


@pytest.mark.parametrize(
    "outcome", [story, failing, beside, lambda inputs: "too weak"],
    ids=["story", "failing", "beside", "weak"],
)  # fmt: skip
def test_the_answer_comes_first_and_the_lines_agree_with_the_table(outcome, file_regression):
    table = sized(outcome, keep=bool)
    if outcome is failing:
        table = dataclasses.replace(table, status=np.where(table.ok, "ok", "failed"))
        assert failures(table) == "24 of 32 runs failed: no link 'payload' (row 1)"
    verdicts = judge_candidates(SMALL, table)
    lines = sizing_lines(SMALL, verdicts)
    assert front_of(verdicts).any() == lines[0].startswith("The lightest motors")
    file_regression.check("\n".join(lines) + "\n", encoding="utf-8")


def test_what_has_not_been_run_is_not_recommended():
    verdicts = judged(story, keep=lambda x: x["motion"] == "leans")
    assert recommend(verdicts, "pi") is None
    assert all("reference has not been run" in v.missed for v in verdicts)


@pytest.mark.parametrize(
    ("outcomes", "missed"),
    [
        # A number that is missing is not kept; a limit may be used to the full.
        ({"winding_temperature_1": math.nan}, ["winding temperature of joint 1 is nan % of rated"]),
        ({"used_torque_share_1": 1 + 1e-12, "torque_at_speed_share_1": 1 + 1e-12}, []),
        ({"saturated_fraction_1": 0.02}, ["saturation of joint 1 is 2 % of time"]),
        ({"max_abs_position_error_2": 0.1}, ["largest position error of joint 2 is 5.73 deg"]),
    ],
)
def test_what_is_missed_is_in_the_units_of_people(outcomes, missed):
    verdict = judged(lambda _: GOOD | outcomes)[0]
    assert [text.partition(" in ")[0] for text in verdict.missed] == missed


@pytest.mark.parametrize(
    "error",
    [
        lambda x: 0.02 if x["controller"] == "pi" else 0.01,
        lambda x: 0.02 - 1e-8 * TORQUE[x["motor_2"]],  # less than the accuracy of errors
    ],
)
def test_each_controller_has_a_front_of_its_own_of_errors_that_differ(error):
    """As in the figure, which has a panel for each; in candidates.csv the worse one's was gone."""
    verdicts = judged(lambda x: GOOD | {"max_abs_speed_error_2": error(x)})
    front = [v for v, on in zip(verdicts, front_of(verdicts), strict=True) if on]
    assert {v.controller for v in front} == {"pi", "pi_id"}
    assert {v.candidate.motors for v in front} == {("AC-150", "TM-2860")}
