"""Deviations of links in files as they are written, and edited robots."""

import re

import numpy as np
import pytest
from robots import ARM, loaded

from sdt_drake.io.errors import InputError
from sdt_drake.robot.deviation import Deviation, deviated
from sdt_drake.robot.robot import edited, load_robot, parts_of


def test_an_edit_reaches_the_plant_and_not_the_file_and_is_checked():
    arm = loaded(ARM.replace("http://drake", "drake"))  # the address does not matter

    def with_mass(value):
        def edit(root):
            root.find(".//link[2]/inertial/mass").text = value

        return edited(arm, edit).plant.GetBodyByName("lower").default_mass()

    assert with_mass("7") == 7
    assert load_robot(arm.path).plant.GetBodyByName("lower").default_mass() == 2
    where = re.escape(f"{arm.path}")
    with pytest.raises(InputError, match=rf"^{where}: link 'lower': <mass> -7 kg, expected"):
        with_mass("-7")


POSES = [
    ('<pose rotation_format="quat_xyzw"/>', [0.1, 0.2, 0.3], [0.1, 0.2, 0.25]),
    ('<pose degrees="true">\n .3 0 -1\n 0 0 90 </pose>', [0.4, 0.2, -0.7], [0.2, 0.1, 0.25]),
]


@pytest.mark.parametrize("pose, com, moments", POSES)
def test_any_way_to_write_the_pose_of_the_payload_will_do(pose, com, moments):
    """The offset does not turn the inertia."""
    arm = loaded(ARM.replace("<pose>0.3 0 0 0 0 0</pose>", pose))
    model = deviated(arm, Deviation("lower", payload_offset=[0.1, 0.2, 0.3]))
    _, moved, central = parts_of(model.plant.GetBodyByName("lower"))
    np.testing.assert_allclose(moved, com, atol=1e-15)
    np.testing.assert_allclose(central, np.diag(moments), atol=1e-12)


def test_without_errors_the_model_is_the_robot_itself(robot):
    assert deviated(robot, Deviation()) is robot
    assert deviated(robot, Deviation(payload="gondola")) is robot
    some = {"payload_mass": 1e-9, "payload_offset": [0, 0, 1e-9], "inertia_scale": 1 + 1e-9}
    for name, value in some.items():
        assert deviated(robot, Deviation(**{name: value})) is not robot


BAD = [
    ({"payload_mass": -180, "inertia_scale": 2.0}, "payload_mass: -180 kg would leave 0 kg of"),
    ({"payload": "seat"}, "payload: no link 'seat', expected one of arm, roll_frame"),
    ({"link_scales": [1.1] * 4}, "link_scales: 4 value(s), expected 5, one for each of arm"),
]


@pytest.mark.parametrize("values, message", BAD)
def test_an_error_that_does_not_fit_the_robot_is_refused(robot, values, message):
    with pytest.raises(InputError, match="^" + re.escape(f"model.{message}")):
        deviated(robot, Deviation(**values), "model")
