"""What pictures of a motion have in them: the device, the head in it, its specific force."""

import re

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import JacobianWrtVariable
from pydrake.systems.framework import DiagramBuilder
from robots import ARM, URDF

from sdt_drake.io.errors import InputError
from sdt_drake.robot.robot import load_robot, parts_of
from sdt_drake.show.view3d import scene as scene_module
from sdt_drake.show.view3d.scene import (
    FIELD_OF_VIEW,
    FRAME_RATE,
    METRES_PER_G,
    Scene,
    arrow_pose,
    felt_rotation,
    make_frames,
)
from sdt_drake.show.view3d.viewer import record_html
from sdt_drake.systems.robot_drawing import add_robot_drawing

TIME = np.arange(401) * 0.005  # 2 s


def smooth(robot, time=TIME):
    """Angles, speeds and accelerations of joints that all turn."""
    a, w = np.linspace(0.3, 0.6, robot.n), np.linspace(1.0, 2.5, robot.n)
    s, c = np.sin(np.outer(time, w)), np.cos(np.outer(time, w))
    return a * s, a * w * c, -a * w**2 * s


def test_frames_are_even_and_are_the_motion(robot):
    q, _, _ = smooth(robot)
    frames = make_frames(robot, TIME, q)
    assert len(frames.time) == 2 * FRAME_RATE + 1
    np.testing.assert_allclose(np.diff(frames.time), 1 / FRAME_RATE, rtol=1e-9)
    # 0.1 s is both the third picture and the twentieth sample.
    np.testing.assert_allclose(frames.q[::3], q[::20], rtol=0, atol=1e-12)
    exact, _, _ = smooth(robot, frames.time)
    np.testing.assert_allclose(frames.q, exact, rtol=0, atol=2e-5)


def test_head_and_its_specific_force_are_drakes(robot):
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


def test_felt_head_turns_no_more_than_down_needs(robot):
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


def test_a_weightless_head_has_no_felt_attitude(robot, monkeypatch, meshcat):
    def weightless(*_):
        raise InputError("specific_force: 0 m/s²")

    monkeypatch.setattr(scene_module, "feel", weightless)
    frames = make_frames(robot, TIME, smooth(robot)[0])
    assert frames.head is not None and frames.felt is None
    Scene(robot, frames, meshcat).show(3)


@pytest.mark.parametrize("force", [(0, 0, 9.81), (3, -4, 2), (0, 0, -19.62), (-9.81, 0, 0)])
def test_arrow_points_along_the_force(force):
    pose, length = arrow_pose(np.array([1.0, 2.0, 3.0]), np.array(force, dtype=float))
    tip = pose.multiply([0.0, 0.0, length])
    assert pose.translation().tolist() == [1.0, 2.0, 3.0]
    expected = np.array(force) * METRES_PER_G / 9.80665
    np.testing.assert_allclose(tip - [1.0, 2.0, 3.0], expected, rtol=1e-3, atol=1e-12)


@pytest.mark.parametrize(
    ("change", "part"),
    [
        (lambda t, q: (t[:2], q[:2]), "at least three samples"),
        (lambda t, q: (np.where(t == 1, np.nan, t), q), "at least three samples"),
        (lambda t, q: (t * 1801, q), "lasts 3602 s, expected at most 3600 s"),
        (lambda t, q: (t, q[:, :3]), "expected (401, 4)"),
        (lambda t, q: (t, np.where(t[:, None] == 1, np.inf, q)), "not finite"),
    ],
)
def test_refuses_what_is_no_motion_of_the_robot(robot, tmp_path, change, part):
    time, q = change(TIME, smooth(robot)[0])
    with pytest.raises(InputError, match=re.escape(part)):
        record_html(robot, time, q, tmp_path / "a.html")
    assert list(tmp_path.iterdir()) == []


def with_shape(folder, shape):
    """A planar arm, its upper link drawn as `shape`."""
    visual = f'<visual name="v"><geometry>{shape}</geometry></visual>'
    path = folder / "arm.sdf"
    path.write_text(ARM.replace('<link name="upper">', f'<link name="upper">{visual}'), "utf-8")
    return load_robot(path)


@pytest.fixture
def draw(meshcat):
    return lambda robot: Scene(robot, make_frames(robot, TIME, smooth(robot)[0]), meshcat)


@pytest.mark.parametrize(
    "shape, message",
    [
        ("<sphere><radius>nan</radius></sphere>", "<visual> cannot be drawn .*radius = nan"),
        ("<sphere><radius>1e300</radius></sphere>", "at most 1000 m to show"),
        ("<plane><normal>0 0 0</normal></plane>", "<visual> cannot be drawn .*norm"),
        ("<mesh><uri>arm.obj</uri></mesh>", "<visual> cannot be drawn .*three vertices"),
    ],
)
def test_a_shape_that_cannot_be_drawn_is_one_line(tmp_path, draw, shape, message):
    (tmp_path / "arm.obj").write_text("v 0 0 x\n")
    with pytest.raises(InputError, match=message) as caught:
        draw(with_shape(tmp_path, shape))
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 500


@pytest.mark.parametrize("mesh", ["none.obj", "arm.stl"])
def test_a_mesh_that_cannot_be_drawn_is_left_out_and_named(tmp_path, draw, caplog, mesh):
    (tmp_path / "arm.stl").touch()
    draw(with_shape(tmp_path, f"<mesh><uri>{mesh}</uri></mesh>"))
    assert [r.message.partition("': mesh ")[2].split()[0] for r in caplog.records] == [mesh]


