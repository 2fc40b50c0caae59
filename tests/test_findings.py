"""What diagrams/README.md says was found is what is computed, or what committed rows say."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.documents import FINDINGS, rows_of_table

from sdt_drake.analysis.comparison import Compared
from sdt_drake.analysis.stability import stability_sweep
from sdt_drake.analysis.tracking import track
from sdt_drake.machine.cueing.candidate import Candidate, percept_of
from sdt_drake.machine.cueing.flight import read_flight
from sdt_drake.machine.cueing.problem import Weights
from sdt_drake.machine.cueing.procedure import _problem_of, _still
from sdt_drake.machine.learn.filter import design_filter
from sdt_drake.machine.learn.loops import loops_of
from sdt_drake.machine.learn.trials import learn
from sdt_drake.paper.claims import OF_THE_PAPER, VERDICTS, judge_claims
from sdt_drake.paper.reproduction import _run
from sdt_drake.pilot import load_perception
from sdt_drake.pilot.illusions import feel, felt_apart
from sdt_drake.robot import dynamics
from sdt_drake.robot.dynamics import decouple
from sdt_drake.run.simulate import simulate
from sdt_drake.studies.results import read_study_table
from sdt_drake.studies.runs import Runner
from sdt_drake.studies.sizing import load_sizing
from sdt_drake.studies.study import load_study
from sdt_drake.studies.verdicts import judge_candidates, recommend
from sdt_drake.systems import gains

pytestmark = pytest.mark.documents

DIAGRAMS = Path(__file__).parents[1] / "diagrams"
STUDIES = DIAGRAMS / "studies"
SIZING, _ = load_sizing("sizing")
SMALLER = "AC-150, TM-2860, TM-1430, TM-716 at structure scale 0.8"
FAMILIES = "max_abs_speed_error", "max_abs_position_error", "saturated_fraction"
COARSE = 1e-3  # ten times as coarse as usual: the digits that are told are the same


def runs_of(runs: dict[str, Compared], rows: list[list[str]]) -> list[Compared]:
    """The runs with the controllers of a table."""
    return [runs[re.match(r"`(.*?)`", row[0])[1]] for row in rows]


def test_table_of_controllers_equals_compare(on_exact_model, on_wrong_model):
    rows = rows_of_table("controller | position")
    for runs, first in ((on_exact_model, 1), (on_wrong_model, 3)):
        for row, found in zip(rows, runs_of(runs, rows), strict=True):
            position = np.rad2deg(found.tracking.max_abs_position_error)
            told = np.array(row[first].split(), dtype=float)
            np.testing.assert_allclose(told, position, atol=5.1e-4, err_msg=row[0])
            speed = found.tracking.rms_speed_error[1]
            assert float(row[first + 1]) == pytest.approx(speed, abs=5.1e-6)


def said(pattern: str) -> list[float]:
    """Numbers that a sentence tells."""
    (found,) = re.findall(pattern, " ".join(FINDINGS.split()))
    return [float(number) for number in found]


def test_printed_sign_of_algorithm_1_on_joint_2(reproduction):
    worst, pi, ctc, steady = said(
        r"joint 2 \((\S+) rad/s\) (\S+) times that of PI alone and (\S+) times that of PI \+ CTC "
        r"with the right one, at constant speed (\S+) times"
    )
    cases = ("pi_ctc", "printed"), ("pi_ctc",), ("pi",)
    printed, ours, plain = (reproduction.coupled(*case).tracking for case in cases)
    error = printed.max_abs_speed_error[1]
    assert error == pytest.approx(worst, abs=5e-4)
    assert error / plain.max_abs_speed_error[1] == pytest.approx(pi, abs=0.05)
    assert error / ours.max_abs_speed_error[1] == pytest.approx(ctc, abs=0.05)
    ratio = printed.constant_speed_error[1] / ours.constant_speed_error[1]
    assert ratio == pytest.approx(steady, abs=0.5)


def test_table_of_sign_of_0_equals_runs(reproduction, monkeypatch):
    def other(inertial, coupled, *rest):  # what has no sign gets that of tau_coupled
        inertial = np.where(inertial == 0, 1e-9 * np.sign(coupled), inertial)
        return decouple(inertial, coupled, *rest)

    design = reproduction.axis("pi").design
    own, coupled = design.torques.inertial, design.torques.coupled
    third = (np.sign(own) != np.sign(coupled)) & (np.abs(own) <= np.abs(coupled))
    told = said(r"In (\S+), (\S+), (\S+) and (\S+) % of the branch joints 1 to 4 have no accel")
    np.testing.assert_allclose(100 * (third & (own == 0)).sum(0) / third.sum(0), told, atol=0.051)

    monkeypatch.setattr(dynamics, "decouple", other)
    monkeypatch.setattr(gains, "decouple", other)
    runs = {
        case: _run(reproduction.design, case) if case.algorithm == "printed" else run
        for case, run in reproduction.runs.items()
    }
    rows = rows_of_table("| sign(0) = 0")
    verdicts = []
    for column, study in ((1, reproduction), (2, replace(reproduction, runs=runs))):
        claims = {claim.id: claim for claim in judge_claims(study)}
        verdicts.append({id_: claim.verdict for id_, claim in claims.items()})
        kinds = [claim.verdict for claim in claims.values() if claim.kind == OF_THE_PAPER]
        branch = third if column == 1 else third & (own != 0)
        expected = [
            100 * branch.mean(axis=0),
            [claims["algorithm1_split"].computed["printed"]],
            [claims["ctc_improves_tracking"].computed[name][1] for name in ("pi", "pi_ctc")],
            [claims["joint2_errors_from_load_jumps"].computed["jump"]],
            [claims["ctc_on_coupled_plant"].computed["pi_ctc_printed_sign"][1]],
            [kinds.count(verdict) for verdict in VERDICTS],
        ]
        for row, numbers in zip(rows, expected, strict=True):
            cells = row[column].split()
            digits = len(cells[0].partition(".")[2])
            assert cells == [f"{number:.{digits}f}" for number in numbers], row[0]
    differ = {id_ for id_, verdict in verdicts[0].items() if verdict != verdicts[1][id_]}
    assert differ == {"ctc_improves_tracking", "joint2_errors_from_load_jumps"}
    # As the reasons of these claims say, joint 2 is then as with the consistent sign.
    for controller in ("pi", "pi_ctc"):
        errors = (
            of.axis(controller, sign).tracking.max_abs_speed_error[1]
            for of, sign in ((study, "printed"), (reproduction, "consistent"))
        )
        assert next(errors) == pytest.approx(next(errors), rel=1e-3)


def test_device_at_rest_of_the_table_of_flights(robot):
    """Its posture is found again, and it errs less in rotation than the motion, more in force."""
    flight, model = read_flight("turn"), load_perception("slow_yaw")
    problem = _problem_of(robot, flight, (15.0, 15.0), None, 0.2, 0.95, model, Weights())
    time = np.arange(0, flight.duration, 0.02)
    felt = percept_of(model, time, *flight.at(time))
    motion = _still(problem, flight, felt).motion
    rest = Candidate("rest", robot, motion, flight, 15.0, model).errors(felt)
    (row,) = (row for row in rows_of_table("flight | G error") if row[0] == "turn")
    for cell, error in zip(row[1:4], rest, strict=True):
        assert cell.split(", ")[1] == f"{error:{'.3f' if error < 1 else '.1f'}}"
    force, rotation, _ = (float(cell.split(", ")[0]) for cell in row[1:4])
    assert rest[0] > force and rest[1] < rotation


def test_sampled_drives_on_elastic_joints_are_unstable_from_told_ratio(designed):
    design = designed("real_device", {"drive.period": 0.001}, end=30)
    drive = design.scenario.drive
    sweep = stability_sweep(design, 65.991, encoder="motor", drive=drive, damping_ratio=0.01)
    assert sweep.unstable_from[[1, 0]] == pytest.approx([0.27, 0.47], abs=0.0051)
    assert "0.27" in FINDINGS and "0.47" in FINDINGS


def test_table_of_felt_share_equals_compare(on_exact_model):
    rows = rows_of_table("controller | share of time")
    wanted = feel(on_exact_model["pi"].head.reference, 0.005, "clark2019")
    for row, found in zip(rows, runs_of(on_exact_model, rows), strict=True):
        head = found.head
        shares = 100 * head.felt.share, 100 * head.felt_from_angles.share
        assert [float(cell) for cell in row[1:3]] == pytest.approx(shares, abs=0.051)
        changes = np.degrees(felt_apart(wanted, feel(head.achieved, 0.005, "clark2019")))
        assert [float(cell) for cell in row[3:]] == pytest.approx(changes, abs=0.0051)


# --- studies, from the rows that are committed ---------------------------------------------------


def worst(table, family: str) -> np.ndarray:
    """The largest outcome of all joints, by run."""
    return np.max([table.outcomes[f"{family}_{k}"] for k in (1, 2, 3, 4)], axis=0)


def test_table_of_the_study_equals_its_rows():
    table = read_study_table(STUDIES / "monte_carlo")
    assert set(table.status) == {"ok"}
    assert f"{len(table)} runs of the reference motion" in FINDINGS
    assert f"Errors of {len(table) // 4} devices" in FINDINGS

    def percentiles(values, digits):  # what half and 95 % of the runs do not exceed
        rows = [math.ceil(share * len(values)) - 1 for share in (0.5, 0.95)]
        return ", ".join(f"{value:.{digits}f}" for value in np.sort(values)[rows])

    controllers = table.inputs["controller"]
    speed, angle, share = (worst(table, family) for family in FAMILIES)
    angle, saturated, felt = np.degrees(angle), share > 0, 100 * table.outcomes["felt_share"]
    for row in rows_of_table("controller | speed error: median"):
        of = controllers == row[0].strip("`")
        assert row[1:] == [
            percentiles(speed[of], 3),
            percentiles(angle[of], 2),
            f"{np.median(felt[of]):.0f}",
            f"{100 * saturated[of].mean():.0f} %",
            f"{angle[of & ~saturated].max():.2f}",
        ], row[0]
    lost = (speed > 1).reshape(-1, 4)  # a device a row, in the order of the controllers
    few, many, cascade, all_ = said(
        r"(\d+) to (\d+) devices, with the cascade (\d+), lose .*? and (\d+) of them"
    )
    *others, last = lost.sum(axis=0)
    assert (min(others), max(others), last) == (few, many, cascade)
    assert lost.all(axis=1).sum() == all_
    away = angle > 360
    assert (away.sum(), (away & (controllers == "p_pi+id")).sum()) == (25, 13)


def test_recommended_motors_equal_the_rows():
    verdicts = judge_candidates(SIZING, read_study_table(STUDIES / "sizing"))
    for labels, motors, scale, mass, _ in rows_of_table("controller | lightest motors"):
        for label in re.findall(r"`(.*?)`", labels):
            best = recommend(verdicts, label)
            assert str(best.candidate) == f"{motors} at structure scale {scale}"
            assert best.mass == float(mass)
    missed = {v.controller: v.missed for v in verdicts if str(v.candidate) == SMALLER}
    reasons = {"pi": "0.32 rad/s", "pi_id": "joint 2 is 1.281 %", "p_pi+id": "joint 2 is 1.286 %"}
    for label, reason in reasons.items():
        (only,) = missed[label]
        assert reason in only


def test_held_mean_speed_has_the_told_error(designed):
    told = re.search(
        r"error: ([\d.]+) deg from the motion, .*?held_speed=mean`: ([\d.]+) deg", FINDINGS, re.S
    )
    for held, error in zip(("start", "mean"), told.groups(), strict=True):
        fields = {"controller.kind": "p_pi", "controller.feedforward": "id", "held_speed": held}
        made = designed("coupled_pi", fields)
        found = track(simulate(made)).max_abs_position_error[1]
        assert np.degrees(found) == pytest.approx(float(error), abs=5e-4)


def test_table_of_learned_torques_equals_flights(designed):
    """A cascade without a model learns the torques of one, where no reference is late."""
    (row,) = (row for row in rows_of_table("wrong_model, `--of") if row[0].startswith("`p_pi`,"))
    fields = {"controller.kind": "p_pi", "held_speed": "mean", "accuracy": COARSE}
    made = designed("wrong_model", fields)
    filter_ = design_filter(made, loops_of(made, "torque"), "torque")
    flights = learn(made, filter_, 2, stops=False).trials
    found = np.degrees([flight.largest[1] for flight in flights])
    np.testing.assert_allclose(found, [float(cell) for cell in row[1:3]], atol=6e-4)


def test_remaining_error_after_learning_equals_spring_bending(designed):
    """Torque of the links over stiffness, which the motor's encoder does not see."""
    rows = {row[0].split(",")[1].strip(): row for row in rows_of_table("flown with")[5:]}
    told = re.search(r"at most ([\d.]+) deg at 42 Hz and ([\d.]+) deg at 21 Hz", FINDINGS)
    rigid = [float(rows_of_table("flown with")[0][i]) for i in (2, 5)]
    for bent, hertz in zip(told.groups(), ("42 Hz", "21 Hz"), strict=True):
        omega = 2 * np.pi * float(hertz.split()[0])
        elastic = {"plant.elasticity.natural_frequency": [0, omega, 0, 0]}
        made = designed("wrong_model", elastic)
        deflection = np.abs(made.torques.total[:, 1]).max() / made.springs.stiffness[1]
        assert np.degrees(deflection) == pytest.approx(float(bent), abs=6e-4)
        for learned, rest in zip((rows[hertz][2], rows[hertz][5]), rigid, strict=True):
            assert 0 <= float(learned) - float(bent) <= rest


def test_row_459_runs_away_without_anti_windup():
    """By its committed row; and with it, by a run."""
    table, runner = read_study_table(STUDIES / "monte_carlo"), Runner(*load_study("monte_carlo"))
    assert table.inputs["controller"][459] == "p_pi+id"
    assert worst(table, "max_abs_position_error")[459] > np.radians(360)
    scenario = runner.scenario(459, table.inputs.loc[459].to_dict())
    scenario = scenario.changed({"controller.anti_windup": True, "accuracy": COARSE})
    made, _ = runner.design(scenario)
    largest = track(simulate(made)).max_abs_position_error.max()
    assert np.degrees(largest) == pytest.approx(11.4, abs=0.3)
