"""Robots as they are drawn: shapes at their links; without shapes, rods, rings and arrows."""

import re

import numpy as np
import pytest
from helpers.robots import ARM, RATE_TABLE, loaded
from pydrake.math import RigidTransform

from sdt_drake.systems import robot_drawing
from sdt_drake.systems.skeleton import bones, skeleton


def parts(text: str):
    """A robot, the parts of its skeleton by name, and their poses at q = 0."""
    robot = loaded(text, ".urdf")
    poses = {"": RigidTransform(), **dict(zip(bones(robot).links, bones(robot).poses, strict=True))}
    found = {part.name: part for part in skeleton(robot)}
    return robot, found, {name: poses[p.link] @ p.pose for name, p in found.items()}


def test_robot_without_shapes_is_drawn_as_skeleton(meshcat):
    drawing = robot_drawing(robot=loaded(ARM), meshcat=meshcat)
    inspector = drawing.GetSubsystemByName("scene_graph").model_inspector()
    middles = {
        inspector.GetName(part).rpartition("::")[2]: inspector.GetPoseInFrame(part).translation()
        for part in inspector.GetAllGeometryIds()
    }
    assert middles.keys() == {f"{x}_{k}" for x in ("joint", "rod", "axis", "tip") for k in (0, 1)}
    # Of 0.8 m, and to the centre of mass of the last link.
    rods = [middles["rod_0"], middles["rod_1"]]
    np.testing.assert_allclose(rods, [[0.4, 0, 0], [0.15, 0, 0]], atol=1e-12)


def test_meeting_axes_are_drawn_as_nested_rings():
    """As large as the radii of gyration: sqrt(34 / 180), sqrt(9 / 85) and sqrt(3 / 60) m."""
    robot, found, at = parts(RATE_TABLE)
    radii = np.sqrt([34 / 180, 9 / 85, 3 / 60])
    for k in (0, 1):
        text = found[f"ring_{k}"].shape.source().in_memory().mesh_file.contents().decode()
        rows = re.findall(r"^v (\S+) (\S+)", text, re.MULTILINE)
        far = np.hypot(*np.array(rows, dtype=float).T)
        assert (far.min() + far.max()) / 2 == pytest.approx(radii[k], abs=1e-5)
        np.testing.assert_allclose(at[f"ring_{k}"].translation(), [0, 0, 1.2], atol=1e-12)
        # A ring lies in the plane of its own axis and the next one.
        axes = [robot.joint_at_zero(name)[0] for name in robot.joint_names[k : k + 2]]
        np.testing.assert_allclose(axes @ at[f"ring_{k}"].rotation().matrix()[:, 2], 0, atol=1e-12)
    assert found["plate_2"].shape.radius() == pytest.approx(radii[2])
    assert found["post"].shape.length() == pytest.approx(1.2 - radii[0])
    assert found["joint_1"].shape.length() == pytest.approx(radii[0] - radii[1])
