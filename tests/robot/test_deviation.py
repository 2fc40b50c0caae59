"""Deviations of links in files as they are written, and edited robots."""

import re

import numpy as np
import pytest
from helpers.robots import ARM, loaded

from sdt_drake.io.errors import InputError
from sdt_drake.robot.deviation import Deviation, deviated
from sdt_drake.robot.parsed import parts_of

BAD = [
    ({"payload_mass": -180, "inertia_scale": 2.0}, "payload_mass: -180 kg would leave 0 kg of"),
    ({"payload": "seat"}, "payload: no link 'seat', expected one of arm, roll_frame"),
    ({"link_scales": [1.1] * 4}, "link_scales: 4 value(s), expected 5, one for each of arm"),
]


@pytest.mark.parametrize("values, message", BAD)
def test_deviation_that_does_not_fit_the_robot_is_refused(robot, values, message):
    with pytest.raises(InputError, match="^" + re.escape(f"model.{message}")):
        deviated(robot, Deviation(**values), "model")


POSES = [
    ("", [0.1, 0.2, 0.3], False),
    ('<pose rotation_format="quat_xyzw"/>', [0.1, 0.2, 0.3], False),
    ('<pose degrees="true">\n 0.3 0 -1\n 0 0 90 </pose>', [0.4, 0.2, -0.7], True),
    ('<pose rotation_format="quat_xyzw">0.3 0 -1 0 0 1 1</pose>', [0.4, 0.2, -0.7], True),
]
"""Poses of a centre of mass, where it is after a shift, and whether it is turned by 90 deg."""


@pytest.mark.parametrize("pose, com, turned", POSES)
def test_payload_is_shifted_from_any_pose_and_not_turned(pose, com, turned):
    arm = loaded(ARM.replace("<pose>0.3 0 0 0 0 0</pose>", pose))
    moved = deviated(arm, Deviation("lower", payload_offset=[0.1, 0.2, 0.3]))
    _, where, central = parts_of(moved.plant.GetBodyByName("lower"))
    np.testing.assert_allclose(where, com, atol=1e-15)
    moments = [0.2, 0.1, 0.25] if turned else [0.1, 0.2, 0.25]
    np.testing.assert_allclose(central, np.diag(moments), atol=1e-12)


def test_scaling_a_massless_link_is_refused():
    none = "<mass>0</mass><inertia><ixx>0</ixx><iyy>0</iyy><izz>0</izz></inertia>"
    robot = loaded(ARM[: ARM.index("<mass>")] + none + ARM[ARM.index("</inertial>") :])
    with pytest.raises(InputError, match="payload_mass: link 'upper' has no mass to scale"):
        deviated(robot, Deviation("upper", payload_mass=1.0))
