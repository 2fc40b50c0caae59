"""Fields of a scenario by their dotted names."""

from __future__ import annotations

import dataclasses

import pytest

from sdt_drake.device import DeviceChoice, Drive, Friction
from sdt_drake.errors import InputError
from sdt_drake.scenario import ControllerChoice, Scenario
from sdt_drake.studies.fields import field_names, find_field


@pytest.fixture
def scenario() -> Scenario:
    """With a friction, a device and a drive."""
    scenario = Scenario(device=DeviceChoice(motors=["a", "b"]), drive=Drive())
    scenario.plant.friction = Friction(coulomb=[1.0, 2.0, 4.0])
    scenario.controller.feedforward_gain = [0.5, 1.0]
    return scenario


@pytest.mark.parametrize(
    ("name", "kind", "value"),
    [
        ("period", float, 0.01),
        ("algorithm", str, "printed"),
        ("controller.anti_windup", bool, True),
        ("controller.model.payload_mass", float, 3.0),
        ("plant.deviation.inertia_scale", float, 1.1),
        ("drive.period", float, 0.001),
        ("plant.friction.coulomb[3]", float, 9.0),
        ("device.motors[2]", str, "c"),
        ("plant.deviation.payload_offset[1]", float, 0.1),
    ],
)
def test_sets_what_it_gets(scenario, name, kind, value):
    field = find_field(name)
    before = dataclasses.asdict(scenario)
    field.set(scenario, value)

    assert field.type is kind and not field.many
    assert field.get(scenario) == value
    after = dataclasses.asdict(scenario)
    changed = [key for key in before if before[key] != after[key]]
    assert changed == [name.split(".")[0]]


def test_a_list_gets_the_value_in_every_entry(scenario):
    field = find_field("plant.friction.coulomb")
    field.set(scenario, 7.0)

    assert field.many and scenario.plant.friction.coulomb == [7.0, 7.0, 7.0]


def test_entry_alone_is_set(scenario):
    find_field("plant.friction.coulomb[2]").set(scenario, 7.0)
    assert scenario.plant.friction.coulomb == [1.0, 7.0, 4.0]


@pytest.mark.parametrize(
    ("name", "how", "expected"),
    [
        ("plant.friction.coulomb", "factor", [3.0, 6.0, 12.0]),
        ("plant.friction.coulomb", "offset", [4.0, 5.0, 7.0]),
        ("plant.friction.coulomb[2]", "factor", [1.0, 6.0, 4.0]),
        ("plant.friction.coulomb[2]", "offset", [1.0, 5.0, 4.0]),
    ],
)
def test_changes_lists_entry_by_entry(scenario, name, how, expected):
    find_field(name).change(scenario, how, 3.0)
    assert scenario.plant.friction.coulomb == expected


def test_changes_numbers(scenario):
    find_field("period").change(scenario, "factor", 2.0)
    find_field("disturbance.amplitude").change(scenario, "offset", 0.5)
    assert (scenario.period, scenario.disturbance.amplitude) == (0.01, 0.5)


def test_the_controller_is_a_field():
    assert find_field("controller").type is ControllerChoice


@pytest.mark.parametrize("name", field_names())
def test_every_listed_name_is_a_field(name):
    field = find_field(name)
    assert field.type in (float, int, bool, str)
    assert field.entry is None and ".".join(field.parts) == name


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("plant.friction.coulom", "no field of a scenario, did you mean plant.friction.coulomb"),
        ("controler.kp", "did you mean controller.kp"),
        ("controller.coulomb", "did you mean .*plant.friction.coulomb"),
        ("friction.coulomb[2]", "did you mean plant.friction.coulomb"),
        ("controller.kp.x", "no field of a scenario"),
        ("controller.kp[1].x", "no field of a scenario"),
        ("controller..kp", "no field of a scenario"),
        ("controller.kp[x]", "no field of a scenario, did you mean controller.kp"),
        ("zzz", "no field of a scenario, expected one of name, robot, "),
        ("", "no field of a scenario, expected one of name, robot, "),
        ("plant.friction", "a part, not a field, expected one of plant.friction.coulomb, "),
        ("disturbance", "expected one of disturbance.amplitude, disturbance.omega_d"),
        ("period[1]", "is no entry of a list"),
        ("controller.kp[0]", "no entry of a list, counted from 1"),
        ("controller.kp[00]", "no entry of a list, counted from 1"),
        (f"controller.kp[{'9' * 5000}]", "no field of a scenario, did you mean controller.kp"),
    ],
)
def test_unknown_names(name, message):
    with pytest.raises(InputError, match=message):
        find_field(name)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("plant.elasticity.natural_frequency", "no such list; add it there"),
        ("controller.kp", "no such list; add it there"),
        ("controller.kp[2]", "no such list; add it there"),
        ("plant.friction.coulomb[4]", r"has 3 value\(s\) there"),
    ],
)
def test_what_the_scenario_does_not_have(scenario, name, message):
    with pytest.raises(InputError, match=message) as raised:
        find_field(name).set(scenario, 1.0)
    assert str(raised.value).startswith(f"{name}: ")


@pytest.mark.parametrize("name", ["controller.kp", "controller.omega_r", "drive.torque_bandwidth"])
def test_nothing_to_change(scenario, name):
    with pytest.raises(InputError, match=f"{name}: .* no value for a factor; give it"):
        find_field(name).change(scenario, "factor", 2.0)
