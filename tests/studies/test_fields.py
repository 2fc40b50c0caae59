"""Fields of a scenario by their dotted names."""

from __future__ import annotations

import dataclasses
import re

import pytest

from sdt_drake.io.errors import InputError
from sdt_drake.robot.device import Friction
from sdt_drake.robot.motors import DeviceChoice
from sdt_drake.run.scenario import ControllerChoice, Scenario, load_scenario
from sdt_drake.studies.fields import find_field
from sdt_drake.studies.study import load_study


@pytest.fixture
def scenario() -> Scenario:
    """With a friction and a device."""
    scenario = Scenario(device=DeviceChoice(motors=["a", "b"]))
    scenario.plant.friction = Friction(coulomb=[1.0, 2.0, 4.0])
    return scenario


@pytest.mark.parametrize(
    ("name", "kind", "value", "expected"),
    [
        ("period", float, 0.01, 0.01),
        ("algorithm", str, "printed", "printed"),
        ("controller.anti_windup", bool, True, True),
        ("controller.model.payload_mass", float, 3.0, 3.0),
        ("plant.friction.coulomb[3]", float, 9.0, [1, 2, 9]),
        ("plant.friction.coulomb", float, 7.0, [7, 7, 7]),
        ("device.motors[2]", str, "c", ["a", "c"]),
        ("plant.deviation.payload_offset[1]", float, 0.1, [0.1, 0, 0]),
    ],
)
def test_sets_what_it_gets_and_nothing_else(scenario, name, kind, value, expected):
    field = find_field(name)
    before = dataclasses.asdict(scenario)
    field.put(scenario, value)
    assert field.type is kind and field.get(scenario) == expected
    after = dataclasses.asdict(scenario)
    changed = [key for key in before if before[key] != after[key]]
    assert changed == [name.split(".")[0]]


@pytest.mark.parametrize(
    ("name", "how", "expected"),
    [
        ("plant.friction.coulomb", "factor", [3.0, 6.0, 12.0]),
        ("plant.friction.coulomb", "offset", [4.0, 5.0, 7.0]),
        ("plant.friction.coulomb[2]", "factor", [1.0, 6.0, 4.0]),
        ("plant.friction.coulomb[2]", "offset", [1.0, 5.0, 4.0]),
        ("period", "factor", 0.015),
        ("disturbance.amplitude", "offset", 3.0),
    ],
)
def test_changes_entry_by_entry(scenario, name, how, expected):
    field = find_field(name)
    field.put(scenario, 3.0, how)
    assert field.get(scenario) == pytest.approx(expected)


def test_the_label_of_a_controller_changes_two_fields():
    field = find_field("controller")
    assert field.type is ControllerChoice
    assert [x.name for x in field.touched] == ["controller.kind", "controller.feedforward"]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        (
            "plant.friction.coulom",
            "not a field of a scenario, did you mean 'plant.friction.coulomb'",
        ),
        ("controller.coulomb", "(mean|one of) .?plant.friction.coulomb"),
        ("friction.coulomb[2]", "did you mean 'plant.friction.coulomb'"),
        ("controller.kp.x", "not a field of a scenario"),
        ("controller.kp[1].x", "not a field of a scenario"),
        ("controller..kp", "not a field of a scenario"),
        ("controller.kp[x]", "not a field of a scenario, did you mean 'controller.kp'"),
        ("controller.kp[0]", "not a field of a scenario, did you mean 'controller.kp'"),
        (f"controller.kp[{'9' * 5000}]", "not a field of a scenario, did you mean 'controller.kp'"),
        ("zzz", "not a field of a scenario, expected one of name, robot, "),
        ("plant.friction", "a group of fields, expected one of plant.friction.coulomb, "),
        ("period[1]", "period is not a list"),
    ],
)
def test_unknown_names(name, message):
    with pytest.raises(InputError, match=message):
        find_field(name)


@pytest.mark.parametrize(
    ("name", "how", "message"),
    [
        ("controller.kp", "value", "empty in the base scenario; add"),
        ("controller.kp[2]", "factor", "empty in the base scenario; add"),
        ("plant.friction.coulomb[4]", "value", r"list has 3 value\(s\), expected"),
        ("controller.omega_r", "factor", "to apply a factor to; add"),
        ("drive.torque_bandwidth", "offset", "to apply a offset to; add"),
    ],
)
def test_what_the_scenario_does_not_have(scenario, name, how, message):
    with pytest.raises(InputError, match=message) as raised:
        find_field(name).put(scenario, 1.0, how)
    assert str(raised.value).startswith(f"{name}: ")


@pytest.mark.parametrize(
    ("change", "is_lost"),
    [
        ("controller.kind", True),
        ("controller.omega_ratio", False),
        ("plant.friction.coulomb[2]", False),  # which a factor scales
        ("plant.deviation.payload_mass", True),
        ("plant.deviation.link_scales[1]", True),
        ("plant.deviation.link_scales", False),
        ("accuracy", True),
    ],
)
def test_changes_that_a_study_would_overwrite_are_refused(change, is_lost):
    changes = {
        "controller.kind": "p_pi",
        "controller.omega_ratio": 0.4,
        "plant.friction.coulomb[2]": 3,
        "plant.deviation.link_scales": [1, 1, 1, 1],
    }
    one = {change: changes.get(change, 1)}
    if not is_lost:
        assert load_study("monte_carlo", one)[1] == load_scenario("uncertain", one)
        return
    with pytest.raises(InputError, match=rf"^{re.escape(change)}: .*monte_carlo.yaml sets"):
        load_study("monte_carlo", one)
