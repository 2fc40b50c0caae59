"""Runs of a study in one process: rows, good and bad, loads of motors, and what a job holds."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers.command_line import SHORT

from sdt_drake.analysis.heat import winding_temperature
from sdt_drake.analysis.stopping import StopLimits, Stopping
from sdt_drake.analysis.stops import stops
from sdt_drake.analysis.tracking import motor_use, track
from sdt_drake.io.errors import InputError
from sdt_drake.io.resources import models_dir
from sdt_drake.robot.device import Drive
from sdt_drake.robot.motors import DeviceChoice
from sdt_drake.run.design import make_design
from sdt_drake.run.scenario import Scenario, load_scenario
from sdt_drake.run.simulate import simulate
from sdt_drake.studies.distributions import Choice, List, Uniform
from sdt_drake.studies.job import make_job
from sdt_drake.studies.outcomes import (
    has_motor_loads,
    motor_load_names,
    motor_loads,
    outcome_names,
)
from sdt_drake.studies.runs import Runner
from sdt_drake.studies.study import Study, Variable, load_study


@pytest.fixture
def base(files) -> Scenario:
    return load_scenario(files / "axis.yaml")


def of(field: str, distribution) -> Variable:
    return Variable(field, [field], distribution=distribution)


def test_outcomes_of_a_row_equal_those_of_its_run(base, robot):
    runner = Runner(Study(variables=[of("disturbance.amplitude", List([0.1, 0.2]))]), base)
    row = runner.run(1)
    design = make_design(base.changed({"accuracy": 1e-3, "disturbance.amplitude": 0.2}))
    recording = simulate(design)
    tracking, motors = track(recording), motor_use(recording, robot)
    outcomes = dict(zip(outcome_names(base, robot.n), row.outcomes, strict=True))
    each = {"rms_speed_error": tracking.rms_speed_error}
    each |= {"peak_torque_share": motors.peak_share, "rms_torque_share": motors.rms_share}
    for family, expected in each.items():
        found = [outcomes[f"{family}_{k + 1}"] for k in range(robot.n)]
        np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-6)
        assert found[1] > 1e-3
    assert (row.status, row.reason) == ("ok", "") and row.duration > 0

    again, repeated, wrong = runner.repeat(1)
    assert wrong == "" and repr(again) == repr(row.outcomes)
    worst = np.abs(repeated.speed_error).max(axis=0)
    np.testing.assert_allclose(worst, again[: robot.n], rtol=1e-12, atol=1e-15)


def test_row_does_not_depend_on_rows_before(files):
    """Whatever robots and plans of other devices and motions the runner keeps."""
    drive = Drive(n1=[200.0, 0.01, 0.01, 0.01], n0=[300.0, 9.0, 9.0, 9.0])
    base = load_scenario(files / "coupled.yaml", {"drive": drive})
    levels = {"device.structure_scale": [1.0, 0.5], "torque_margin": [1.0, 0.05]}
    levels["drive.n0[2]"] = [9.0, 0.02]
    variables = [of(name, List(values)) for name, values in levels.items()]
    study = Study(variables=[*variables, of("disturbance.amplitude", Uniform(0, 0.3))])
    runner = Runner(study, base, plans=4)
    rows = {number: runner.run(number) for number in (7, 0, 4, 2, 1, 0)}
    for number, row in rows.items():
        alone = replace(Runner(study, base).run(number), duration=row.duration)
        assert repr(alone) == repr(row)  # NaN is not equal to NaN
    assert {row.status for row in rows.values()} == {"ok", "infeasible"}
    assert "the no-load speed (n0) by drive.n1 and drive.n0" in rows[1].reason


@pytest.mark.parametrize(
    ("field", "values", "status", "reason"),
    [
        ("disturbance.amplitude", List([-1.0, 0.1]), "failed", "amplitude: -1.0, expected"),
        ("period", List([0.007, 0.005]), "failed", "0.5 s is not a whole multiple of the per"),
        ("motion", Choice(["fast.yaml", "short.yaml"]), "infeasible", "fast.yaml: motion ref"),
    ],
)
def test_bad_row_fails_alone(base, files, field, values, status, reason):
    names = {name: str(files / name) for name in ("fast.yaml", "short.yaml")}
    runner = Runner(Study(variables=[of(field, values)]), base, names)
    bad, good = runner.run(0), runner.run(1)
    assert (bad.status, good.status, bad.outcomes) == (status, "ok", ())
    # Not where the file is, which another process has elsewhere.
    assert reason in bad.reason and str(files) not in bad.reason and "\n" not in bad.reason


def test_exception_in_a_row_becomes_its_reason(base, monkeypatch):
    def explode(*_, **options):
        raise ZeroDivisionError(f"division\nby zero in {models_dir()}/sdt.sdf")

    runner = Runner(Study(variables=[of("controller", Choice(["p_pi"]))]), base)
    for name, value, reason in (
        ("stops_passed", lambda *_: ["roll, 2 deg", "yaw"], "roll, 2 deg; yaw"),
        ("outcomes_of", lambda *_: (0.0, math.nan, *[0.0] * 27), "the speeds are not finite"),
        ("simulate", explode, "ZeroDivisionError: division by zero in package://sdt/sdt.sdf"),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(f"sdt_drake.studies.runs.{name}", value)
            row = runner.run(0)
        assert (row.status, row.reason, row.outcomes) == ("failed", reason, ())


# --- loads of motors -------------------------------------------------------------------------

FITTED = ["AC-203", "TM-3950", "TM-2150", "TM-2150"]


@pytest.mark.parametrize("T", [0.5, 50.0])
def test_winding_temperature_of_on_and_off_equals_formula(T):
    """u (1 - exp(-t_c / T)) / (1 - exp(-(t_c + t_p) / T)), at the end of the load."""
    on, off = 6.0, 14.0
    by_hand = 1.5**2 * (1 - np.exp(-on / T)) / (1 - np.exp(-(on + off) / T))
    load = np.full((1200, 1), 1.5)
    assert winding_temperature(load**2, [T], 0.005, off)[0] == pytest.approx(by_hand, rel=1e-9)
    with_rest = np.vstack([load, np.zeros((2800, 1))])  # the same pause in the motion
    assert winding_temperature(with_rest**2, [T], 0.005)[0] == pytest.approx(by_hand, rel=1e-9)


def designed(desk, knots: str):
    """A design of half a second of joint 2 on motors of the catalogue."""
    (desk / "short.yaml").write_text(SHORT.replace("[0.25, 0.5], [0.5, 0.5]", knots))
    changes = {"planner": "retiming", "controller.kind": "pi_id", "device.fitted": FITTED}
    return make_design(load_scenario("coupled.yaml", changes))


def test_motor_loads_of_a_run_equal_formulas(desk):
    design = designed(desk, "[0.25, 1], [0.5, 1]")
    run, duration = simulate(design), design.reference.tracked.duration
    of = (motor_loads(design, run, 0.5, pause) for pause in (0.0, 120.0))
    loads, rested = (dict(zip(motor_load_names(4), x, strict=True)) for x in of)
    assert loads["used_torque_share_2"] == pytest.approx(run.tau_peak[:, 1].max() / 3950)
    rms = np.sqrt(np.mean(run.tau_rms[1:, 1] ** 2)) / 1780
    assert loads["rated_torque_share_2"] == pytest.approx(rms)
    less = np.sqrt(duration / (duration + 120))
    assert rested["rated_torque_share_2"] == pytest.approx(less * rms)
    # The peak of a slow winding is hardly above its mean.
    assert rms**2 < loads["winding_temperature_2"] < 1.02 * rms**2
    assert rested["winding_temperature_2"] < loads["winding_temperature_2"]
    # Slower than n1 there is the peak torque.
    planned = run.tau_rms[:, 1].max() / 3950
    assert loads["torque_at_speed_share_2"] == pytest.approx(planned, rel=0.02)
    assert loads["stretch"] == 0


MOTOR = """\
  - {id: SLOW, kind: torque motor, peak_torque: 3950, rated_torque: 1780, rotor_inertia: 8.6, \
mass: 560, thermal_time_constant: 900, source: made up"""


def test_chosen_motors_act_as_the_same_numbers_in_the_drive(desk):
    scenario, rpm = designed(desk, "[0.25, 1], [0.5, 0]").scenario, np.pi / 30
    friction = {"plant.friction.coulomb": [0, 600.0, 0, 0]}  # the planner ignores it
    scenario = scenario.changed(friction)
    shipped = (models_dir() / "motors.yaml").read_text()

    def driven(speeds: str = "", **drive):
        (desk / "own.yaml").write_text(f"{shipped}{MOTOR}{speeds}}}\n")
        device = DeviceChoice(["", "SLOW", "", ""], fitted=[*FITTED], catalogue="own.yaml")
        return make_design(replace(scenario, device=device, drive=Drive(**drive)))

    chosen = driven(f", n1_rpm: {0.25 / rpm!r}, n0_rpm: {1.02 / rpm!r}")
    assert chosen.envelope.source == "the motors of the catalogue (AC-203, SLOW, TM-2150, TM-2150)"
    first = simulate(chosen)
    assert first.saturated[:, 1].any() and first.v[:, 1].max() > 0.6
    given = driven(n1=[*chosen.envelope.n1], n0=[*chosen.envelope.n0])
    assert given.envelope.source.startswith("drive.n1 and drive.n0, instead of the motors of the")
    for name, values in vars(simulate(given)).items():
        np.testing.assert_array_equal(values, getattr(first, name), err_msg=name)
    assert motor_loads(chosen, first, 0.5) == motor_loads(given, first, 0.5)
    free = driven()
    assert "without any: joint 2, no n1_rpm and n0_rpm" in free.envelope.source
    assert not simulate(free).saturated[:, 1].any()


def test_motor_loads_need_a_coupled_plant_and_catalogue_motors():
    """A robot whose masses contain no motors, too, if each joint has one of the catalogue."""

    def has(kind: str, *device) -> bool:
        device = dict(zip(("motors", "fitted"), device, strict=False))
        return has_motor_loads(load_scenario("coupled_pi", {"plant.kind": kind, "device": device}))

    kept = [""] * 4
    assert has("coupled", FITTED, kept) and not has("axis", FITTED, kept)
    assert not has("coupled", [*FITTED[:3], ""], kept) and not has("coupled")


# --- jobs ------------------------------------------------------------------------------------


def test_job_carries_its_files(desk, tmp_path, monkeypatch):
    """A robot, its uncertainty and a motion of its own, varied over two motions."""
    deviation = "kind: axis, deviation: {spread: spread.csv, along: [1]}"
    columns = [f"x_{k + 1}" for k in range(50)]  # ten for each link
    for name, text in {
        "device.sdf": (models_dir() / "sdt.sdf").read_text(),
        "spread.csv": f"row,{','.join(columns)}\n1{50 * ',0.01'}\n",
        "base.yaml": (desk / "axis.yaml").read_text().replace("kind: axis", deviation)
        + "robot: device.sdf\n",
    }.items():
        (desk / name).write_text(text)
    base = load_scenario("base.yaml")
    study = Study(variables=[of("motion", Choice(["short.yaml", "coriolis"]))])
    object.__setattr__(study, "folder", desk)  # as for a study read from a file
    with pytest.raises(InputError, match="no such file"):
        make_job(study, replace(base, motion="nowhere.yaml"))
    job = make_job(study, base)
    spread = base.plant.deviation.spread
    assert {*job.about.files} == {base.robot, base.motion, "short.yaml", spread}
    for file in desk.iterdir():
        file.unlink()
    row = job.runner(tmp_path / "there").run(0)
    assert (row.status, row.reason) == ("ok", "")


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        ("few.yaml", "draws: 3", "draws: 3\nseed: 7"),
        ("axis.yaml", "0.98", "0.97"),
        ("short.yaml", "0.5]]", "0.4]]"),
    ],
)
def test_study_contents_are_independent_of_its_folder(desk, file, old, new):
    first = make_job(*load_study("few.yaml")).about.contents
    moved = desk.rename(desk.parent / "moved")
    assert make_job(*load_study(moved / "few.yaml")).about.contents == first
    (moved / file).write_text((moved / file).read_text().replace(old, new))
    assert make_job(*load_study(moved / "few.yaml")).about.contents != first


STOP = Stopping(
    every=0.25, motors=["AC-203", "TM-3950", "TM-2150", "TM-2150"], limits=StopLimits(g_onset=3)
)


def test_stops_of_a_row_are_those_of_its_run(files):
    coupled = load_scenario(files / "coupled.yaml")
    study = Study(stops=STOP, variables=[of("plant.deviation.payload_mass", List([0.0, 50.0]))])
    runner = Runner(study, coupled)
    shares = []
    for row, mass in enumerate((0.0, 50.0)):
        changes = {"accuracy": 1e-3, "plant.deviation.payload_mass": mass}
        outcomes = runner.run(row).outcomes
        names = outcome_names(coupled, 4, STOP)
        shares.append(dict(zip(names, outcomes, strict=True))["stop_share"])
        assert shares[-1] == pytest.approx(stops(make_design(coupled.changed(changes)), STOP).share)
    assert shares[0] != pytest.approx(shares[1], rel=1e-3)


@pytest.mark.parametrize(
    "base, stop, message",
    [
        ("axis", STOP, "stops.plant.kind: axis, expected coupled"),
        ("coupled", STOP.changed({"motors": []}), "stops.motors: missing, expected the id"),
        ("coupled", STOP.changed({"motors": ["AC-203"]}), r"motors: 1 value\(s\), expected 4"),
    ],
)
def test_stops_that_do_not_fit_the_base_are_refused_before_any_run(files, base, stop, message):
    study = Study(stops=stop, variables=[of("disturbance.amplitude", List([0.1]))])
    with pytest.raises(InputError, match=message):
        make_job(study, load_scenario(files / f"{base}.yaml"))
