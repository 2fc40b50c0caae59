"""What published files lack or have too much of: told, and refused only by what needs it."""

import numpy as np
import pytest
from helpers.robots import ARM, URDF, loaded, refused

from sdt_drake.io.errors import InputError
from sdt_drake.machine.identify.targets import Target
from sdt_drake.motion import load_plan
from sdt_drake.robot.dynamics import inverse_dynamics, torque_groups
from sdt_drake.robot.lacks import MASSES, SPEEDS, TORQUES
from sdt_drake.robot.rotors import without_friction

Q = np.array([[0.3, -0.7], [1.0, 2.0]])
BODY = URDF[URDF.index("<inertial>") : URDF.index("</link>", URDF.index("<inertial>"))]
LOWER = URDF[URDF.rindex("<inertial>") : URDF.rindex("</inertial>") + len("</inertial>")]


def torque(robot):
    """Torques by which two robots are compared, without rotors."""
    return torque_groups(robot, Q, 1 + Q, 2 - Q).total


LIMITS = [
    (URDF, '<limit effort="40"/>', "", TORQUES, "joint 'elbow': no torque limit known"),
    (URDF, 'effort="40"', 'effort="0"', TORQUES, "joint 'elbow': no torque limit known"),
    (URDF, 'effort="40"', 'effort="-1"', TORQUES, "joint 'elbow': no torque limit known"),
    (ARM, "<effort>40", "<effort>inf", TORQUES, "joint 'elbow': no torque limit known"),
    (ARM, "<limit><effort>40</effort></limit>", "", TORQUES, "joint 'elbow': no torque limit kn"),
    (URDF, 'velocity="3"', 'velocity="0"', SPEEDS, "joint 'shoulder': no speed limit known"),
    (ARM, "<velocity>3", "<velocity>0", SPEEDS, "joint 'shoulder': no speed limit known"),
]


@pytest.mark.parametrize(("text", "old", "new", "kind", "message"), LIMITS)
def test_unknown_limit_is_refused_by_planning_alone(text, old, new, kind, message, tmp_path):
    whole, robot = loaded(text, _suffix(text)), loaded(text.replace(old, new), _suffix(text))
    np.testing.assert_array_equal(torque(robot), torque(whole))
    assert robot.having(MASSES) is robot and [one.kind for one in robot.lacks] == [kind]
    limits = {TORQUES: robot.effort_limit[1], SPEEDS: robot.velocity_limit[0]}
    assert limits[kind] == np.inf and whole.lacks == ()
    (tmp_path / "still.yaml").write_text("name: still\nduration: 1\njoints: []\n")
    for refuse in (
        lambda: load_plan(tmp_path / "still.yaml", robot),
        lambda: Target.everything(robot),
    ):
        with pytest.raises(InputError, match=message):
            refuse()


def _suffix(text):
    return ".urdf" if "<robot" in text else ".sdf"


def test_all_unknown_limits_are_in_one_line():
    text = URDF.replace('effort="40"', 'effort="0"').replace('effort="90"', 'effort="0"')
    robot = loaded(text, ".urdf")
    assert robot.accepted == (
        "joints 'shoulder' and 'elbow': <effort> of 0 or less is read as no known limit",
    )
    (lacking,) = robot.lacks
    assert "joints 'shoulder' and 'elbow': no torque limit known" in f"{lacking}"


def test_links_without_mass_have_axes_but_no_dynamics():
    robot = loaded(URDF.replace(BODY, "").replace(LOWER, ""), ".urdf")
    axis, origin = robot.joint_at_zero("elbow")
    np.testing.assert_allclose([axis, origin], [[0, 1, 0], [0.8, 0, 0]], atol=1e-15)
    for compute in (torque_groups, inverse_dynamics):
        with pytest.raises(InputError, match="links 'upper' and 'lower': no <inertial>, expected"):
            compute(robot, Q, Q, Q)
    with pytest.raises(InputError, match="link 'lower': no <inertial>"):
        Target.payload(loaded(URDF.replace(LOWER, ""), ".urdf"), "lower")


def test_mass_of_a_welded_link_is_that_of_its_body():
    """The lower link as a frame with all mass in a link that is welded to it."""
    welded = (
        "<link name='shell'>" + LOWER + "</link><joint name='weld' type='fixed'>"
        "<parent link='lower'/><child link='shell'/></joint></robot>"
    )
    robot = loaded(URDF.replace(LOWER, "").replace("</robot>", welded), ".urdf")
    assert robot.lacks == ()
    np.testing.assert_allclose(torque(robot), torque(loaded(URDF, ".urdf")), rtol=1e-12)


@pytest.mark.parametrize("text", [
    ARM.replace("<damping>", "<friction>0.2</friction><damping>"),
    URDF.replace('damping="0.7"', 'damping="0.7" friction="0.2"'),
])  # fmt: skip
def test_friction_of_a_file_is_told_and_left_to_the_scenario(text):
    robot = loaded(text, _suffix(text))
    np.testing.assert_array_equal(robot.coulomb, [0.2, 0])
    np.testing.assert_array_equal(torque(robot), torque(loaded(ARM)))
    assert "<friction> [0.2, 0] N m is left out: plant.friction.coulomb" in without_friction(robot)


