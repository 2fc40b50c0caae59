"""Deviations of links in files as they are written, and edited robots."""

from __future__ import annotations

import re

import numpy as np
import pytest
from robots import ARM, loaded

from sdt_drake.io.errors import InputError
from sdt_drake.robot.deviation import Deviation, deviated
from sdt_drake.robot.robot import edited, load_robot, parts_of


def total_mass(robot) -> float:
    return robot.plant.CalcTotalMass(robot.plant.CreateDefaultContext())


def test_an_edit_reaches_the_plant_and_not_the_file_and_is_checked():
    arm = loaded(ARM.replace("http://drake", "drake"))  # the address does not matter

    def with_mass(value):
        def edit(root):
            root.find(".//link[2]/inertial/mass").text = value

        return edited(arm, edit)

    other = with_mass("7")
    assert total_mass(other) == 11 and other.rotor_inertia.tolist() == [0.01, 0]
    assert total_mass(load_robot(other.path)) == 6
    where = re.escape(f"{arm.path}")
    with pytest.raises(InputError, match=rf"^{where}: link 'lower': <mass> -7 kg, expected"):
        with_mass("-7")


@pytest.mark.parametrize(
    "pose, com",
    [
        ("", [0.1, 0.2, 0.3]),
        ('<pose rotation_format="quat_xyzw"/>', [0.1, 0.2, 0.3]),
        ('<pose degrees="true">\n 0.3 0 -1\n 0 0 90 </pose>', [0.4, 0.2, -0.7]),
        ('<pose rotation_format="quat_xyzw">0.3 0 -1 0 0 1 1</pose>', [0.4, 0.2, -0.7]),
    ],
)
def test_any_way_to_write_the_pose_of_the_payload_will_do(pose, com):
    arm = loaded(ARM.replace("<pose>0.3 0 0 0 0 0</pose>", pose))
    model = deviated(arm, Deviation("lower", payload_offset=[0.1, 0.2, 0.3]))
    _, moved, central = parts_of(model.plant.GetBodyByName("lower"))
    np.testing.assert_allclose(moved, com, atol=1e-15)
    # It is not turned by the offset: a pose of 90 deg about z swaps ixx and iyy, another does not.
    turned = " 90 " in pose or "1 1<" in pose
    moments = [0.2, 0.1, 0.25] if turned else [0.1, 0.2, 0.25]
    np.testing.assert_allclose(central, np.diag(moments), atol=1e-12)


def test_a_link_without_mass_gets_none():
    start, end = ARM.index("<mass>"), ARM.index("</inertial>")
    zero = "<mass>0</mass><inertia><ixx>0</ixx><iyy>0</iyy><izz>0</izz></inertia>"
    robot = loaded(ARM[:start] + zero + ARM[end:])
    assert total_mass(deviated(robot, Deviation(inertia_scale=1.5))) == 3.0
    with pytest.raises(InputError, match="payload_mass: link 'upper' has no mass to scale"):
        deviated(robot, Deviation("upper", payload_mass=1.0))


def test_without_errors_the_model_is_the_robot_itself(robot):
    assert Deviation().exact and deviated(robot, Deviation()) is robot
    assert deviated(robot, Deviation(payload="gondola")) is robot
    some = {"payload_mass": 1e-9, "payload_offset": [0, 0, 1e-9], "inertia_scale": 1 + 1e-9}
    for name, value in some.items():
        errors = Deviation(**{name: value})
        assert not errors.exact and deviated(robot, errors) is not robot


def test_errors_of_a_model_of_a_model_add_up(robot):
    once = deviated(robot, Deviation(inertia_scale=2, payload_mass=10))
    twice = deviated(once, Deviation(payload_mass=5))
    assert total_mass(once) == pytest.approx(2 * (total_mass(robot) + 10), rel=1e-12)
    assert total_mass(twice) == pytest.approx(total_mass(once) + 5, rel=1e-12)


@pytest.mark.parametrize(
    "values, message",
    [
        ({"payload_mass": -180, "inertia_scale": 2.0}, "payload_mass: -180 kg would leave 0 kg of"),
        ({"payload": "seat"}, "payload: no link 'seat', expected one of arm, roll_frame"),
        ({"link_scales": [1.1] * 4}, "link_scales: 4 value(s), expected 5, one for each of arm"),
    ],
)
def test_an_error_that_does_not_fit_the_robot_is_refused(robot, values, message):
    with pytest.raises(InputError, match="^" + re.escape(f"model.{message}")):
        deviated(robot, Deviation(**values), "model")
