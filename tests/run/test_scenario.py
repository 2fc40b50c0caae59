"""Scenarios: YAML in and out, paths, designs, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sdt_drake.io.errors import InputError
from sdt_drake.io.fields import check
from sdt_drake.io.resources import find_file, models_dir
from sdt_drake.io.trust import trusting
from sdt_drake.motion import Motion, load_command, load_plan
from sdt_drake.robot.deviation import Deviation
from sdt_drake.robot.device import Drive, Elasticity, Friction
from sdt_drake.robot.motors import DeviceChoice
from sdt_drake.run.design import make_design
from sdt_drake.run.scenario import (
    ControllerChoice,
    DisturbanceChoice,
    PlantChoice,
    Scenario,
    load_scenario,
    save_scenario,
)

SHIPPED = sorted(path.stem for path in (models_dir() / "scenarios").glob("*.yaml"))
# Table 1.
I_EFF = [4.26, 98.01, 796.3, 250.28]
KP = [267.1, 6.34e3, 5.2e4, 1.57e4]
KI = [4.64e3, 1.07e5, 8.67e5, 2.73e5]
ZETA = [0.95, 0.98, 0.99, 0.95]
STILL = "duration: 1\njoints:\n" + 4 * "  - !Knots {knots: [[0, 0], [1, 0]]}\n"


def shipped(name: str) -> Scenario:
    return load_scenario(f"package://sdt/scenarios/{name}.yaml")


@pytest.fixture
def load(tmp_path):
    """Write the text of a scenario and load it."""

    def load_text(text: str) -> Scenario:
        path = tmp_path / "run.yaml"
        path.write_text(text, encoding="utf-8")
        return load_scenario(path)

    return load_text


# --- the shipped scenarios -------------------------------------------------------------------


PUBLISHED = ["axis_pi", "axis_pi_ctc", "coupled_pi", "coupled_pi_ctc"]


def test_the_papers_scenarios_are_ideal():
    for scenario in map(shipped, PUBLISHED):
        assert scenario.plant.friction.is_none and scenario.plant.elasticity.is_rigid
        assert scenario.drive == Drive()
        assert scenario.controller.model.exact


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_scenario_survives_a_round_trip_and_can_be_made(name, tmp_path, designed):
    scenario = shipped(name)
    check(scenario, n=4)
    assert scenario.name == name
    assert scenario.period == 0.005
    save_scenario(scenario, tmp_path / "new" / "copy.yaml")
    assert load_scenario(tmp_path / "new" / "copy.yaml") == scenario
    assert designed(name).scenario == scenario


@pytest.mark.parametrize("name", ["axis_pi", "axis_pi_ctc"])
def test_axis_scenarios_have_the_published_numbers(name, designed):
    scenario = shipped(name)
    assert scenario.plant == PlantChoice("axis", I_EFF)
    assert scenario.controller == ControllerChoice(
        kind=name.removeprefix("axis_"), structure="p_in_feedback", kp=KP, ki=KI
    )
    assert scenario.algorithm == "printed"
    amplitude = 0.05 if name == "axis_pi_ctc" else 0.0
    assert scenario.disturbance == DisturbanceChoice(amplitude, 2 * np.pi)
    design = designed(name)
    np.testing.assert_array_equal(design.i_eff, I_EFF)
    np.testing.assert_array_equal(design.gains.kp, KP)
    np.testing.assert_array_equal(design.gains.ki, KI)


@pytest.mark.parametrize("name", ["coupled_pi", "coupled_pi_ctc"])
def test_coupled_scenarios_are_tuned_to_table_1(name, designed):
    scenario = shipped(name)
    assert scenario.plant == PlantChoice("coupled", None)
    assert scenario.controller == ControllerChoice(
        kind=name.removeprefix("coupled_"), structure="p_in_feedback", omega_r=65.991, zeta=ZETA
    )
    assert scenario.controller.omega_r == pytest.approx(2 * np.pi * 10.5028, rel=1e-5)
    assert scenario.algorithm == "consistent"
    gains = designed(name).gains
    # The paper prints 2.73e5 for joint 4; its own formula gives 2.7248e5.
    np.testing.assert_allclose(gains.ki, [4.64e3, 1.067e5, 8.67e5, 2.7248e5], rtol=1e-3)
    np.testing.assert_allclose(gains.kp, KP, rtol=5e-3)


# --- a design takes what the scenario says ---------------------------------------------------


def test_defaults_of_inertia_and_zeta(designed):
    without = {"plant.i_eff": None, "controller.zeta": None}
    design = designed("axis_pi", without)
    np.testing.assert_allclose(design.i_eff, [4.2601, 98.0127, 796.298, 250.280], rtol=1e-5)
    # zeta = 1: K_PS = 2 I_eff omega_n with omega_n = omega_r / 2
    gains = designed("coupled_pi", without).gains
    np.testing.assert_allclose(gains.kp, 65.991 * design.inertia.maximum, rtol=1e-12)


def test_algorithm_chooses_the_sign_of_the_loads(designed):
    consistent, printed = (
        designed("coupled_pi", {"algorithm": algorithm}).loads
        for algorithm in ("consistent", "printed")
    )
    np.testing.assert_array_equal(printed.alleviating_torque, consistent.alleviating_torque)
    np.testing.assert_array_equal(np.abs(printed.load_torque), np.abs(consistent.load_torque))
    assert np.any(printed.load_torque != consistent.load_torque)


def test_torque_margin_period_and_planner_reach_the_plan(load, robot, tmp_path):
    text = "motion: reference\ntorque_margin: 0.9\nperiod: 0.01\ncontroller: {omega_r: 60}\n"
    motion = make_design(load(text)).motion
    assert motion.period == 0.01
    command = load_command("reference", robot).speeds(motion.time)
    np.testing.assert_array_equal(np.any(np.abs(motion.v - command) > 1e-3, axis=0), [0, 1, 0, 0])
    (tmp_path / "fast.yaml").write_text(STILL.replace("[1, 0]", "[0.5, 2], [1, 0]", 1))
    text = text.replace("reference", "fast.yaml")
    with pytest.raises(InputError, match="joint 1 'planetary'"):
        make_design(load(text))
    assert make_design(load(text + "planner: retiming\n")).motion.duration > 1


# --- every field -----------------------------------------------------------------------------


def on_axes() -> Scenario:
    """No field has its default but omega_r, omega_ratio and zeta."""
    return Scenario(
        name="axes",
        robot="package://sdt/other.sdf",
        device=DeviceChoice(
            ["", "TM-2860", "", ""],
            [60.0, 1.0, 1.0, 1.0],
            0.9,
            "gondola",
            2.0,
            ["AC-203"] * 4,
            "package://sdt/other.yaml",
        ),
        motion="package://sdt/motions/other.csv",
        period=0.01,
        torque_margin=0.9,
        planner="retiming",
        algorithm="printed",
        inverse_dynamics="online",
        accuracy=1e-5,
        plant=PlantChoice(
            "axis",
            I_EFF,
            Friction(I_EFF, KP, KI, 0.1, 2e-5),
            Elasticity([0.0, 9, 9, 9], 0, "link"),
            Deviation("arm", 3.0, [0.1, 0.0, 0.0], 0.95, [1.1, 1.0]),
        ),
        drive=Drive(0.0005, 200.0, [0.0, 0.1, -0.1, 0], [1e6] * 4, I_EFF, KP, 0.015),
        controller=ControllerChoice(
            kind="p_pi",
            file=str(Path(__file__).parents[1] / "own_controllers.py"),
            structure="pi",
            kp=KP,
            ki=KI,
            anti_windup=True,
            feedforward="id",
            feedforward_gain=[1.1, 1.0, 0.9, -0.5],
            friction_compensation=True,
            position_gain=[1.0, 2.0, 3.0, 4.0],
            model=Deviation("gondola", -40.5, [0.0, 1e-3, -0.1], 1.05, [0.9]),
        ),
        disturbance=DisturbanceChoice(0.05, 3.0),
    )


def coupled() -> Scenario:
    """The same on the coupled plant, with omega_r, omega_ratio and zeta instead of gains."""
    scenario = on_axes()
    scenario.plant.kind, scenario.plant.i_eff = "coupled", None
    controller = scenario.controller
    controller.kp = controller.ki = None
    controller.omega_r, controller.zeta = 65.991, ZETA
    controller.omega_ratio = 0.4
    return scenario


@pytest.mark.parametrize("make", [on_axes, coupled])
def test_every_field_survives_a_round_trip(make, tmp_path):
    scenario = make()
    with trusting(True):
        check(scenario, n=4)
    save_scenario(scenario, tmp_path / "run.yaml")
    assert load_scenario(tmp_path / "run.yaml") == scenario


def test_empty_parts_are_ideal_ones(load):
    parts = "drive: {}\ndevice:\nplant: {friction: {}, elasticity: null}\ndisturbance:\n"
    scenario = load(parts + "controller: {omega_r: 60, model: {}, zeta: null}\n")
    assert scenario == Scenario(name="run", controller=ControllerChoice(omega_r=60.0))


# --- what a controller is in use -------------------------------------------------------------


@pytest.mark.parametrize(
    "kind, feedforward, in_use, structure, label",
    [
        ("pi", None, "none", "p_in_feedback", "pi"),
        ("pi_ctc", None, "ctc", "p_in_feedback", "pi_ctc"),
        ("pi_id", None, "id", "pi", "pi_id"),
        ("p_pi", None, "none", "pi", "p_pi"),
        ("p_pi", "none", "none", "pi", "p_pi"),
        ("p_pi", "id", "id", "pi", "p_pi+id"),
        ("pi_scheduled", "ctc", "ctc", "p_in_feedback", "pi_scheduled+ctc"),
        ("inverse_dynamics", None, "none", "p_in_feedback", "inverse_dynamics"),
    ],
)
def test_feedforward_structure_and_label(kind, feedforward, in_use, structure, label):
    choice = ControllerChoice(kind=kind, feedforward=feedforward)
    assert choice.feedforward_in_use == in_use
    assert choice.structure_in_use == structure
    assert choice.label == label


# --- paths -----------------------------------------------------------------------------------

PROJECT = """robot: robots/own.sdf
motion: ../still.yaml
device: {catalogue: own_motors.yaml}
controller:
  omega_r: 60
