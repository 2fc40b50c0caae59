"""A changed robot as URDF: it loads as that robot, and nothing else in the text has changed."""

import difflib

import numpy as np
from helpers.robots import RATE_TABLE, URDF, loaded

from sdt_drake.robot.dynamics import torque_groups
from sdt_drake.robot.robot import edited
from sdt_drake.robot.sdf import links_by_name, set_inertia
from sdt_drake.robot.urdf_text import urdf_with

SHAPE = '<visual><geometry><mesh filename="a.stl"/></geometry></visual>'
TEXT = URDF.replace('<link name="upper">', f"<!-- 3 < 4 & ü --><link name='upper' >{SHAPE}", 1)


def changed(robot, rotors, damping):
    """Other links, rotors and damping, all of them at once."""

    def edit(root):
        for k, link in enumerate(links_by_name(root).values()):
            if link.get("name") in ("upper", "lower"):
                moments = np.diag([0.3, 0.4, 0.5]) + 0.01 * k
                set_inertia(link, 3.5 + k, np.array([0.1, -0.2, 0.3]), moments)
        for joint, rotor, b in zip(robot.joint_names, rotors, damping, strict=True):
            (own,) = (x for x in root.iter("joint") if x.get("name") == joint)
            for old in own.findall("drake:rotor_inertia"):
                own.remove(old)
            own.append(own.makeelement("drake:rotor_inertia", {}))
            own[-1].text = repr(rotor)
            axis = own.find("axis")
            for old in axis.findall("dynamics"):
                axis.remove(old)
            axis.append(axis.makeelement("dynamics", {}))
            axis[-1].append(axis.makeelement("damping", {}))
            axis[-1][-1].text = repr(b)

    return edited(robot, edit)


def test_urdf_of_a_changed_robot_loads_as_that_robot():
    file = loaded(TEXT, ".urdf")
    robot = changed(file, (0.03, 0.2), (0.4, 0.6))
    text = urdf_with(robot, file)
    again = loaded(text, ".urdf")
    q, v, vd = np.random.default_rng(0).uniform(-1, 1, (3, 5, 2))
    expected, found = (torque_groups(x, q, v, vd).total for x in (robot, again))
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)
    for name in ("rotor_inertia", "damping", "gear_ratio", "effort_limit", "position_upper"):
        np.testing.assert_array_equal(getattr(again, name), getattr(robot, name))
    # What was there and has no number of these stays, in its order.
    for line in difflib.ndiff(TEXT.splitlines(), text.splitlines()):
        if line.startswith("- "):
            assert any(
                x in line
                for x in ("<mass", "<inertia", "<dynamics", "rotor", "</joint>", "</robot>", SHAPE)
            )
    assert "<!-- 3 < 4 & ü --><link name='upper' >" in text and "<mu1>0.2</mu1>" in text
    assert f'filename="{file.path.parent}/a.stl"' in text


def test_urdf_of_an_unchanged_robot_is_its_file():
    for text in (URDF, RATE_TABLE):
        robot = loaded(text, ".urdf")
        assert urdf_with(edited(robot, lambda root: None), robot) == text


def test_one_number_changes_one_place():
    file = loaded(URDF, ".urdf")
    text = urdf_with(changed(file, (0.01, 0.0), (0.9, 0.0)), file)
    start, end = URDF.index('<dynamics damping="0.7"/>'), text.index('<dynamics damping="0.9"/>')
    assert end > start and URDF[start + 25 :] == text[end + 25 :]
