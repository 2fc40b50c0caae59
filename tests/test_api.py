"""What is given wrongly in Python is refused as what is wrong in a file: one line, InputError."""

import copy
import dataclasses
from importlib import import_module

import numpy as np
import pytest
from variants import overruled

import sdt_drake as sdt
from sdt_drake.io.errors import InputError
from sdt_drake.motion import Motion
from sdt_drake.run.design import make_design
from sdt_drake.run.loop import make_loop
from sdt_drake.run.scenario import with_fields
from sdt_drake.run.simulate import simulate

STILL = Motion.from_speeds(0.005, np.zeros(4), np.zeros((21, 4)))


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("plant", None, "plant: empty, expected a PlantChoice"),
        ("controller", "pi", "controller: 'pi', expected a ControllerChoice"),
        ("disturbance.omega_d", 1e9, "disturbance.omega_d: 1e+09, expected at most 20000 [rad/s]"),
    ],
)
def test_fields_of_a_scenario(design, field, value, message):
    scenario = with_fields(design.scenario, {field: value})
    with pytest.raises(InputError) as error:
        make_design(scenario, robot=design.robot, motion=STILL)
    assert message in str(error.value)


def test_motions_that_drake_would_die_of(design):
    motion = copy.deepcopy(STILL)
    motion.v[3, 1] = np.nan
    with pytest.raises(InputError, match=r"v of joint 2 is not finite at 0\.015 s"):
        make_design(design.scenario, robot=design.robot, motion=motion)


NAN, V, Q0 = float("nan"), np.zeros((21, 4)), np.zeros(4)
ARGUMENTS = [
    (lambda design: Motion.from_speeds(NAN, Q0, V), "period: nan, expected a finite number > 0"),
    (lambda design: Motion.from_speeds("5 ms", Q0, V), "period: 5 ms, expected a finite number"),
    (lambda design: Motion(NAN, V, V, V), "period: nan, expected a finite number > 0"),
    (lambda design: Motion(0.005, V, V[:5], V), r"q, v, vd: shapes \(21, 4\), \(5, 4\), "),
    (lambda design: Motion.from_speeds(0.005, Q0, V + NAN), r"v\[0, 0\]: nan, expected finite"),
    (lambda design: Motion.from_speeds(0.005, Q0, V[0]), r"v: of shape \(4,\), expected numbers"),
    (lambda design: Motion.from_speeds(0.005, None, V), r"q0: None, expected numbers of shape \(n"),
    (lambda design: Motion.from_speeds(0.005, Q0[:3], V), "q0: 3 joint.*, expected 4 as in v"),
    (lambda design: Motion.from_positions(0.005, V[:2]), r"q: 2 row\(s\), expected at least 3"),
    (lambda design: Motion.from_positions(0.005, "q"), "q: q, expected numbers of shape"),
    (lambda design: Motion.from_csv(None), "path: a NoneType, expected a path"),
    (lambda design: STILL.to_csv(3), "path: a int, expected a path"),
    (lambda design: sdt.plan("leans", torque_margin=NAN), "torque_margin: nan, expected a finite"),
    (lambda design: sdt.plan("leans", torque_margin=0), "torque_margin: 0, expected .* > 0"),
    (lambda design: sdt.plan("leans", torque_margin=1.5), "torque_margin: 1.5, expected at most 1"),
    (lambda design: sdt.plan("leans", period="a"), "period: a, expected a finite number > 0"),
    (lambda design: sdt.plan(STILL), "path: a Motion, expected a path"),
    (lambda design: sdt.load(None), "path: a NoneType, expected a path"),
    (
        lambda design: sdt.save("x.yaml", design.scenario),
        "scenario: a str, expected a Scenario, as",
    ),
    (lambda design: sdt.save(design.scenario, None), "path: a NoneType, expected a path"),
    (lambda design: make_design(design.scenario, motion="leans"), "motion: a str, expected a Moti"),
    (
        lambda design: make_design(design.scenario, robot="sdt"),
        "robot: a str, expected a Robot, as",
    ),
    (
        lambda design: simulate(design, "loop"),
        "diagram: a str, expected a Diagram, as sdt_drake.lo",
    ),
    (lambda design: make_loop(design, meshcat="x"), "meshcat: a str, expected a Meshcat, as "),
    (
        lambda design: make_loop(design, moved=(V + NAN, V)),
        r"moved\[0, 0, 0\]: nan, expected finite",
    ),
    (
        lambda design: make_loop(design, moved=(V, V)),
        r"moved: of shape \(2, 21, 4\), expected \(2, ",
    ),
    (lambda design: sdt.compare(design, 3), r"controllers: 3, expected a list of labels: \['pi', "),
    (
        lambda design: sdt.compare(design, [None]),
        r"controllers: \[None\], expected a list of labels",
    ),
    (lambda design: sdt.view(design, "run.csv"), "recording: a str, expected a Recording, as "),
    (lambda design: sdt.view(design).save(None), "path: a NoneType, expected a path"),
    (lambda design: sdt.linear(design, True), "sample: True, expected a whole number"),
]


@pytest.mark.parametrize(("use", "message"), ARGUMENTS, ids=[line for _, line in ARGUMENTS])
def test_arguments_that_are_none(design, use, message):
    with pytest.raises(InputError, match=f"^{message}") as error:
        use(design)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["axis_pi", "coupled_pi"])
def test_gains_that_drake_would_never_end_with(designed, name):
    design = designed(name, end=0.1)
    gains = dataclasses.replace(design.gains, ki=design.gains.ki * np.nan)
    with pytest.raises(InputError, match=r"^controller 'pi' \(class Pi\): tau_cmd .* nan at 0 s"):
        simulate(overruled(design, gains=gains))


def test_a_motion_of_other_joints(design):
    motion = Motion.from_speeds(0.005, Q0[:3], V[:, :3])
    with pytest.raises(InputError, match=r"motion: of 3 joint\(s\), robot 'sdt' has 4"):
        make_design(design.scenario, robot=design.robot, motion=motion)


def test_a_scenario_stands_for_its_design(designed):
    """It is resolved where it is taken."""
    scenario = with_fields(designed("coupled_pi").scenario, {"motion": "leans"})
    run = simulate(scenario)
    np.testing.assert_array_equal(run.v, simulate(make_design(scenario)).v)


def test_the_loop_of_another_plant(design, designed):
    with pytest.raises(InputError, match="'axis_loop', expected the loop of the design"):
        simulate(design, make_loop(designed("axis_pi")))


def test_an_integrator_that_makes_no_headway_says_when(design, monkeypatch):
    """With the least step far above what the loop needs."""
    scenario = dataclasses.replace(design.scenario, accuracy=1e-12)
    own = make_design(scenario, robot=design.robot, motion=design.motion)
    monkeypatch.setattr(import_module("sdt_drake.run.simulate"), "_MOST_STEPS", 2)
    with pytest.raises(InputError, match=r"stuck at \d.* s \("):
        simulate(own)
