"""Deviations of links in files as they are written, and edited robots."""

import re

import pytest

from sdt_drake.io.errors import InputError
from sdt_drake.robot.deviation import Deviation, deviated

BAD = [
    ({"payload_mass": -180, "inertia_scale": 2.0}, "payload_mass: -180 kg would leave 0 kg of"),
    ({"payload": "seat"}, "payload: no link 'seat', expected one of arm, roll_frame"),
    ({"link_scales": [1.1] * 4}, "link_scales: 4 value(s), expected 5, one for each of arm"),
]


@pytest.mark.parametrize("values, message", BAD)
def test_an_error_that_does_not_fit_the_robot_is_refused(robot, values, message):
    with pytest.raises(InputError, match="^" + re.escape(f"model.{message}")):
        deviated(robot, Deviation(**values), "model")
