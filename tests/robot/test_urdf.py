"""What a URDF cannot say is refused, what has no meaning in it is left out."""

import numpy as np
import pytest
from helpers.robots import ARM, RATE_TABLE, URDF, loaded, refused
from pydrake.math import RollPitchYaw

from sdt_drake.robot.deviation import Deviation, deviated

_SHOULDER, _ELBOW, _LOWER = "joint 'shoulder'.*", "joint 'elbow'.*", "link 'lower': "
_LOWER_BODY = URDF[URDF.rindex("<inertial>") : URDF.rindex("</link>")]
_BASE, _END = '<link name="base"/>', "</robot>"
_WORLD = f'{_BASE}<link name="world">{_LOWER_BODY}</link><joint name="w" type="fixed">'
_WORLD += '<parent link="world"/><child link="base"/></joint>'
_SECOND = URDF[URDF.index("<transmission") : URDF.index("<gazebo")].replace("drive", "second")

# A row for each refusal of the conversion, in the order of its file.
BAD = [
    (_BASE, _BASE + '<link name="b"/>', "2 links that no joint carries, expected one"),
    (_BASE, _WORLD, "link 'world': <inertial> would have no effect; remove it"),
    ('<joint name="shoulder"><', '<joint name="knee"><', "joint 'knee', which is not there"),
    ("rotor_inertia", "rotor_intertia", "actuator 'motor': <drake:rotor_intertia> in <actuator>"),
    ("<dynamics", '<mimic joint="elbow"/><dynamics', "'shoulder' follows 'elbow' by <mimic>, exp"),
    ("robot", "machine", "<machine> is not <robot>"),
    ('xyz="0.3 0 0"', 'xyz="0.3 0 0" quat="1 0 0 0"', _LOWER + "quat of <origin> is not support"),
    ("<dynamics", '<dynamics damping="1"/><dynamics', _SHOULDER + "<dynamics> more than once in"),
    ("SimpleTrans", "FourBarTrans", "transmission 'drive': type 'transmission_interface/FourBar"),
    ("SimpleTrans", "DifferentialTrans", "'drive': expected 2 joint, 2 actuator"),
    ("<actuator ", '<actuator name="a"/><actuator ', "'drive': expected one joint, one actuator"),
    (_END, _SECOND + _END, "transmission 'second': expected no other on shoulder"),
    ('<parent link="upper"/>', '<parent link="uper"/>', _ELBOW + "parent link 'uper' is not there"),
    ('"continuous"', '"prismatic"', "joint 'elbow' is prismatic, expected revolute or continuous"),
    ('<limit effort="40"/>', '<limit effort="40" lower="1"/>', _ELBOW + "lower and upper, or type"),
    ('lower="-2" ', "", _SHOULDER + "lower and upper, or type continuous and neither"),
    ('xyz="0.8 0 0"', 'xyz="0.8 0"', _ELBOW + "xyz or rpy is '0.8 0', expected 3 numbers"),
]  # fmt: skip


@pytest.mark.parametrize("old, new, message", BAD, ids=[case[-1] for case in BAD])
def test_bad_urdf_is_refused_with_file_and_place(old, new, message):
    refused(URDF, old, new, message)


def test_world_need_not_be_declared():
    table = loaded(RATE_TABLE.replace('<link name="world"/>', ""), ".urdf")
    assert table.joint_names == loaded(RATE_TABLE, ".urdf").joint_names


def test_unknown_urdf_attributes_are_ignored_and_told():
    text = URDF.replace('<limit effort="40"/>', '<limit effort="40" lower="-6.28" upper="6.28"/>')
    text = text.replace("<dynamics ", '<dynamics D="1" K="7000" mu_coulomb="0" mu_viscous="16" ')
    at = '<joint name="shoulder"><hardware'
    robot = loaded(text.replace(at, at.replace("><", "><offset>1.57</offset><")), ".urdf")
    assert robot.accepted == (
        "joint 'shoulder': D of <dynamics>, K of <dynamics>, mu_coulomb of <dynamics> and "
        "mu_viscous of <dynamics> have no meaning in URDF and were ignored",
        "joint 'elbow': lower of <limit> and upper of <limit> have no meaning in URDF and were "
        "ignored",
        "transmission 'drive': <offset> 1.57 is ignored: the zero position of a motor has no "
        "effect",
    )
    assert np.isinf(robot.position_upper[1]) and robot.position_upper[0] == 1
    np.testing.assert_array_equal(robot.damping, [0.7, 0])
    np.testing.assert_array_equal(robot.gear_ratio, [10, 1])
    plain = loaded(text.replace(at, at.replace("><", "><offset>0.0</offset><")), ".urdf")
    assert plain.accepted == robot.accepted[:2]  # a zero tells nothing


