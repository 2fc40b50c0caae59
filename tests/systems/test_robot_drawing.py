"""Robots as they are drawn: shapes at their links; without shapes, rods, rings and arrows."""

import re

import numpy as np
import pytest
from helpers.robots import ARM, RATE_TABLE, URDF, loaded
from pydrake.math import RigidTransform

from sdt_drake.systems import robot_drawing
from sdt_drake.systems.skeleton import Bones, _ring, bones, skeleton


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


def test_a_ring_is_a_closed_surface_around_its_tube():
    """V = 2 pi² R r², less what its flat faces cut off; each edge has a face at either side."""
    radius, thickness = 0.5, 0.1
    text = _ring(radius, thickness).source().in_memory().mesh_file.contents().decode()
    corners = np.array(re.findall(r"^v (\S+) (\S+) (\S+)$", text, re.MULTILINE), dtype=float)
    faces = np.array(re.findall(r"^f (\d+) (\d+) (\d+)$", text, re.MULTILINE), dtype=int) - 1
    a, b, c = corners[faces].swapaxes(0, 1)
    volume = np.einsum("ij,ij", a, np.cross(b, c)) / 6
    assert 0.8 < volume / (2 * np.pi**2 * radius * thickness**2) < 1
    edges = {*zip(faces.ravel().tolist(), np.roll(faces, -1, axis=1).ravel().tolist(), strict=True)}
    assert len(edges) == 3 * len(faces) and edges == {(j, i) for i, j in edges}


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


@pytest.mark.parametrize(
    ("origin", "end", "gyration", "size", "rod"),
    [
        ([[0, 0, 0.5], [0.8, 0, 0.5]], [[0.8, 0, 0], [0.3, 0, 0]], [0.4, 0.1], 1.6, 0.0384),
        ([[0, 0, 0]], [[0.1, 0, 0]], [0.5], 1.0, 0.024),
        ([[0, 0, 0]], [[0.2, 0, 0]], [0.5], 0.2, 0.0048),
        ([[0, 0, 0]], [[9.0, 0, 0]], [0.5], 9.0, 0.07),
        ([[0, 0, 0]], [[0, 0, 0]], [0.0], 0.01, 0.00024),
    ],
    ids=["arm on a post", "gimbal", "short arm", "long arm", "point"],
)
def test_rods_are_a_share_of_the_way_from_the_world_to_the_tip(origin, end, gyration, size, rod):
    own = Bones((), (), *map(np.array, (origin, np.zeros_like(origin), end, gyration)))
    assert (own.size, own.rod) == pytest.approx((size, rod))


def test_drums_and_arrows_of_an_arm_lie_on_its_axes():
    """Both axes are y, in x = 0 and 0.8 m; the size is 1.1 m."""
    found, at = parts(URDF)[1:]
    size, rod = 1.1, 0.024 * 1.1
    for k, x in enumerate((0.0, 0.8)):
        drum, shaft, tip = (found[f"{name}_{k}"].shape for name in ("joint", "axis", "tip"))
        assert (drum.radius(), drum.length()) == pytest.approx((1.7 * rod, 4 * rod))
        assert (shaft.radius(), shaft.length()) == pytest.approx((rod / 4, 0.14 * size))
        assert (tip.height(), tip.a(), tip.b()) == pytest.approx((0.06 * size, *[0.8 * rod] * 2))
        for name, y in ("joint", 0.0), ("axis", 0.07 * size), ("tip", 0.2 * size):
            pose = at[f"{name}_{k}"]
            np.testing.assert_allclose(pose.translation(), [x, y, 0], atol=1e-12)
            along = pose.rotation().matrix()[:, 2]
            np.testing.assert_allclose(along, [0, -1 if name == "tip" else 1, 0], atol=1e-12)


def test_pins_hold_a_ring_on_both_sides_and_arrows_start_at_the_ring_outside():
    found, at = parts(RATE_TABLE)[1:]
    radii, size = np.sqrt([34 / 180, 9 / 85]), 1.2 + np.hypot(0.005, 0.02)
    rod, centre = 0.024 * size, np.array([0, 0, 1.2])
    outer = [radii[0] + 2 * rod, radii[0]]
    for k, axis in enumerate(np.eye(3)[[2, 1]]):
        for name, side in ("joint", 1), ("joint_behind", -1):
            pin = found[f"{name}_{k}"].shape
            assert (pin.length(), pin.radius()) == pytest.approx((outer[k] - radii[k], 0.8 * rod))
            middle = centre + side * axis * (outer[k] + radii[k]) / 2
            np.testing.assert_allclose(at[f"{name}_{k}"].translation(), middle, atol=1e-12)
        start = centre + axis * (radii[0] + 0.07 * size)
        np.testing.assert_allclose(at[f"axis_{k}"].translation(), start, atol=1e-12)


def test_a_ring_is_larger_than_the_one_within_it_by_a_third():
    """The inner link, of 9 kg m² and 60 kg, is wider than its rings would be by their inertia."""
    found = parts(RATE_TABLE.replace('izz="3.0"', 'izz="9.0"').replace('"2.2"', '"7.0"'))[1]
    plate = np.sqrt(9 / 60)
    pins = [found[f"joint_{k}"].shape.length() for k in (1, 2)]
    assert found["plate_2"].shape.radius() == pytest.approx(plate)
    assert pins == pytest.approx([(1.3**2 - 1.3) * plate, 0.3 * plate])
