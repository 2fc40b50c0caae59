"""Loading of robots: the shipped device, any serial chain, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from robots import ARM, loaded

from sdt_drake.io.errors import InputError
from sdt_drake.robot.robot import load_robot

# --- the shipped device ----------------------------------------------------------------------


def test_shipped_motors_and_limits_are_the_published_ones(robot):
    assert (robot.name, robot.n) == ("sdt", 4)
    assert robot.joint_names == ("planetary", "roll", "pitch", "yaw")
    rpm, rotors = 2 * np.pi / 60, [0.1291, 1.73, 0.531, 0.531]
    for name, published in (
        ("effort_limit", [13655.04, 3950, 2150, 2150]),
        ("motor_torque_limit", [203.2, 3950, 2150, 2150]),
        ("gear_ratio", [67.2, 1, 1, 1]),
        ("rotor_inertia", rotors),
        ("reflected_inertia", [67.2**2 * rotors[0], *rotors[1:]]),
        ("position_lower", [-np.inf] * 4),
        ("position_upper", [np.inf] * 4),
        ("damping", np.zeros(4)),
    ):
        np.testing.assert_allclose(getattr(robot, name), published, rtol=1e-12, err_msg=name)
    published = [2000 / 67.2 * rpm, 45 * rpm, 60 * rpm, 60 * rpm]
    np.testing.assert_allclose(robot.velocity_limit, published, rtol=2e-5)
    np.testing.assert_allclose(robot.plant.gravity_field().gravity_vector(), [0, 0, -9.81])


@pytest.mark.parametrize(
    "links, mass, com, moments",
    [
        (["arm"], 5600, [0.4, 0, 0], [1500, 8000, 9067.5]),
        (["roll_frame"], 300, [0, 0, -0.18373], [95, 9, 95]),
        (["pitch_frame"], 340, [0, 0, -0.18373], [533.8, 9, 535.8]),
        (["gondola", "payload"], 370, [0, 0, -0.18373], [238, 13, 249.749]),
    ],
)
def test_shipped_links_have_the_calibrated_inertia(robot, links, mass, com, moments):
    plant = robot.plant
    bodies = [plant.GetBodyByName(name) for name in links]
    context, frame = plant.CreateDefaultContext(), bodies[0].body_frame()
    total = plant.CalcSpatialInertia(context, frame, [body.index() for body in bodies])
    assert total.get_mass() == pytest.approx(mass, rel=1e-12)
    np.testing.assert_allclose(total.get_com(), com, atol=1e-12)
    central = total.Shift(total.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
    np.testing.assert_allclose(central, np.diag(moments), atol=1e-9)


def test_plant_passes_any_torque_on_and_is_copied(robot):
    assert robot.make_plant() is not robot.plant
    plant, context = robot.plant, robot.plant.CreateDefaultContext()
    torque = 50 * robot.effort_limit
    plant.get_actuation_input_port().FixValue(context, torque)
    np.testing.assert_array_equal(plant.get_net_actuation_output_port().Eval(context), torque)


def test_values_of_an_sdf_reach_the_robot():
    limit = "<effort>4<!-- a --><![CDATA[0]]>&#32;</effort>"
    limit += "<drake:acceleration>2.5</drake:acceleration>"
    limit += "<lower>-1e16</lower><upper>1e+16</upper>"  # so say many files: none
    robot = loaded(ARM.replace("<effort>40</effort>", limit))
    assert (robot.name, robot.joint_names) == ("arm", ("shoulder", "elbow"))
    for name, value in (
        ("effort_limit", [90, 40]),
        ("velocity_limit", [3, np.inf]),
        ("acceleration_limit", [np.inf, 2.5]),
        ("position_lower", [-2, -np.inf]),
        ("position_upper", [1, np.inf]),
        ("damping", [0.7, 0]),
        ("gear_ratio", [10, 1]),
        ("rotor_inertia", [0.01, 0]),
    ):
        np.testing.assert_array_equal(getattr(robot, name), value, err_msg=name)


# --- what is refused -------------------------------------------------------------------------

_UPPER, _LOWER = r"link 'upper': ", r"link 'lower': "
_SHOULDER, _ELBOW = r"joint 'shoulder': ", r"joint 'elbow': "
_ELBOW_LIMIT = "<limit><effort>40</effort></limit>"
_LOWER_INERTIAL = ARM[ARM.rindex("<inertial>") : ARM.rindex("</link>")]
_THIRD_LINK = f'<link name="third"><pose relative_to="elbow"/>{_LOWER_INERTIAL}</link>'
_END = "</model>"
_ELBOW_JOINT = ARM[ARM.index('<joint name="elbow"') : ARM.index(_END)]
_WRIST = _ELBOW_JOINT.replace('"elbow"', '"wrist"').replace("lower", "third")

BAD = [
    # Masses and inertias that Drake would fill in or replace.
    ("<izz>0.6", "<izz>0.77", _UPPER + r".*triangle inequality.* 0\.25 \+ 0\.5 < 0\.77"),
    ("<ixx>0.1<", "<ixy>0.3</ixy><ixx>0.1<", _LOWER + r".*principal moment -0\.154"),
    (_LOWER_INERTIAL, "", _LOWER + "no <mass>"),
    ("<mass>4", "<mass>0", _UPPER + "<inertia> without <mass>"),
    # Numbers that Drake would take up to some letter, or of which it would take the first.
    ("<effort>40", "<effort>4_0", _ELBOW + "<effort> is '4_0', expected a number"),
    ("<effort>40", "<effort>" + 10**6 * "4", _ELBOW + r"<effort> is '4{40}\.\.\.'"),
    ("<pose>0.3 0", "<pose>0,3 0", _LOWER + "<pose> is '0,3 0 0 0 0 0', expected 6 or 7 numbers"),
    ("<mass>2</mass>", "<mass>2</mass><mass>3</mass>", _LOWER + "<mass> more than once"),
    ("<axis><xyz>", "<axis><drake:gear_ratio>2</drake:gear_ratio><xyz>", "<gear_ratio> in <axis>"),
    # Names.
    ("elbow", 10**5 * "e", r"<joint> has the name 'e{40}\.\.\.', expected 1 to 100"),
    ('"lower"', '"a&#10;b"', r"<link> has the name 'a\\nb', expected"),
    # Versions.
    ('version="1.9"', 'version="one"', "<sdf version='one'>, expected"),
    # Joints.
    ("<damping>", "<friction>0.2</friction><damping>", _SHOULDER + "<friction> 0.2"),
    ("<velocity>3", "<velocity>0", _SHOULDER + "<velocity> 0, expected a number > 0"),
    ('elbow" type="revolute"', 'elbow" type="prismatic"', "joint 'elbow' is prismatic"),
    (_END, _THIRD_LINK + _WRIST + _END, "branches at joints 'elbow', 'wrist'"),
    (_END, _THIRD_LINK + _END, r"1 link\(s\) are not connected to the world"),
    ("revolute", "fixed", "no revolute joint"),
    # Forces that no torque group holds, and elements without effect.
    (_END, "<drake:linear_bushing_rpy/></model>", "<linear_bushing_rpy> in <model> is not supp"),
    # Motors.
    (_ELBOW_LIMIT, "", _ELBOW + "actuator effort limit inf N m, expected a finite <effort> > 0"),
    ("ratio>10", "ratio>0", _SHOULDER + "gear ratio 0"),
    ('<link name="lower">', '<link name="lower"><gravity>false</gravity>', "gravity: false"),
    ("drake:rotor_inertia", "rotor_inertia", _SHOULDER + ".*did you mean 'drake:rotor_inertia'"),
    # Files.
    (ARM, "robot", "not well-formed XML"),
    ("<sdf", "<!DOCTYPE sdf><sdf", "<!DOCTYPE> is not supported"),
    ("<mass>2", 100 * "<a>" + 100 * "</a>" + "<mass>2", "more than 50 nested elements"),
    ("</sdf>", '<model name="two"/></sdf>', "2 models, expected one"),
    (_END, '<link name="upper"/></model>', "link 'upper' more than once"),
]


def refuse(text: str, message: str) -> None:
    assert text != ARM
    with pytest.raises(InputError, match=rf"^/.*\.sdf: .*{message}") as error:
        loaded(text)
    assert "\n" not in str(error.value) and len(str(error.value)) < 600


@pytest.mark.parametrize("old, new, message", BAD, ids=[case[-1] for case in BAD])
def test_a_bad_sdf_is_refused_with_file_place_and_number(old, new, message):
    refuse(ARM.replace(old, new), message)


def test_a_link_without_mass_is_accepted_with_a_note_where_others_have_some(caplog):
    none = "<mass>0</mass><inertia><ixx>0</ixx><iyy>0</iyy><izz>0</izz></inertia></inertial>"
    start, end = ARM.index("<mass>"), ARM.index("</inertial>") + len("</inertial>")
    text = ARM[:start] + none + ARM[end:]
    robot = loaded(text.replace('name="arm"', 'name="own"'))  # each is told once
    (told,) = (record.getMessage() for record in caplog.records)
    assert told == f"{robot.path}: accepted without mass: upper"
    # Link 2 alone, at 0.3 m from the elbow and 1.1 m from the shoulder, and the rotor.
    M = robot.plant.CalcMassMatrix(robot.plant.CreateDefaultContext())
    elbow = 0.2 + 2 * 0.3**2
    np.testing.assert_allclose(M, [[0.2 + 2 * 1.1**2 + 1, 0.2 + 2 * 0.3 * 1.1], [M[0, 1], elbow]])
    text = ARM.replace(_LOWER_INERTIAL, f"<inertial>{none}")
    refuse(text, _ELBOW + r"inertia about its axis 0 kg m².* 'shoulder' is 2\.5 kg")


def test_a_file_that_is_no_robot_is_refused(tmp_path):
    (tmp_path / "binary.sdf").write_bytes(b"\xff\xfe\x00\x01")
    for reference, message in (
        ("nowhere.sdf", r"^nowhere\.sdf: no such file"),
        ("package://sdt/motions/reference.yaml", r"reference\.yaml: expected an \.sdf or \.urdf"),
        (tmp_path / "binary.sdf", r"binary\.sdf: not well-formed XML"),
    ):
        with pytest.raises(InputError, match=message):
            load_robot(reference)
