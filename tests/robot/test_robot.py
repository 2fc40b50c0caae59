"""Loading of robots: the shipped device, any serial chain, and what is refused."""

import numpy as np
import pytest
from helpers.robots import ARM, URDF, loaded, refused

from sdt_drake.robot.motors import load_catalogue


def test_shipped_device_and_catalogue_have_published_motors(robot):
    assert (robot.name, robot.joint_names) == ("sdt", ("planetary", "roll", "pitch", "yaw"))
    peak, rotors, ratios = [203.2, 3950, 2150, 2150], [0.1291, 1.73, 0.531, 0.531], [67.2, 1, 1, 1]
    check(robot, {
        "effort_limit": [13655.04, 3950, 2150, 2150], "motor_torque_limit": peak,
        "gear_ratio": ratios, "rotor_inertia": rotors, "damping": np.zeros(4),
        "reflected_inertia": [67.2**2 * rotors[0], *rotors[1:]], "position_upper": [np.inf] * 4,
    })  # fmt: skip
    speeds = np.array([2000 / 67.2, 45, 60, 60]) * 2 * np.pi / 60
    np.testing.assert_allclose(robot.velocity_limit, speeds, rtol=2e-5)
    catalogue = load_catalogue()
    motors = [catalogue.motor(id_, "") for id_ in ("AC-203", "TM-3950", "TM-2150", "TM-2150")]
    for motor, *numbers in zip(motors, peak, rotors, ratios, strict=True):
        assert [motor.peak_torque, motor.rotor_inertia, motor.gear_ratio] == numbers
        assert "published" in motor.source
    n1 = np.array([motor.n1 / motor.gear_ratio for motor in motors])  # serves the speed limits
    np.testing.assert_allclose(n1, speeds, rtol=1e-4)


@pytest.mark.parametrize("many", ["1.79769e+308", "1e17", "9" * 5000])
def test_infinite_joint_limit_means_no_limit(many):
    assert loaded(SDF.replace("<velocity>3", f"<velocity>{many}")).velocity_limit[0] == np.inf
    refused(SDF, "<mass>4", f"<mass>{many}", "link 'upper': <mass> is '.*', expected a number")


LIMIT = (
    "<effort>4<!-- a --><![CDATA[0]]>&#32;</effort><drake:acceleration>2.5</drake:acceleration>"
    "<lower>-1e16</lower><upper>1e+16</upper>"  # so say many files: none
)
SDF = ARM.replace("<effort>40</effort>", LIMIT)


@pytest.mark.parametrize(
    "text, suffix, acceleration", [(SDF, ".sdf", 2.5), (URDF, ".urdf", np.inf)]
)
def test_file_values_reach_the_robot(text, suffix, acceleration):
    robot = loaded(text, suffix)
    assert (robot.name, robot.joint_names) == ("arm", ("shoulder", "elbow"))
    check(robot, {
        "effort_limit": [90, 40], "damping": [0.7, 0], "gear_ratio": [10, 1],
        "velocity_limit": [3, np.inf], "acceleration_limit": [np.inf, acceleration],
        "position_lower": [-2, -np.inf], "position_upper": [1, np.inf], "rotor_inertia": [0.01, 0],
    })  # fmt: skip


def check(robot, expected):
    for name, values in expected.items():
        np.testing.assert_allclose(getattr(robot, name), values, rtol=1e-12, err_msg=name)


# --- what is refused -------------------------------------------------------------------------

_UPPER, _LOWER = "link 'upper': ", "link 'lower': "
_SHOULDER, _ELBOW = "joint 'shoulder': ", "joint 'elbow': "
_MOMENTS = "<ixx>0.25</ixx><iyy>0.5</iyy><izz>0.6</izz>"
_LOWER_INERTIAL = ARM[ARM.rindex("<inertial>") : ARM.rindex("</link>")]
_THIRD_LINK = f'<link name="third"><pose relative_to="elbow"/>{_LOWER_INERTIAL}</link>'
_END = "</model>"
_ACCELERATION = "<drake:acceleration>2</drake:acceleration>"
_ELBOW_JOINT = ARM[ARM.index('<joint name="elbow"') : ARM.index(_END)]
_WRIST = _ELBOW_JOINT.replace('"elbow"', '"wrist"').replace("lower", "third")

