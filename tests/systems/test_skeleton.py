"""Robots without shapes as they are drawn: rings where axes meet, an arrow along each axis."""

from __future__ import annotations

import numpy as np
import pytest
from owners import RATE_TABLE, SEVEN, SIX

from sdt_drake.robot.robot import load_robot
from sdt_drake.systems.skeleton import bones, skeleton


@pytest.fixture
def parts(tmp_path):
    def drawn(text: str):
        path = tmp_path / "own.urdf"
        path.write_text(text, encoding="utf-8")
        robot = load_robot(path)
        poses = dict(zip(bones(robot).links, bones(robot).poses, strict=True))
        found = list(skeleton(robot))
        at = {p.name: poses[p.link] @ p.pose if p.link else p.pose for p in found}
        return robot, {p.name: p for p in found}, at

    return drawn


def corners(part):
    text = part.shape.source().in_memory().mesh_file.contents().decode()
    rows = [line.split()[1:] for line in text.splitlines() if line.startswith("v ")]
    return np.array(rows, dtype=float)


def test_axes_that_meet_are_rings_within_each_other(parts):
    """As large as the radii of gyration: sqrt(34 / 180), sqrt(9 / 85) and sqrt(3 / 60) m."""
    robot, found, at = parts(RATE_TABLE)
    expected = {"ring_0": np.sqrt(34 / 180), "ring_1": np.sqrt(9 / 85)}
    for name, radius in expected.items():
        own = corners(found[name])
        far = np.hypot(own[:, 0], own[:, 1])
        assert (far.min() + far.max()) / 2 == pytest.approx(radius, abs=1e-5)
        np.testing.assert_allclose(at[name].translation(), [0, 0, 1.2], atol=1e-12)
    assert found["plate_2"].shape.radius() == pytest.approx(np.sqrt(3 / 60))
    # A ring lies in the plane of its own axis and the next one.
    for k in (0, 1):
        normal = at[f"ring_{k}"].rotation().matrix()[:, 2]
        axes = [robot.joint_at_zero(name)[0] for name in robot.joint_names[k : k + 2]]
        np.testing.assert_allclose(axes @ normal, 0, atol=1e-12)
    # The post ends below the outer ring.
    post = found["post"]
    assert post.shape.length() == pytest.approx(1.2 - np.sqrt(34 / 180))
    # Pins go from ring to ring.
    assert found["joint_1"].shape.length() == pytest.approx(np.sqrt(34 / 180) - np.sqrt(9 / 85))


@pytest.mark.parametrize("text", [RATE_TABLE, SIX, SEVEN])
def test_arrows_point_along_the_axes(parts, text):
    robot, _, at = parts(text)
    for k, name in enumerate(robot.joint_names):
        axis, origin = robot.joint_at_zero(name)
        tip, shaft = at[f"tip_{k}"].translation(), at[f"axis_{k}"]
        ahead = (tip - origin) @ axis
        np.testing.assert_allclose(tip, origin + ahead * axis, atol=1e-9)
        assert ahead > 0
        np.testing.assert_allclose(shaft.rotation().matrix()[:, 2], axis, atol=1e-9)


def test_rings_on_an_arm_are_smaller_than_its_rods(parts):
    """Published inertias of light wrists may have any radius of gyration."""
    heavy = SIX.replace('ixx="0.00033" iyy="0.00033" izz="0.00033"', 'ixx="1" iyy="1" izz="1"')
    assert heavy != SIX
    _, found, _ = parts(heavy)
    assert found["plate_5"].shape.radius() == pytest.approx(0.425 / 4)


def test_rods_go_from_joint_to_joint(parts):
    robot, found, at = parts(SIX)
    _, elbow = robot.joint_at_zero("joint_3")
    _, wrist = robot.joint_at_zero("joint_4")
    half = np.array([0, 0, found["rod_2"].shape.length() / 2])
    np.testing.assert_allclose(at["rod_2"] @ -half, elbow, atol=1e-9)
    np.testing.assert_allclose(at["rod_2"] @ half, wrist, atol=1e-9)