"""


@pytest.mark.parametrize("start, path", [("elsewhere", "../project/runs"), ("project", "runs")])
def test_paths_start_from_the_folder_of_the_scenario_and_survive_saving(
    tmp_path, monkeypatch, start, path
):
    folder = tmp_path / "project" / "runs"
    (folder / "robots").mkdir(parents=True)
    (folder / "robots" / "own.sdf").write_bytes(find_file("package://sdt/sdt.sdf").read_bytes())
    (folder / "own_motors.yaml").write_bytes(find_file("motors", "motors").read_bytes())
    (folder.parent / "still.yaml").write_text(STILL)
    (folder / "first_run.yaml").write_text(PROJECT)
    (tmp_path / start).mkdir(exist_ok=True)
    monkeypatch.chdir(tmp_path / start)
    scenario = load_scenario(f"{path}/first_run.yaml")
    assert scenario.name == "first_run"
    design = make_design(scenario)
    assert design.robot.path.samefile(folder / "robots" / "own.sdf")
    assert design.motion.duration == 1
    assert scenario.device.catalogue == str(folder / "own_motors.yaml")
    save_scenario(scenario, tmp_path / "results" / "copy.yaml")
    assert load_scenario(tmp_path / "results" / "copy.yaml") == scenario


# --- what is refused -------------------------------------------------------------------------

AXIS = find_file("package://sdt/scenarios/axis_pi.yaml").read_text(encoding="utf-8")


def test_all_that_is_wrong_in_a_file_is_told(load, tmp_path):
    text = AXIS.replace("period:", "perod:").replace("267.1", "-267.1").replace("axis\n", "axes\n")
    text = text.replace("package://sdt/motions/reference.yaml", "referense")
    with pytest.raises(InputError) as error:
        load(text)
    assert str(error.value).splitlines() == [
        f"{tmp_path / 'run.yaml'}: {line}"
        for line in (
            f"motion: referense: no such motion, did you mean 'reference'? (looked in {tmp_path} "
            "and among what ships)",
            "plant.kind: 'axes', expected one of axis, coupled",
            "controller.kp[1]: -267.1, expected a number > 0 [N m s/rad]",
            "perod: no such field, did you mean 'period'?",
        )
    ]


MISFIT = [
    (AXIS, "267.1, ", "", r"scenario 'axis_pi': controller\.kp: 3 value\(s\), expected 4"),
    (AXIS, "0.005", "0.007", r"30 s is not a whole multiple of the period 0\.007 s"),
    (AXIS, "0.005", "1e-310", "period"),
    (AXIS, "package://sdt/sdt.sdf", "none.sdf", r"none\.sdf: no such file"),
    (AXIS, "package://sdt/motions/reference", "none", r"none\.yaml: no such file"),
    (AXIS, "package://sdt/motions/reference.yaml", ".", "is a folder, expected a file"),
    (AXIS, "package://sdt/motions/reference", "package://sdt/motions/x", r"shipped: .*reference"),
    (AXIS, "package://sdt/sdt.sdf", "package://other/a.sdf", "package://other/a.sdf: no such"),
]


@pytest.mark.parametrize("text, old, new, message", MISFIT, ids=[case[-1] for case in MISFIT])
def test_a_field_that_does_not_fit_the_robot_or_motion_is_refused(load, text, old, new, message):
    assert old in text
    scenario = load(text.replace(old, new, 1))
    with pytest.raises(InputError, match=message):
        make_design(scenario)


# --- motions of a design ---------------------------------------------------------------------


@pytest.fixture
def write_motion(tmp_path):
    """Write a motion as CSV; gives its path."""

    def write(motion: Motion) -> Path:
        path = tmp_path / "motion.csv"
        motion.to_csv(path)
        return path

    return write


def standing(n: int = 4, period: float = 0.005, speed: float = 0.0) -> Motion:
    v = np.zeros((11, n))
    v[:, 0] = speed * np.arange(11)
    return Motion.from_speeds(period, np.zeros(n), v)


def test_a_planned_motion_is_the_same_from_its_csv(design, robot, write_motion):
    motion = load_plan(write_motion(design.motion), robot, period=0.005).motion
    for name in ("q", "v", "vd", "time"):
        np.testing.assert_array_equal(getattr(motion, name), getattr(design.motion, name))


@pytest.mark.parametrize(
    "motion, message",
    [
        (standing(n=3), "3 joints, robot 'sdt' has 4"),
        # 200 rad/s² of joint 1.
        (standing(speed=1.0), r"joint 1 'planetary' at 0\.000 s: needs torque 3\.65093e\+06 N m"),
    ],
    ids=["joints", "torque"],
)
def test_a_csv_that_the_robot_cannot_do_is_refused(robot, write_motion, motion, message):
    with pytest.raises(InputError, match=rf"motion\.csv: .*{message}"):
        load_plan(write_motion(motion), robot, period=0.005)


def test_the_margin_holds_for_a_csv_too(design, robot, write_motion):
    path = write_motion(design.motion)
    load_plan(path, robot, period=0.005, torque_margin=0.93)
    with pytest.raises(InputError, match=r"motion\.csv: joint 2 'roll' at .* N m"):
        load_plan(path, robot, period=0.005, torque_margin=0.92)


@pytest.mark.parametrize(
    "name, text, message",
    [
        ("still.txt", STILL, "expected a motion profile .* or a motion file"),
        ("still.yml", STILL.replace("0], [1, 0", "0], [1, 9", 1), "joint 1 'planetary' at 0.000 s"),
        ("still.yaml", STILL.replace("1, 0]", "1, 9]", 4), "motion refused"),
        ("still.yaml", STILL[: STILL.rindex("  -")], r"joints: 3 value\(s\), expected 4"),
    ],
)
def test_a_file_that_is_no_motion_of_the_robot_is_refused(robot, tmp_path, name, text, message):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(InputError, match=f"{name}: .*{message}") as error:
        load_plan(path, robot, period=0.005)
    assert str(error.value).count(name) == 1