# --- what is in the files beside a robot ----------------------------------------------------------

BESIDE = [
    ('<link name="lower">', '<link name="lower"><origin xyz="1 0 0"/>', "link 'lower': <origin>"),
    ("</robot>", '<drake_margin value="1"/></robot>', "the robot: <drake_margin> in <robot> has"),
    ("<robot ", '<robot author="me" ', "the robot: author of <robot> has no meaning in URDF"),
    ('effort="90"', 'effort="90" k_velocity="5"', "joint 'shoulder': k_velocity of <limit> has no"),
    ("<dynamics", "<dynamics/><dynamics", "joint 'shoulder': a second <dynamics> in <joint> has"),
    ('<axis xyz="0 1 0"/>', 2 * '<axis xyz="0 1 0"/>', "and joint 'elbow': a second <axis>"),
    ("</robot>", "<spare/><spare/></robot>", "the robot: <spare> in <robot> has no meaning"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "told"), BESIDE)
def test_what_has_no_meaning_is_told_and_changes_nothing(old, new, told):
    robot = loaded(URDF.replace(old, new), ".urdf")
    assert any(told in line for line in robot.accepted), robot.accepted
    np.testing.assert_array_equal(torque(robot), torque(loaded(URDF, ".urdf")))


def test_link_with_the_name_of_a_joint_is_renamed_and_told():
    text = URDF.replace('"lower"', '"elbow"')
    robot = loaded(text, ".urdf")
    assert robot.joint_names == ("shoulder", "elbow")
    assert robot.accepted == (
        "link 'elbow' has the name of a joint and is called 'elbow (link)' here",
    )
    np.testing.assert_array_equal(torque(robot), torque(loaded(URDF, ".urdf")))


WRONG = [
    ('xyz="0.3 0 0"', 'xzy="0.3 0 0"', "xzy of <origin> is not supported; did you mean 'xyz'"),
    ("</robot>", "<loop_joint/></robot>", "<loop_joint> in <robot> is not supported; remove it"),
    ("</robot>", "<drake:linear_bushing_rpy/></robot>", "<drake:linear_bushing_rpy> in <robot> is"),
]


@pytest.mark.parametrize(("old", "new", "message"), WRONG)
def test_misspelled_or_effective_content_is_refused(old, new, message):
    refused(URDF, old, new, message)


def test_misspelled_element_is_refused_only_if_the_meant_one_is_missing():
    text = LOWER.replace("inertial>", "intertial>")
    refused(URDF, LOWER, text, "<intertial> in <link> is not supported; did you mean 'inertial'")
    loaded(URDF.replace(LOWER, "<intertial/>" + LOWER), ".urdf")


def test_all_problems_of_a_file_are_told_at_once():
    text = URDF.replace('mass value="4"', 'mass value="x"').replace('"0.1" iyy', '"-0.1" iyy')
    for old, new in (('damping="0.7"', 'damping="y"'), ('effort="40"', 'effort="z"')):
        text = text.replace(old, new)
    with pytest.raises(InputError) as error:
        loaded(text, ".urdf")
    lines = str(error.value).split("\n")
    assert len(lines) == 3 and [x for line in lines for x in "xyz" if f"'{x}'" in line] == [*"xyz"]


def test_transmission_of_an_absent_joint_is_told_if_all_joints_have_their_own():
    one = URDF[URDF.index("<transmission") : URDF.index("<gazebo")]
    elbow = one.replace('"drive"', '"e"').replace('"shoulder"', '"elbow"')
    spare = one.replace('"drive"', '"f"').replace('"shoulder"', '"wrist"')
    robot = loaded(URDF.replace("</robot>", elbow + spare + "</robot>"), ".urdf")
    assert robot.accepted == (
        "the robot: <transmission> of wrist, which is not there, has no meaning in URDF and was "
        "ignored",
    )


@pytest.mark.parametrize(("name", "command"), [
    ("arm.urdf.xacro", "xacro {0}/arm.urdf.xacro > {0}/arm.urdf"),
    ("arm.xacro", "xacro {0}/arm.xacro > {0}/arm.urdf"),
    ("arm.urdf", "xacro {0}/arm.urdf > {0}/arm.expanded.urdf"),
])  # fmt: skip
def test_xacro_is_refused_with_the_command_that_expands_it(tmp_path, name, command):
    from sdt_drake.robot.robot import load_robot

    text = URDF.replace("<material", "<xacro:property name='a'/><material", 1)
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError) as error:
        load_robot(tmp_path / name)
    told = f"{tmp_path / name}: is xacro, which has to be expanded first: {command}"
    assert str(error.value) == told.format(tmp_path)


def test_capital_suffix_is_read():
    for text, suffix in ((URDF, ".URDF"), (ARM, ".SDF")):
        np.testing.assert_array_equal(torque(loaded(text, suffix)), torque(loaded(ARM)))