def test_a_mesh_is_drawn_from_a_folder_with_blanks(tmp_path, meshcat):
    (tmp_path / "my arm.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "utf-8")
    robot = with_shape(tmp_path, "<mesh><uri>my arm.obj</uri></mesh>")
    _, _, own = add_robot_drawing(DiagramBuilder(), robot=robot, meshcat=meshcat)
    assert own


def test_a_robot_with_nothing_but_a_plane_gets_a_skeleton(tmp_path, draw):
    draw(with_shape(tmp_path, "<plane><normal>0 0 1</normal><size>1 1</size></plane>"))


def test_the_last_link_of_a_skeleton_is_drawn(tmp_path, meshcat):
    """Else nothing would be seen of the last joint, and of a robot with a single one."""
    (tmp_path / "arm.urdf").write_text(URDF, "utf-8")
    robot = load_robot(tmp_path / "arm.urdf")
    builder = DiagramBuilder()
    plant, scene_graph, _ = add_robot_drawing(builder, robot=robot, meshcat=meshcat)
    inspector, body = scene_graph.model_inspector(), plant.GetBodyByName("lower")
    rods = [g for g in plant.GetVisualGeometriesForBody(body) if "rod" in inspector.GetName(g)]
    pose, length = inspector.GetPoseInFrame(rods[0]), inspector.GetShape(rods[0]).length()
    np.testing.assert_allclose(pose @ [0, 0, length / 2], parts_of(body)[1], atol=1e-12)
    np.testing.assert_allclose(pose @ [0, 0, -length / 2], np.zeros(3), atol=1e-12)


@pytest.mark.parametrize("reach", [0.1, 3.0])
def test_the_head_and_its_arrow_are_in_the_picture(tmp_path, meshcat, reach):
    frame = f'<frame name="head" link="lower" xyz="{reach} 0 0" rpy="0 0 0"/></robot>'
    (tmp_path / "arm.urdf").write_text(URDF.replace("</robot>", frame), "utf-8")
    robot = load_robot(tmp_path / "arm.urdf")
    frames = make_frames(robot, TIME, smooth(robot)[0])
    scene, head = Scene(robot, frames, meshcat), frames.head
    ends = [arrow_pose(*both) for both in zip(head.position, head.force_in_world, strict=True)]
    seen = np.array([*head.position, *(pose @ [0, 0, length] for pose, length in ends)])
    forward = (scene.target - scene.eye) / np.linalg.norm(scene.target - scene.eye)
    right = np.cross(forward, [0, 0, 1])
    right /= np.linalg.norm(right)
    across, ahead = (seen - scene.eye) @ right, (seen - scene.eye) @ forward
    above = (seen - scene.eye) @ np.cross(right, forward)
    half = np.tan(np.radians(FIELD_OF_VIEW / 2)) * (1 + 1e-9)
    assert np.all(np.abs(above) <= half * ahead) and np.all(np.abs(across) <= 1.3 * half * ahead)


def test_a_urdf_is_drawn_with_its_root_fixed(tmp_path, draw):
    path = tmp_path / "arm.urdf"
    path.write_text(
        URDF.replace('<link name="base"/>', f'<link name="base">{BALL}</link>'), "utf-8"
    )
    draw(load_robot(path))


BALL = "<visual><geometry><sphere radius='0.1'/></geometry></visual>"


# --- the device as it is drawn ------------------------------------------------------------------


def test_parts_of_the_device_pass_each_other_freely():
    """At any angles, links touch at the flanges of their joints only."""
    text = re.sub(r"<material>.*?</material>", "", load_robot().path.read_text(encoding="utf-8"))
    text = text.replace("<visual ", "<collision ").replace("</visual>", "</collision>")
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
    Parser(plant).AddModelsFromString(text, "sdf")
    plant.Finalize()
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    inspector = scene_graph.model_inspector()
    parts = []
    for geometry in inspector.GetAllGeometryIds():
        body = plant.GetBodyFromFrameId(inspector.GetFrameId(geometry)).name()
        name = inspector.GetName(geometry).split("::")[-1]
        if "flange" not in name and name != "yaw_motor":
            parts.append((body.replace("payload", "gondola"), name, geometry))
    pairs = [(a, b) for i, a in enumerate(parts) for b in parts[:i] if a[0] != b[0]]
    assert len(pairs) > 500
    for q in np.random.default_rng(0).uniform(-np.pi, np.pi, (40, plant.num_positions())):
        plant.SetPositions(plant.GetMyMutableContextFromRoot(context), q)
        query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(context))
        for (one, a, first), (other, b, second) in pairs:
            distance = query.ComputeSignedDistancePairClosestPoints(first, second).distance
            assert distance > 0, f"{one}: {a} in {other}: {b} at {np.degrees(q).round()} deg"


def test_the_floor_is_below_all_links(robot, meshcat):
    """A packed transform has the columns of its matrix."""
    frames = make_frames(robot, TIME, smooth(robot)[0])
    Scene(robot, frames, meshcat)
    packed = meshcat._GetPackedTransform("/floor")[-16 * 9 :]
    matrix = [np.frombuffer(packed[9 * i + 1 : 9 * i + 9], ">f8")[0] for i in range(16)]
    context = robot.plant.CreateDefaultContext()
    robot.plant.SetPositions(context, frames.q[0])
    pose = robot.plant.GetFrameByName("head").CalcPoseInWorld(context)
    assert matrix[14] < pose.translation()[2] - 1, matrix
