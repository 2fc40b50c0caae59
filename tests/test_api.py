"""What is given wrongly in Python is refused as what is wrong in a file: one line, InputError."""

import copy
import dataclasses
from importlib import import_module

import numpy as np
import pytest

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
        ("period", "0.005", "period: '0.005', expected a number"),
        ("plant", None, "plant: empty, expected a PlantChoice"),
        ("controller", "pi", "controller: 'pi', expected a ControllerChoice"),
        ("controller.zeta", ["a"] * 4, "controller.zeta[1]: 'a', expected a number"),
        ("disturbance.omega_d", 1e9, "disturbance.omega_d: 1e+09, expected at most 20000 [rad/s]"),
    ],
)
def test_fields_of_a_scenario(design, field, value, message):
    scenario = with_fields(design.scenario, {field: value})
    with pytest.raises(InputError) as error:
        make_design(scenario, robot=design.robot, motion=STILL)
    assert message in str(error.value)


def test_arrays_are_lists(design):
    scenario = copy.deepcopy(design.scenario)
    scenario.controller.zeta = np.full(4, 0.9)
    make_design(scenario, robot=design.robot, motion=STILL)


def test_motions_that_drake_would_die_of(design):
    motion = copy.deepcopy(STILL)
    motion.v[3, 1] = np.nan
    with pytest.raises(InputError, match=r"v of joint 2 is not finite at 0\.015 s"):
        make_design(design.scenario, robot=design.robot, motion=motion)


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
