"""Runs of a study in one process: what becomes of rows, good and bad."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from sdt_drake.analysis.comparison import run_of
from sdt_drake.analysis.tracking import motor_use, track
from sdt_drake.io.errors import InputError
from sdt_drake.io.resources import models_dir
from sdt_drake.machine.learn.flights import fly
from sdt_drake.robot.device import Drive
from sdt_drake.robot.motors import DeviceChoice
from sdt_drake.run.design import make_design
from sdt_drake.run.scenario import Scenario, load_scenario
from sdt_drake.run.simulate import simulate
from sdt_drake.studies.distributions import Choice, Grid, List, Uniform
from sdt_drake.studies.job import make_job
from sdt_drake.studies.outcomes import outcome_names
from sdt_drake.studies.runs import Runner
from sdt_drake.studies.study import Study, Variable
from sdt_drake.studies.table import Row


@pytest.fixture(scope="module")
def base(files) -> Scenario:
    return load_scenario(files / "axis.yaml")


def of(field: str, distribution, **options) -> Variable:
    return Variable(field, [field], distribution=distribution, **options)


def run(base: Scenario, *variables: Variable, **options) -> list[Row]:
    study = Study("s", variables=list(variables), **options)
    study.validate(base)
    runner = Runner(study, base)
    return [runner.run(number) for number in range(len(study))]


def without_duration(rows: list[Row]) -> list[str]:
    return [repr(dataclasses.replace(row, duration=0.0)) for row in rows]  # NaN is not equal NaN


def test_outcomes_are_those_of_a_run(base, robot):
    amplitudes = [0.1, 0.2]
    rows = run(base, of("disturbance.amplitude", List(amplitudes)))

    for row, amplitude in zip(rows, amplitudes, strict=True):
        scenario = dataclasses.replace(
            base,
            accuracy=1e-3,  # of studies
            disturbance=dataclasses.replace(base.disturbance, amplitude=amplitude),
        )
        design = make_design(scenario)
        recording = simulate(design)
        tracking, motors = track(recording, design.motion), motor_use(recording, robot)
        outcomes = dict(zip(outcome_names(base, robot.n), row.outcomes, strict=True))
        for k in range(robot.n):
            expected = tracking.rms_speed_error[k]
            assert outcomes[f"rms_speed_error_{k + 1}"] == pytest.approx(expected, abs=1e-6)
            peak, rms = (outcomes[f"{name}_torque_share_{k + 1}"] for name in ("peak", "rms"))
            assert peak == pytest.approx(motors.peak_share[k], rel=1e-4, abs=1e-9)
            assert rms == pytest.approx(motors.rms_share[k], rel=1e-4, abs=1e-9)
        assert row.status == "ok" and row.reason == "" and row.duration > 0
        assert outcomes["rms_speed_error_2"] > 1e-3
        assert outcomes["peak_torque_share_2"] > outcomes["rms_torque_share_2"] > 0


@pytest.mark.parametrize("plant", ["axis", "coupled"])
def test_what_is_felt_is_told_alike_of_a_run_a_flight_and_a_row(files, plant):
    base = load_scenario(files / f"{plant}.yaml", {"accuracy": 1e-3})  # that of studies
    design = make_design(base)
    felt = run_of("pi", design).head.felt.share
    [row] = run(base, of("controller", Choice(["pi"])))
    assert (
        0 < felt == fly(design, 1).felt == row.outcomes[outcome_names(base, 4).index("felt_share")]
    )


def test_every_row_has_its_own_device_and_plan(files):
    base = load_scenario(files / "coupled.yaml")
    heavy, light = run(base, of("device.structure_scale", List([1.0, 0.5])))
    peak = outcome_names(base, 4).index("peak_torque_share_2")
    assert light.outcomes[peak] < 0.9 * heavy.outcomes[peak]
    rows = run(base, of("torque_margin", List([1.0, 0.05])))
    assert [row.status for row in rows] == ["ok", "infeasible"]
    base.drive = Drive(n1=[200.0, 0.01, 0.01, 0.01], n0=[300.0, 9.0, 9.0, 9.0])
    rows = run(base, of("drive.n0[2]", List([9.0, 0.02])))
    assert [row.status for row in rows] == ["ok", "infeasible"]
    assert "the no-load speed (n0) by drive.n1 and drive.n0" in rows[1].reason


def test_infeasible_rows(base, files):
    motions = Choice(["fast.yaml", "short.yaml"])
    study = Study("s", variables=[of("motion", motions)])
    study.folder = files
    runner = Runner(study, base, {n: str(files / n) for n in motions.values})
    bad, good = runner.run(0), runner.run(1)

    assert (bad.status, good.status) == ("infeasible", "ok")
    assert bad.outcomes == () and "\n" not in bad.reason
    # Not where the file is, which another process has elsewhere.
    assert bad.reason.startswith("fast.yaml: ") and str(files) not in bad.reason


@pytest.mark.parametrize(
    ("variable", "reason"),
    [
        (of("disturbance.amplitude", List([-1.0, 0.1])), "disturbance.amplitude: -1.0, expected"),
        (
            of("torque_margin", List([1.5, 1.0])),
            "torque_margin: 1.5, expected a number > 0",
        ),
        (of("controller.zeta[2]", List([-1.0, 1.0])), "zeta"),
        (of("period", List([0.007, 0.005])), "0.5 s is not a whole multiple of the period 0.007 s"),
        (of("plant.kind", Choice(["exis", "axis"])), "plant.kind: 'exis', expected one of"),
    ],
)
def test_bad_values_fail_alone(base, variable, reason):
    bad, good = run(base, variable)

    assert (bad.status, good.status) == ("failed", "ok")
    assert reason in bad.reason and bad.outcomes == ()


def test_whatever_happens_in_a_row_becomes_a_row(base, monkeypatch):
    def explode(design, **options):
        if design.scenario.controller.kind == "pi":
            return simulate(design, **options)
        raise ZeroDivisionError(f"division\nby zero in {models_dir()}/sdt.sdf")

    monkeypatch.setattr("sdt_drake.studies.runs.simulate", explode)
    rows = run(base, of("controller", Choice(["p_pi", "pi"])))

    assert [row.status for row in rows] == ["failed", "ok"]
    assert rows[0].reason == "ZeroDivisionError: division by zero in package://sdt/sdt.sdf"


def test_a_run_that_passes_a_stop_fails(base, monkeypatch):
    monkeypatch.setattr("sdt_drake.studies.runs.stops_passed", lambda *_: ["roll, 2 deg", "yaw"])
    [row] = run(base, of("controller", Choice(["p_pi"])))
    assert (row.status, row.reason, row.outcomes) == ("failed", "roll, 2 deg; yaw", ())


@pytest.mark.parametrize(("joint", "worst"), [(0, math.inf), (3, math.nan)])
def test_speeds_that_are_not_finite_fail(base, monkeypatch, joint, worst):
    def outcomes_of(*_):
        outcomes = np.zeros(29)
        outcomes[joint] = worst
        return tuple(outcomes.tolist())

    monkeypatch.setattr("sdt_drake.studies.runs.outcomes_of", outcomes_of)
    [row] = run(base, of("controller", Choice(["p_pi"])))
    assert (row.status, row.reason, row.outcomes) == ("failed", "the speeds are not finite", ())


@pytest.fixture(scope="module")
def mixed(base) -> Study:
    """Two devices, two controllers, three motions."""
    study = Study(
        "mixed",
        draws=2,
        variables=[
            of("disturbance.amplitude", Uniform(0, 0.3)),
            of("controller", Choice(["pi", "p_pi+id"])),
            of("torque_margin", Grid(0.8, 1.0, 3)),
        ],
    )
    study.validate(base)
    return study


@pytest.fixture(scope="module")
def mixed_rows(base, mixed) -> list[Row]:
    runner = Runner(mixed, base)
    return [runner.run(number) for number in range(len(mixed))]


def test_rows_do_not_depend_on_their_order_and_company(base, mixed, mixed_rows, monkeypatch):
    assert [row.number for row in mixed_rows] == list(range(12))
    assert {row.status for row in mixed_rows} == {"ok"}
    assert len({row.outcomes[1] for row in mixed_rows}) > 2
    expected = without_duration(mixed_rows)
    monkeypatch.setattr(
        "sdt_drake.studies.runs._MAX_PLANS", 1
    )  # motions are planned again and again
    order = np.random.default_rng(0).permutation(12).tolist()
    runner = Runner(mixed, base)
    rows = [runner.run(number) for number in order]

    assert [row.number for row in rows] == order
    assert len(runner._plans) == 1
    assert without_duration(sorted(rows, key=lambda row: row.number)) == expected


def test_repeat_has_the_same_numbers_and_a_recording(base, mixed, mixed_rows):
    outcomes, recording, wrong = Runner(mixed, base).repeat(4)

    assert wrong == ""
    assert repr(outcomes) == repr(mixed_rows[4].outcomes)
    worst = np.abs(recording.speed_error).max(axis=0)
    np.testing.assert_allclose(worst, outcomes[:4], rtol=1e-12, atol=1e-15)


def test_every_row_has_the_outcomes_of_the_study(files):
    """The loads of the motors are those of rigid coupled plants; other rows have none of them."""
    base = load_scenario(files / "coupled.yaml")
    fitted = ["AC-203", "TM-3950", "TM-2150", "TM-2150"]
    base.device = DeviceChoice(fitted=fitted)
    rows = run(
        base,
        of("plant.kind", Choice(["coupled", "axis"])),
        of("controller", Choice(["pi", "p_pi"])),
    )
    names = outcome_names(base, 4)
    loads = slice(names.index("used_torque_share_1"), None)

    assert [len(row.outcomes) for row in rows] == [len(names)] * 4
    assert np.isfinite([row.outcomes[loads] for row in rows[:2]]).all()
    assert np.isnan([row.outcomes[loads] for row in rows[2:]]).all()


# --- jobs ------------------------------------------------------------------------------------


@pytest.fixture
def own_files(desk):
    """A base with a robot, its uncertainty and a motion of its own, varied over two motions."""
    sdf = (models_dir() / "sdt.sdf").read_text()
    (desk / "own").mkdir()
    (desk / "own" / "device.sdf").write_text(sdf)
    text = (desk / "axis.yaml").read_text()
    text = text.replace("kind: axis", "kind: axis, deviation: {spread: spread.csv, along: [1]}")
    (desk / "own" / "base.yaml").write_text("robot: device.sdf\n" + text)
    (desk / "own" / "short.yaml").write_text((desk / "short.yaml").read_text())
    names = ",".join(f"x_{k + 1}" for k in range(50))  # ten for each link
    (desk / "own" / "spread.csv").write_text(f"row,{names}\n1{',0.01' * 50}\n")
    base = load_scenario("own/base.yaml")
    study = Study("s", variables=[of("motion", Choice(["own/short.yaml", "coriolis"]))])
    study.folder = desk
    return study, base


def test_a_job_has_its_files_with_it(own_files, desk, tmp_path, monkeypatch):
    study, base = own_files
    job = make_job(study, base)
    spread = base.plant.deviation.spread
    assert set(job.files) == {base.robot, base.motion, "own/short.yaml", spread}

    for file in (desk / "own").iterdir():
        file.unlink()
    (tmp_path / "there").mkdir()
    monkeypatch.chdir(tmp_path / "there")
    row = job.runner(tmp_path / "there").run(0)
    assert (row.status, row.reason) == ("ok", "")


def test_fingerprint(own_files, desk):
    study, base = own_files
    first = make_job(study, base).fingerprint

    desk.rename(desk.parent / "moved")
    there = load_scenario(desk.parent / "moved" / "own" / "base.yaml")
    study.folder = desk.parent / "moved"
    study.timeout = 7.0
    assert make_job(study, there).fingerprint == first  # neither changes a number

    other = dataclasses.replace(there, disturbance=dataclasses.replace(there.disturbance))
    other.disturbance.amplitude = 0.1
    assert make_job(study, other).fingerprint != first
    study.seed = 1
    assert make_job(study, there).fingerprint != first
    study.seed = 0
    motion = desk.parent / "moved" / "own" / "short.yaml"
    motion.write_text(motion.read_text().replace("0.5]]", "0.4]]"))
    assert make_job(study, there).fingerprint != first


def test_a_job_that_cannot_be_run(own_files):
    study, base = own_files
    study.variables[0].distribution = Choice(["own/nowhere.yaml"])
    with pytest.raises(InputError, match=r"own/nowhere\.yaml: no such file"):
        make_job(study, base)
    with pytest.raises(InputError, match="no such file"):
        make_job(study, dataclasses.replace(base, motion="nowhere.yaml"))
