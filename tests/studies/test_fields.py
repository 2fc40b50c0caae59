"""Fields of a scenario by their dotted names."""

from __future__ import annotations

import dataclasses

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
        ("controller.anti_windup", "value", True, True),
        ("plant.friction.coulomb[3]", "value", 9.0, [1, 2, 9]),
        ("plant.friction.coulomb", "value", 7.0, [7, 7, 7]),
        ("plant.friction.coulomb", "factor", 3.0, [3, 6, 12]),
        ("plant.friction.coulomb[2]", "offset", 3.0, [1, 5, 4]),
        ("device.motors[2]", "value", "c", ["a", "c"]),
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
    ("name", "message"),
    [
        ("controller.coulomb", "(mean|one of) .?plant.friction.coulomb"),
        ("controller.kp[0]", "not a field of a scenario, did you mean 'controller.kp'"),
        ("zzz", "not a field of a scenario, expected one of name, robot, "),
        ("plant.friction", "a group of fields, expected one of plant.friction.coulomb, "),
        ("period[1]", "period is not a list"),
        ("controller.kp[2]", "empty in the base scenario; add"),
        ("plant.friction.coulomb[4]", r"list has 3 value\(s\), expected"),
        ("controller.omega_r", "to apply a factor to; add"),
    ],
)
def test_a_field_that_cannot_be_scaled_is_refused(scenario, name, message):
    with pytest.raises(InputError, match=message):
        find_field(name).put(scenario, 1.0, "factor")


def test_a_change_is_refused_where_the_study_would_overwrite_it():
    for kept in ({"controller.omega_ratio": 0.4}, {"plant.friction.coulomb[2]": 3}):  # it scales
        assert load_study("monte_carlo", kept)[1] == load_scenario("uncertain", kept)
    for lost in ("controller.kind", "plant.deviation.payload_mass", "accuracy"):
        with pytest.raises(InputError, match=rf"^{lost}: .*monte_carlo.yaml sets"):
            load_study("monte_carlo", {lost: 1})
