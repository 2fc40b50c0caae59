"""What pictures of a motion have in them: the device, the head in it, its specific force."""

import numpy as np
import pytest
from helpers.motions import TIME, smooth
from pydrake.multibody.tree import JacobianWrtVariable

from sdt_drake.show.view3d.scene import METRES_PER_G, Scene, arrow_pose, felt_rotation, make_frames


def test_drawn_head_and_specific_force_equal_drakes(robot):
    q, _, _ = smooth(robot)
    frames = make_frames(robot, TIME, q)
    shown = frames.head
    exact_q, v, vd = smooth(robot, frames.time)
    plant = robot.plant
    context, head = plant.CreateDefaultContext(), plant.GetFrameByName("head")
    world, gravity = plant.world_frame(), np.array([0.0, 0.0, -9.81])
    for k in range(2, len(frames.time) - 2, 7):
        plant.SetPositions(context, frames.q[k])
        pose = head.CalcPoseInWorld(context)
        np.testing.assert_allclose(shown.position[k], pose.translation(), atol=1e-9)
        np.testing.assert_allclose(shown.rotation[k], pose.rotation().matrix(), atol=1e-9)
        plant.SetPositions(context, exact_q[k])
        plant.SetVelocities(context, v[k])
        where = (context, JacobianWrtVariable.kV, head, np.zeros(3), world, world)
        a = plant.CalcJacobianTranslationalVelocity(*where) @ vd[k]
        a += plant.CalcBiasTranslationalAcceleration(*where).ravel()
        np.testing.assert_allclose(shown.force_in_world[k], a - gravity, atol=0.01)


def test_felt_rotation_is_the_least_to_felt_down(robot):
    frames = make_frames(robot, TIME, smooth(robot)[0])
    rotation, gravity = frames.head.rotation, frames.felt.gravity
    felt = felt_rotation(rotation, gravity)
    np.testing.assert_allclose(
        felt @ gravity[:, :, None], np.tile([[0], [0], [-1]], (61, 1, 1)), atol=1e-3
    )
    np.testing.assert_allclose(
        felt @ felt.swapaxes(1, 2), np.tile(np.eye(3), (61, 1, 1)), atol=1e-9
    )
    cosine = (np.trace(felt @ rotation.swapaxes(1, 2), axis1=1, axis2=2) - 1) / 2
    down = np.einsum("nij,nj->ni", rotation, gravity)[:, 2]
    np.testing.assert_allclose(cosine, -down, atol=1e-3)
    # Felt as it is, and felt upside down, which has no axis.
    true = -rotation[:, 2]
    np.testing.assert_allclose(felt_rotation(rotation, true), rotation, atol=1e-9)
    assert np.all(np.isfinite(felt_rotation(rotation, -true)))


@pytest.mark.parametrize("force", [(0, 0, 9.81), (3, -4, 2), (0, 0, -19.62), (-9.81, 0, 0)])
def test_force_arrow_has_direction_and_length_of_the_force(force):
    pose, length = arrow_pose(np.array([1.0, 2.0, 3.0]), np.array(force, dtype=float))
    tip = pose.multiply([0.0, 0.0, length])
    assert pose.translation().tolist() == [1.0, 2.0, 3.0]
    expected = np.array(force) * METRES_PER_G / 9.80665
    np.testing.assert_allclose(tip - [1.0, 2.0, 3.0], expected, rtol=1e-3, atol=1e-12)


# --- the device as it is drawn ------------------------------------------------------------------


def test_floor_is_below_all_links(robot, meshcat):
    """A packed transform has the columns of its matrix."""
    frames = make_frames(robot, TIME, smooth(robot)[0])
    Scene(robot, frames, meshcat)
    packed = meshcat._GetPackedTransform("/floor")[-16 * 9 :]
    matrix = [np.frombuffer(packed[9 * i + 1 : 9 * i + 9], ">f8")[0] for i in range(16)]
    context = robot.plant.CreateDefaultContext()
    robot.plant.SetPositions(context, frames.q[0])
    pose = robot.plant.GetFrameByName("head").CalcPoseInWorld(context)
    assert matrix[14] < pose.translation()[2] - 1, matrix
