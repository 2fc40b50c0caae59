"""What pictures of a motion have in them: the device, the head in it, its specific force."""

import re

import numpy as np
import pytest
from helpers.figures import unpacked
from helpers.motions import TIME, smooth
from helpers.robots import ARM
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import JacobianWrtVariable
from pydrake.systems.framework import DiagramBuilder

from sdt_drake.io.errors import InputError
from sdt_drake.robot.robot import load_robot
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


# --- what cannot be shown -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("time", "q", "message"),
    [
        ([0, 1], np.zeros((2, 4)), "time: expected at least three samples that grow"),
        ([0, 1, 1], np.zeros((3, 4)), "time: expected at least three samples that grow"),
        ([0, 1, 2], np.zeros((3, 3)), r"q: shape \(3, 3\), expected \(3, 4\) for robot 'sdt'"),
        ([0, 1, 2], np.full((3, 4), np.nan), "q: contains a value that is not finite"),
        ([0, 1, 1e5], np.zeros((3, 4)), "lasts 100000 s, expected at most .* s to show"),
    ],
)
def test_a_motion_that_cannot_be_shown_is_one_line(robot, time, q, message):
    with pytest.raises(InputError, match=message):
        make_frames(robot, time, q)


@pytest.fixture
def draw(tmp_path, meshcat):
    """Draws the planar arm with a shape on its upper link."""

    def drawn(shape):
        visual = f'<link name="upper"><visual name="v"><geometry>{shape}</geometry></visual>'
        path = tmp_path / "arm.sdf"
        path.write_text(ARM.replace('<link name="upper">', visual), "utf-8")
        robot = load_robot(path)
        return Scene(robot, make_frames(robot, TIME, smooth(robot)[0]), meshcat)

    return drawn


SHAPES = [
    ("<sphere><radius>nan</radius></sphere>", "a <visual> cannot be drawn .*radius = nan"),
    ("<sphere><radius>1e300</radius></sphere>", "at most 1000 m to show"),
    ("<plane><normal>0 0 0</normal></plane>", "a <visual> cannot be drawn .*norm"),
    ("<mesh><uri>arm.obj</uri></mesh>", "a <visual> cannot be drawn .*three vertices"),
]


@pytest.mark.parametrize("shape, message", SHAPES, ids=[case[-1] for case in SHAPES])
def test_a_shape_that_cannot_be_drawn_is_one_line(tmp_path, draw, shape, message):
    (tmp_path / "arm.obj").write_text("v 0 0 x\n")
    with pytest.raises(InputError, match=rf"^{tmp_path}/arm\.sdf: .*{message}") as caught:
        draw(shape)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 500


def test_meshes_that_cannot_be_drawn_are_left_out_and_named(draw, caplog):
    draw("<mesh><uri>none.obj</uri></mesh>")
    assert ["link 'upper': mesh none.obj is missing" in x.message for x in caplog.records] == [True]


# --- the device as it is drawn ------------------------------------------------------------------


def test_floor_is_below_all_links(robot, meshcat):
    frames = make_frames(robot, TIME, smooth(robot)[0])
    Scene(robot, frames, meshcat)
    matrix = unpacked(meshcat._GetPackedTransform("/floor"), 16)
    context = robot.plant.CreateDefaultContext()
    robot.plant.SetPositions(context, frames.q[0])
    pose = robot.plant.GetFrameByName("head").CalcPoseInWorld(context)
    assert matrix[14] < pose.translation()[2] - 1, matrix


def test_parts_of_the_device_pass_each_other_at_any_angles():
    """Links touch at the flanges of their joints only."""
    text = re.sub("<material>.*?</material>", "", load_robot().path.read_text(encoding="utf-8"))
    text = text.replace("<visual ", "<collision ").replace("</visual>", "</collision>")
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
    Parser(plant).AddModelsFromString(text, "sdf")
    plant.Finalize()
    diagram, inspector, parts = builder.Build(), scene_graph.model_inspector(), []
    for geometry in inspector.GetAllGeometryIds():
        body = plant.GetBodyFromFrameId(inspector.GetFrameId(geometry)).name()
        name = inspector.GetName(geometry).split("::")[-1]
        if "flange" not in name and name != "yaw_motor":
            parts.append((body.replace("payload", "gondola"), name, geometry))
    pairs = [(a, b) for i, a in enumerate(parts) for b in parts[:i] if a[0] != b[0]]
    assert len(pairs) > 500
    root = diagram.CreateDefaultContext()
    own, seen = plant.GetMyMutableContextFromRoot(root), scene_graph.GetMyContextFromRoot(root)
    for q in np.random.default_rng(0).uniform(-np.pi, np.pi, (40, plant.num_positions())):
        plant.SetPositions(own, q)
        query = scene_graph.get_query_output_port().Eval(seen)
        for (one, a, first), (other, b, second) in pairs:
            distance = query.ComputeSignedDistancePairClosestPoints(first, second).distance
            assert distance > 0, f"{one}: {a} in {other}: {b} at {np.degrees(q).round()} deg"
