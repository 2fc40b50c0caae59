"""Deviations of links in files as they are written, and edited robots."""

import re

import numpy as np
import pytest
from helpers.robots import ARM, loaded

from sdt_drake.io.errors import InputError
from sdt_drake.robot.deviation import Deviation, deviated
from sdt_drake.robot.parsed import parts_of
from sdt_drake.robot.sdf import SYMMETRIC

BAD = [
    ({"payload_mass": -180, "inertia_scale": 2.0}, "payload_mass: -180 kg would leave 0 kg of"),
    ({"payload": "seat"}, "payload: no link 'seat', expected one of arm, roll_frame"),
    ({"link_scales": [1.1] * 4}, "link_scales: 4 value(s), expected 5, one for each of arm"),
]


@pytest.mark.parametrize("values, message", BAD)
def test_deviation_that_does_not_fit_the_robot_is_refused(robot, values, message):
    with pytest.raises(InputError, match="^" + re.escape(f"model.{message}")):
        deviated(robot, Deviation(**values), "model")


def along_file(tmp_path, rows, **values):
    np.savetxt(path := tmp_path / "spread.csv", rows, delimiter=",", header="k" + 20 * ",s")
    return Deviation(spread=str(path), **values)


@pytest.mark.parametrize("along", [0.3, -0.5])
def test_link_along_a_direction_of_its_pseudo_inertia_scales_and_others_stay(tmp_path, along):
    """S = s I makes exp(s) P of P: of mass and inertia, not of the centre of mass."""
    robot, rows = loaded(ARM), np.zeros((1, 21))
    rows[0, [11 + SYMMETRIC.index((i, i)) for i in range(4)]] = 1  # of the second link
    other = deviated(robot, along_file(tmp_path, rows, along=[along]))
    for link, factor in ("upper", 1), ("lower", np.exp(along)):
        before, after = (parts_of(r.plant.GetBodyByName(link)) for r in (robot, other))
        expected = [factor * before[0], before[1], factor * before[2]]
        for found, right in zip(after, expected, strict=True):
            np.testing.assert_allclose(found, right, rtol=1e-12 * (factor != 1), atol=1e-15)


def test_link_along_a_direction_without_zeros_changes(tmp_path):
    rows = np.zeros((1, 21))
    rows[0, 11:] = 0.01
    other = deviated(loaded(ARM), along_file(tmp_path, rows, along=[1.0]))
    assert other.plant.GetBodyByName("lower").default_mass() > 2.01


@pytest.mark.parametrize("rows", [np.zeros((1, 12)), np.full((1, 21), np.inf)])
def test_directions_that_do_not_fit_the_links_are_refused(tmp_path, rows):
    with pytest.raises(InputError, match=r"spread\.csv"):
        deviated(loaded(ARM), along_file(tmp_path, rows, along=[1.0]))


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
