"""Held joints: the robot with them welded is the whole robot with them at rest where they stand."""

import re

import numpy as np
import pytest
from helpers.robots import ARM, SIX, URDF, chain_names, chain_sdf, loaded
from oracles.pinocchio_model import urdf_torque

from sdt_drake.io.errors import InputError
from sdt_drake.robot.dynamics import torque_groups

BODY = '<inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4"/></inertial>'
FINGER = """<link name="{0}">{1}</link><joint name="finger_{0}" type="prismatic">
  <origin {2}/><parent link="lower"/><child link="{0}"/><axis xyz="0 {3} 0"/>
  <limit effort="10" velocity="0.1" lower="{4}" upper="0.04"/>{5}</joint>"""
MIMIC = '<mimic joint="finger_left" multiplier="1.5" offset="0.001"/>'
FINGERS = FINGER.format("left", BODY, 'xyz="0.4 0.02 0" rpy="0 0 0.5"', 2, 0, "")
FINGERS += FINGER.format("right", BODY, 'xyz="0.4 -0.02 0"', -1, 0.01, MIMIC) + "</robot>"
GRIPPER = URDF.replace("</robot>", FINGERS)


def place(robot, link):
    plant = robot.plant
    return plant.GetBodyByName(link).EvalPoseInWorld(robot.context_at_zero()).translation()


HOLDS = [
    ({"hold": "finger_left=0.02"}, 0.02, 0.031),
    ({"hold": "finger_left=0"}, 0.0, 0.001),  # its lower limit
    ({"hold": ["finger_left=0.02", "finger_right=0.03"]}, 0.02, 0.03),
    ({"hold": "finger_left, finger_right"}, 0.0, 0.001),
    ({"tip": "lower"}, 0.0, 0.001),
    ({"tip": "lower", "hold": "finger_left=0.04"}, 0.04, 0.061),
]


@pytest.mark.parametrize(("what", "left", "right"), HOLDS)
def test_fingers_stand_where_they_are_told_as_load_of_the_arm(what, left, right):
    """The elbow is at 0.8 m. The left finger moves along y, turned by 0.5 rad."""
    robot = loaded(GRIPPER, ".urdf", **what)
    assert robot.joint_names == ("shoulder", "elbow") and dict(robot.held) == {
        "finger_left": left, "finger_right": pytest.approx(right)
    }  # fmt: skip
    moved = left * np.array([-np.sin(0.5), np.cos(0.5), 0])
    np.testing.assert_allclose(place(robot, "left"), np.add([1.2, 0.02, 0], moved), atol=1e-12)
    np.testing.assert_allclose(place(robot, "right"), [1.2, -0.02 - right, 0], atol=1e-12)
    more = [place(robot, name)[0] for name in ("left", "right")]
    arm = loaded(URDF, ".urdf")
    added = robot.plant.CalcMassMatrix(robot.context_at_zero())
    added -= arm.plant.CalcMassMatrix(arm.context_at_zero())
    by_hand = sum(0.1 * x**2 + 1e-4 for x in more)  # about the shoulder
    assert added[0, 0] == pytest.approx(by_hand, rel=1e-9)


@pytest.mark.parametrize("angle", [0.0, -0.7])
def test_arm_with_a_held_joint_is_the_whole_arm_with_it_at_rest(angle):
    whole = loaded(SIX, ".urdf")
    name = whole.joint_names[2]
    part = loaded(SIX, ".urdf", hold=f"{name}={angle}")
    rng, others = np.random.default_rng(1), [0, 1, 3, 4, 5]
    q, v, vd = rng.uniform(-1, 1, (3, 4, 5))
    full = [np.insert(x, 2, still, axis=1) for x, still in ((q, angle), (v, 0), (vd, 0))]
    expected = torque_groups(whole, *full).total[:, others]
    np.testing.assert_allclose(torque_groups(part, q, v, vd).total, expected, rtol=1e-9, atol=1e-9)