BAD = [
    # Masses and inertias that Drake would fill in or replace.
    ("<izz>0.6", "<izz>0.77", _UPPER + r".*triangle inequality.* 0\.25 \+ 0\.5 < 0\.77"),
    (_MOMENTS, "<ixx>1</ixx><iyy>1</iyy><izz>3</izz>", _UPPER + ".*triangle inequality"),
    (_MOMENTS, "<ixx>0.3</ixx><iyy>0.2</iyy><izz>0.7</izz>", _UPPER + ".*triangle inequality"),
    ("<ixx>0.1<", "<ixy>0.3</ixy><ixx>0.1<", _LOWER + r".*principal moment -0\.154"),
    (_LOWER_INERTIAL, "", _LOWER + "no <mass>"),
    ("<mass>4", "<mass>0", _UPPER + "<inertia> without <mass>"),
    # Numbers that Drake would take up to some letter, or of which it would take the first.
    ("<effort>40", "<effort>4_0", _ELBOW + "<effort> is '4_0', expected a number"),
    ("<mass>4", "<mass>" + 10**6 * "4", _UPPER + r"<mass> is '4{40}\.\.\.'"),
    ("<pose>0.3 0", "<pose>0,3 0", _LOWER + "<pose> is '0,3 0 0 0 0 0', expected 6 or 7 numbers"),
    ("<mass>2</mass>", "<mass>2</mass><mass>3</mass>", _LOWER + "<mass> more than once"),
    # Names and versions.
    ("elbow", 10**5 * "e", r"<joint> has the name 'e{40}\.\.\.', expected 1 to 100"),
    ('"lower"', '"a&#10;b"', r"<link> has the name 'a\\nb', expected"),
    ('version="1.9"', 'version="one"', "<sdf version='one'>, expected"),
    # Joints.
    ("<damping>", "<friction>-2</friction><damping>", _SHOULDER + "<friction> -2, expected a nu"),
    ('elbow" type="revolute"', 'elbow" type="prismatic"', "joint 'elbow' is prismatic"),
    (_END, _THIRD_LINK + _WRIST + _END, "branches at joints 'elbow', 'wrist'"),
    (_END, _THIRD_LINK + _END, r"1 link\(s\) are not connected to the world"),
    ("revolute", "fixed", "no revolute joint"),
    # Forces that no torque group holds, and elements without effect.
    (_END, "<drake:linear_bushing_rpy/></model>", "<linear_bushing_rpy> in <model> is not supp"),
    # Motors.
    ("ratio>10", "ratio>0", _SHOULDER + "gear ratio 0"),
    ('<link name="lower">', '<link name="lower"><gravity>false</gravity>', "gravity: false"),
    (
        "<parent>upper",
        f"{_ACCELERATION}<parent>upper",
        "<acceleration> in <joint> is not sup",
    ),
    ("drake:rotor_inertia", "rotor_inertia", _SHOULDER + ".*did you mean 'drake:rotor_inertia'"),
    # Files.
    ("<sdf", "<!DOCTYPE sdf><sdf", "<!DOCTYPE> is not supported"),
    ("</model>", 1001 * "<frame name='a'/>" + "</model>", "more than 1000 links, joints and fr"),
    ("</sdf>", '<model name="two"/></sdf>', "2 models, expected one"),
    (_END, '<link name="upper"/></model>', "link 'upper' more than once"),
]


@pytest.mark.parametrize("old, new, message", BAD, ids=[case[-1] for case in BAD])
def test_bad_sdf_is_refused_with_file_place_and_number(old, new, message):
    refused(ARM, old, new, message)


def attributes(count):
    return " ".join(f'xmlns:x{k}=""' for k in range(count))


MANY = [
    (300_000 * "<a>", "more than 50 nested elements"),
    (100_000 * "<a/>", "more than 20000 elements"),
    (f"<a {attributes(51)}/>", "<a> has 51 attributes, expected at most 50"),
    (f"<visual {attributes(40_000)}/>", "has 40000 attributes"),
]


@pytest.mark.parametrize("text", [ARM, URDF], ids=["sdf", "urdf"])
@pytest.mark.parametrize("many, message", MANY, ids=[case[-1] for case in MANY])
def test_robot_with_too_many_parts_is_refused(text, many, message):
    """The time of its parser grows with the square of some of them."""
    end = "</link>"
    refused(text, end, many + end, message)
