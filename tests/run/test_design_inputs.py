"""A design is its inputs: all that follows from them is whole, and computed once."""

from __future__ import annotations

import dataclasses
import gc
from functools import cached_property
from importlib import import_module

import numpy as np
import pytest
from variants import kind

from sdt_drake.io.errors import InputError
from sdt_drake.motion import Motion
from sdt_drake.robot.deviation import Deviation
from sdt_drake.robot.device import Elasticity, Friction
from sdt_drake.robot.dynamics import torque_groups
from sdt_drake.run.design import Design, make_design
from sdt_drake.run.loop import make_loop
from sdt_drake.run.scenario import with_fields

LIGHT = Deviation(payload_mass=-40.0)
FIELDS = {
    "plant.deviation": LIGHT,
    "plant.friction": Friction([300.0, 60.0, 0.0, 20.0]),
    "plant.elasticity": Elasticity([90.0, 120.0, 150.0, 80.0]),
    "controller.model": Deviation(inertia_scale=1.1),
    "algorithm": "printed",
    "held_speed": "mean",
} | kind("pi_id", friction_compensation=True)
COMPUTED = [n for n, x in vars(Design).items() if isinstance(x, property | cached_property)]


def numbers(value):
    if isinstance(value, np.ndarray):
        return [value]
    if dataclasses.is_dataclass(value):
        value = tuple(getattr(value, field.name) for field in dataclasses.fields(value))
    return [x for part in value for x in numbers(part)] if isinstance(value, tuple) else []


@pytest.mark.parametrize("name", ["axis_pi", "coupled_pi"])
def test_a_replaced_scenario_gives_a_whole_design(designed, name):
    before = designed(name)
    for part in COMPUTED:  # before anything is replaced
        getattr(before, part)
    scenario = with_fields(before.scenario, FIELDS)
    whole = make_design(scenario, robot=before.nominal, motion=before.wanted)
    replaced = dataclasses.replace(before, scenario=scenario)
    for part in COMPUTED:
        new, expected = numbers(getattr(replaced, part)), numbers(getattr(whole, part))
        for x, y in zip(new, expected, strict=True):
            np.testing.assert_array_equal(x, y, err_msg=part)


def test_a_replaced_scenario_that_does_not_fit_makes_no_loop(design):
    stiff = with_fields(design.scenario, {"plant.elasticity": Elasticity([0.0, 0.0, 1e6, 0.0])})
    said = r"^scenario '\w+': plant\.elasticity\.natural_frequency: gives joint 3 a pole"
    with pytest.raises(InputError, match=said):
        make_loop(dataclasses.replace(design, scenario=stiff))


def test_torques_are_computed_once_for_a_robot_and_a_motion(designed, robot, monkeypatch):
    plant, asked = import_module("sdt_drake.run.plant"), []

    def counted(robot, q, v, vd):
        if len(q) > 1:  # not of a steady state
            asked.append(robot)
        return torque_groups(robot, q, v, vd)

    monkeypatch.setattr(plant, "torque_groups", counted)
    scenario = with_fields(designed("axis_pi").scenario, {"controller.model": LIGHT})
    gc.collect()
    kept = len(plant._along)
    motion = Motion.from_speeds(0.005, np.zeros(4), np.zeros((11, 4)))
    base = make_design(scenario, robot=robot, motion=motion)
    for label in ("pi", "pi_ctc", "pi_id", "p_pi", "pi_scheduled"):
        other = base.variant(with_fields(scenario, kind(label)))
        for part in COMPUTED:
            getattr(other, part)
        other.with_feedforward(np.zeros((11, 4)))
    assert asked == [base.model, robot]
    heavier = base.variant(with_fields(scenario, {"plant.deviation": LIGHT}))
    assert heavier.robot is base.model
    assert heavier.torques is base._modelled_torques
    assert len(asked) == 2
    del base, other, heavier, motion
    gc.collect()
    assert len(plant._along) == kept