def test_frame_may_stand_on_a_massless_link():
    """1 m along the lower link, which is 0.8 m along the upper one, and 2 m across."""
    more = (
        "<link name='tool'/><joint name='flange' type='fixed'><parent link='lower'/>"
        "<child link='tool'/><origin xyz='1 0 0'/></joint>"
        "<frame name='head' link='tool' xyz='0 2 0' rpy='0 0 1'/></robot>"
    )
    plant = loaded(URDF.replace("</robot>", more), ".urdf").plant
    X = plant.GetFrameByName("head").CalcPoseInWorld(plant.CreateDefaultContext())
    np.testing.assert_allclose(X.translation(), [1.8, 2, 0], atol=1e-15)
    np.testing.assert_allclose(RollPitchYaw(X.rotation()).vector(), [0, 0, 1], atol=1e-15)


def test_massless_link_leaves_the_mass_matrix_of_the_others():
    """Link 2 alone, at 0.3 m from the elbow and 1.1 m from the shoulder, and the rotor."""
    none = "<mass>0</mass><inertia><ixx>0</ixx><iyy>0</iyy><izz>0</izz></inertia>"
    robot = loaded(ARM[: ARM.index("<mass>")] + none + ARM[ARM.index("</inertial>") :])
    assert robot.accepted == ("accepted without mass: upper",)
    M = robot.plant.CalcMassMatrix(robot.plant.CreateDefaultContext())
    beside = 0.2 + 2 * 0.3 * 1.1
    expected = [[0.2 + 2 * 1.1**2 + 10**2 * 0.01, beside], [beside, 0.2 + 2 * 0.3**2]]
    np.testing.assert_allclose(M, expected)
    plant = deviated(robot, Deviation(inertia_scale=1.5)).plant
    assert plant.CalcTotalMass(plant.CreateDefaultContext()) == 1.5 * 2
    elbow = r"joint 'elbow': inertia about its axis 0 kg m².* 'shoulder' is 2\.5 kg"
    lower = ARM[ARM.rindex("<mass>") : ARM.rindex("</inertial>")]
    refused(ARM, lower, none, elbow)


def test_sign_of_a_reduction_and_a_missing_name_are_no_problem():
    robot = loaded(URDF.replace(">10<", ">-10<").replace(' name="arm"', ""), ".urdf")
    assert robot.name == robot.path.stem and robot.gear_ratio[0] == 10
    assert robot.accepted == (
        "transmission 'drive': the sign of <mechanicalReduction> -10 is ignored: motors turn with "
        "their joints here",
    )


def test_differential_with_a_held_joint_drives_the_other_alone():
    """ROS: motor 1 turns 2 (3 v_1 + 5 v_2), of which v_2 is 0."""
    part = '<{0} name="{1}"><mechanicalReduction>{2}</mechanicalReduction></{0}>'
    parts = [("joint", "shoulder", 3), ("joint", "elbow", 5), ("actuator", "a", 2)]
    inner = "".join(part.format(*each) for each in (*parts, ("actuator", "b", 7)))
    kind = "<type>transmission_interface/DifferentialTransmission</type>"
    start, end = URDF.index("<transmission"), URDF.index("</transmission>")
    text = f'{URDF[:start]}<transmission name="wrist">{kind}{inner}{URDF[end:]}'
    robot = loaded(text, ".urdf", hold="elbow")
    assert robot.coupling.tolist() == [[6]] and robot.joint_names == ("shoulder",)