def test_sdf_holds_joints_where_its_links_stand():
    text, (first, second, third) = chain_sdf(3, seed=4), chain_names(3)
    whole, part = loaded(text), loaded(text, hold=second)
    assert part.joint_names == (first, third)
    q, v, vd = np.random.default_rng(2).uniform(-1, 1, (3, 4, 2))
    full = [np.insert(x, 1, 0, axis=1) for x in (q, v, vd)]
    expected = torque_groups(whole, *full).total[:, [0, 2]]
    np.testing.assert_allclose(torque_groups(part, q, v, vd).total, expected, rtol=1e-9, atol=1e-9)
    with pytest.raises(InputError, match=r"held at 0\.5, expected 0 in an SDF"):
        loaded(text, hold=f"{second}=0.5")


REFUSED = [
    ({}, "joint 'finger_left' is prismatic and joint 'finger_right' follows 'finger_left' by "
         "<mimic>.*hold='finger_left,finger_right', or make it fixed"),
    ({"hold": "finger_lef"}, "hold: no joint 'finger_lef' in .*, did you mean 'finger_left'"),
    ({"hold": "finger_left=1"}, "hold: finger_left=1, expected 0 to 0.04, its limits"),
    ({"hold": "finger_left=wide"}, "hold: 'finger_left=wide', expected NAME or NAME=POSITION"),
    ({"tip": "lowr"}, "tip: no link 'lowr' in .*, did you mean 'lower'"),
    ({"hold": "finger_right"}, "joint 'finger_left' is prismatic.*hold='finger_left', or make"),
]  # fmt: skip


@pytest.mark.parametrize(("what", "message"), REFUSED)
def test_wrong_hold_is_refused_with_what_is_there(what, message):
    with pytest.raises(InputError, match=message) as error:
        loaded(GRIPPER, ".urdf", **what)
    assert "\n" not in str(error.value)


def test_branches_are_cut_to_the_chain_that_ends_at_the_tip():
    second = URDF[URDF.index('<link name="lower">') : URDF.index("<joint")]
    joint = URDF[URDF.index('<joint name="elbow"') : URDF.index("<transmission")]
    other = second.replace("lower", "other") + joint.replace("elbow", "knee").replace(
        "lower", "other"
    )
    text = URDF.replace("</robot>", other + "</robot>")
    with pytest.raises(
        InputError, match=r"branches at joints 'elbow', 'knee'.*tip=\.\.\..*lower and"
    ):
        loaded(text, ".urdf")
    robot = loaded(text, ".urdf", tip="other")
    assert robot.joint_names == ("shoulder", "knee") and dict(robot.held) == {"elbow": 0}


@pytest.mark.parametrize(("what", "left", "right"), HOLDS)
def test_arm_with_held_fingers_is_that_of_pinocchios_reader(what, left, right):
    text = re.sub(
        '(<inertia [^/]*iyy="[^"]*" izz="[^"]*")/>', r'\1 ixy="0" ixz="0" iyz="0"/>', GRIPPER
    )
    text = text.replace('<limit effort="40"/>', '<limit effort="40" velocity="9"/>')
    robot = loaded(text, ".urdf", **what)
    q, v, vd = np.random.default_rng(3).uniform(-1, 1, (3, 4, 2))
    torque = torque_groups(robot, q, v, vd).total - robot.damping * v
    np.testing.assert_allclose(torque, urdf_torque(robot, q, v, vd), rtol=1e-9, atol=1e-9)


def test_joint_of_an_sdf_that_follows_another_is_held_with_it():
    mimic = '<mimic joint="shoulder"><multiplier>2</multiplier><offset>{}</offset></mimic>'
    text = ARM.replace("<limit><effort>40", mimic.format(0) + "<limit><effort>40")
    assert text != ARM
    with pytest.raises(InputError, match=r"'elbow' follows 'shoulder' by <mimic>.*hold='elbow'"):
        loaded(text)
    assert loaded(text, hold="elbow").joint_names == ("shoulder",)
    with pytest.raises(InputError, match=r"joint 'elbow': held at 0\.5, expected 0 in an SDF"):
        loaded(text.replace("<offset>0<", "<offset>0.5<"), hold="shoulder")
