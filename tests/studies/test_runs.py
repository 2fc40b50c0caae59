"""Runs of a study in one process: what becomes of rows, good and bad."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from sdt_drake.analysis.tracking import motor_use, track
from sdt_drake.io.errors import InputError
from sdt_drake.io.resources import models_dir
from sdt_drake.robot.device import Drive
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


@pytest.mark.parametrize(
    ("variable", "status", "reason"),
    [
        (of("disturbance.amplitude", List([-1.0, 0.1])), "failed", "amplitude: -1.0, expected"),
        (of("controller.zeta[2]", List([-1.0, 1.0])), "failed", "zeta"),
        (of("period", List([0.007, 0.005])), "failed", "0.5 s is not a whole multiple of the per"),
        (of("motion", Choice(["fast.yaml", "short.yaml"])), "infeasible", "fast.yaml: motion ref"),
    ],
)
def test_bad_values_fail_alone(base, files, variable, status, reason):
    names = {name: str(files / name) for name in ("fast.yaml", "short.yaml")}
    study = Study("s", variables=[variable])
    study.folder = files
    runner = Runner(study, base, names)
    bad, good = runner.run(0), runner.run(1)
    assert (bad.status, good.status, bad.outcomes) == (status, "ok", ())
    # Not where the file is, which another process has elsewhere.
    assert reason in bad.reason and str(files) not in bad.reason and "\n" not in bad.reason


def test_what_goes_wrong_in_a_row_becomes_its_reason(base, monkeypatch):
    def explode(*_, **options):
        raise ZeroDivisionError(f"division\nby zero in {models_dir()}/sdt.sdf")

    for name, value, reason in (
        ("stops_passed", lambda *_: ["roll, 2 deg", "yaw"], "roll, 2 deg; yaw"),
        ("outcomes_of", lambda *_: (0.0, math.nan, *[0.0] * 27), "the speeds are not finite"),
        ("simulate", explode, "ZeroDivisionError: division by zero in package://sdt/sdt.sdf"),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(f"sdt_drake.studies.runs.{name}", value)
            [row] = run(base, of("controller", Choice(["p_pi"])))
        assert (row.status, row.reason, row.outcomes) == ("failed", reason, ())


def test_rows_do_not_depend_on_their_order_and_company(base, monkeypatch):
    """Two devices, two controllers, three motions; and a row alone leaves a recording."""
    study = Study(
        "mixed",
        draws=2,
        variables=[
            of("disturbance.amplitude", Uniform(0, 0.3)),
            of("controller", Choice(["pi", "p_pi+id"])),
            of("torque_margin", Grid(0.8, 1.0, 3)),
        ],
    )
    runner = Runner(study, base)
    rows = [runner.run(number) for number in range(12)]
    assert [row.number for row in rows] == list(range(12))
    assert {row.status for row in rows} == {"ok"} and len({row.outcomes[1] for row in rows}) > 2
    monkeypatch.setattr("sdt_drake.studies.runs._MAX_PLANS", 1)  # motions are planned again
    runner = Runner(study, base)
    others = [runner.run(number) for number in np.random.default_rng(0).permutation(12).tolist()]
    assert without_duration(sorted(others, key=lambda row: row.number)) == without_duration(rows)

    outcomes, recording, wrong = runner.repeat(4)
    assert wrong == "" and repr(outcomes) == repr(rows[4].outcomes)
    worst = np.abs(recording.speed_error).max(axis=0)
    np.testing.assert_allclose(worst, outcomes[:4], rtol=1e-12, atol=1e-15)


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
    with pytest.raises(InputError, match="no such file"):
        make_job(study, dataclasses.replace(base, motion="nowhere.yaml"))
    job = make_job(study, base)
    spread = base.plant.deviation.spread
    assert set(job.files) == {base.robot, base.motion, "own/short.yaml", spread}

    for file in (desk / "own").iterdir():
        file.unlink()
    (tmp_path / "there").mkdir()
    monkeypatch.chdir(tmp_path / "there")
    row = job.runner(tmp_path / "there").run(0)
    assert (row.status, row.reason) == ("ok", "")


def test_a_fingerprint_is_of_every_number_of_a_study(own_files, desk):
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
