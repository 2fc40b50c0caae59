"""Fields of a scenario by their dotted names."""

from __future__ import annotations

import dataclasses
import re

import pytest

from sdt_drake.io.errors import InputError
from sdt_drake.robot.device import Friction
from sdt_drake.robot.motors import DeviceChoice
from sdt_drake.run.scenario import Scenario, load_scenario
from sdt_drake.studies.fields import find_field
from sdt_drake.studies.study import load_study


@pytest.fixture
def scenario() -> Scenario:
    """With a friction and a device."""
    scenario = Scenario(device=DeviceChoice(motors=["a", "b"]))
    scenario.plant.friction = Friction(coulomb=[1.0, 2.0, 4.0])
    return scenario


@pytest.mark.parametrize(
    ("name", "how", "value", "expected"),
    [
        ("algorithm", "value", "printed", "printed"),
        ("controller.anti_windup", "value", True, True),
        ("controller.model.payload_mass", "value", 3.0, 3.0),
        ("plant.friction.coulomb[3]", "value", 9.0, [1, 2, 9]),
        ("plant.friction.coulomb", "value", 7.0, [7, 7, 7]),
        ("plant.friction.coulomb", "factor", 3.0, [3, 6, 12]),
        ("plant.friction.coulomb[2]", "offset", 3.0, [1, 5, 4]),
        ("device.motors[2]", "value", "c", ["a", "c"]),
        ("plant.deviation.payload_offset[1]", "value", 0.1, [0.1, 0, 0]),
        ("period", "factor", 3.0, 0.015),
    ],
)
def test_sets_what_it_gets_and_nothing_else(scenario, name, how, value, expected):
    field, before = find_field(name), dataclasses.asdict(scenario)
    field.put(scenario, value, how)
    assert field.type is type(value) and field.get(scenario) == pytest.approx(expected)
    after = dataclasses.asdict(scenario)
    assert [key for key in before if before[key] != after[key]] == [name.split(".")[0]]


@pytest.mark.parametrize(
    ("name", "how", "message"),
    [
        ("controller.coulomb", "value", "(mean|one of) .?plant.friction.coulomb"),
        ("controller.kp[1].x", "value", "not a field of a scenario"),
        ("controller.kp[0]", "value", "not a field of a scenario, did you mean 'controller.kp'"),
        (f"controller.kp[{'9' * 5000}]", "value", "not a field .* did you mean 'controller.kp'"),
        ("zzz", "value", "not a field of a scenario, expected one of name, robot, "),
        ("plant.friction", "value", "a group of fields, expected one of plant.friction.coulomb, "),
        ("period[1]", "value", "period is not a list"),
        ("controller.kp[2]", "factor", "empty in the base scenario; add"),
        ("plant.friction.coulomb[4]", "value", r"list has 3 value\(s\), expected"),
        ("controller.omega_r", "factor", "to apply a factor to; add"),
    ],
)
def test_a_field_that_cannot_be_set_is_refused(scenario, name, how, message):
    with pytest.raises(InputError, match=message):
        find_field(name).put(scenario, 1.0, how)


@pytest.mark.parametrize(
    ("change", "is_lost"),
    [
        ("controller.kind", True),
        ("controller.omega_ratio", False),
        ("plant.friction.coulomb[2]", False),  # which a factor scales
        ("plant.deviation.payload_mass", True),
        ("accuracy", True),
    ],
)
def test_changes_that_a_study_would_overwrite_are_refused(change, is_lost):
    changes = {
        "controller.kind": "p_pi",
        "controller.omega_ratio": 0.4,
        "plant.friction.coulomb[2]": 3,
    }
    one = {change: changes.get(change, 1)}
    if not is_lost:
        assert load_study("monte_carlo", one)[1] == load_scenario("uncertain", one)
        return
    with pytest.raises(InputError, match=rf"^{re.escape(change)}: .*monte_carlo.yaml sets"):
        load_study("monte_carlo", one)
