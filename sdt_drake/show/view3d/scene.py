"""Pictures of a motion, and a scene in Meshcat that shows them."""

import re
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from pydrake.geometry import (
    Cylinder,
    Ellipsoid,
    Meshcat,
    MeshcatCone,
    QueryObject,
    Rgba,
    SceneGraph,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, one_line
from sdt_drake.motion.trajectory import interpolated
from sdt_drake.pilot.head import GRAVITY, HeadMotion, has_head, head_motion
from sdt_drake.pilot.illusions import feel
from sdt_drake.pilot.orientation import Percept
from sdt_drake.robot.robot import Robot
from sdt_drake.systems.robot_drawing import add_robot_drawing

FRAME_RATE = 30.0
"""Pictures per second of motion [1/s]; the browser interpolates between them."""

MAX_DURATION = 3600.0
"""Longest motion that can be shown [s]; memory and page contain all its pictures."""

MAX_REACH = 1000.0
"""Largest distance of shapes from the world's origin [m]; lines on the floor are 1 m apart."""

METRES_PER_G = 0.7
"""Length of the arrow for 1 g of specific force [m]."""

ARROW, TRACE, FELT = (0.84, 0.15, 0.35), (0.0, 0.55, 0.45), (0.45, 0.2, 0.75)
"""Colours of specific force, path and felt attitude of the head, RGB in 0..1."""

FELT_MODEL = "clark2019"
"""The parameter set that predicts felt attitude in all pictures."""

FIELD_OF_VIEW, WIDTH = 40.0, 1.3
"""Vertical field [deg] and smallest width over height of the camera that sees everything."""

PILOT_FIELD, PILOT_NEAR = 75.0, 0.3
"""Field of the pilot's view [deg], and the distance from which on it shows objects [m]."""

_SHAFT_RADIUS, _TIP_RADIUS, _FLOOR = 0.025, 0.07, 0.02  # m
_TIP = 0.25  # length of the tip over that of the arrow
_SKY, _HORIZON = [0.80, 0.87, 0.94], [0.97, 0.98, 0.99]  # RGB in 0..1
_FROM = np.array([5.0, -4.0, 3.0]) / np.sqrt(50)  # unit vector from the target to the camera
_CAMERA = "/Cameras/default/rotated/<object>"
_HEAD_PATH, _ARROW_PATH, _FELT_PATH = "/head", "/arrow", "/felt"


@dataclass(frozen=True, eq=False)
class Frames:
    """The pictures of a motion."""

    time: Array
    """Time from the start of the motion [s], k / FRAME_RATE, shape (F,)."""
    q: Array
    """Joint angles, joint side [rad], shape (F, n)."""
    head: HeadMotion | None = None
    """Motion of the pilot's head; None for a robot without a head frame."""
    felt: Percept | None = None
    """Predicted percept; None if there is no prediction, as for weightlessness."""


def make_frames(robot: Robot, time: Array, q: Array) -> Frames:
    """Make the pictures of a motion, with motion and percept of the pilot's head.

    Args:
        robot: the robot.
        time: samples in equal steps [s], shape (N,), N >= 3.
        q: joint angles, joint side [rad], shape (N, n).

    Raises:
        InputError: as for `check_angles`.
    """
    time, q = np.asarray(time, dtype=float), np.asarray(q, dtype=float)
    check_angles(robot, time, q)
    # Add 1e-6: a motion that ends on a picture has it, in spite of binary round-off.
    count = int((time[-1] - time[0]) * FRAME_RATE + 1e-6) + 1
    at = np.arange(count) / FRAME_RATE
    t = at + time[0]
    sampled = interpolated(t, time, q)
    if not has_head(robot):
        return Frames(at, sampled)
    v = np.gradient(q, time, axis=0)
    vd = np.gradient(v, time, axis=0)
    head = head_motion(robot, sampled, interpolated(t, time, v), interpolated(t, time, vd))
    try:
        felt = feel(head, 1 / FRAME_RATE, FELT_MODEL)
    except InputError:
        felt = None
    return Frames(at, sampled, head, felt)


def felt_rotation(rotation: Array, gravity: Array) -> Array:
    """Return the felt rotation from head to world, shape (N, 3, 3).

    It differs from the true one by the smallest rotation that turns felt gravity downwards.

    Args:
        rotation: true rotation from head to world, shape (N, 3, 3).
        gravity: felt direction of gravity in axes of the head, unit vectors, shape (N, 3).
    """
    from scipy.spatial.transform import Rotation

    told_down, down = np.einsum("nij,nj->ni", rotation, gravity), np.array([0.0, 0.0, -1.0])
    axis = np.cross(told_down, down)
    sine = np.linalg.norm(axis, axis=1)
    angle = np.arctan2(sine, told_down @ down) / np.maximum(sine, 1e-12)
    turned: Array = Rotation.from_rotvec(axis * angle[:, None]).as_matrix() @ rotation
    return turned


def check_angles(robot: Robot, time: Array, q: Array) -> None:
    """Check that a motion can be shown; arguments as in `make_frames`.

    Raises:
        InputError: if shapes do not fit, a value is not finite, or the motion is too long.
    """
    if time.ndim != 1 or len(time) < 3 or not np.all(np.diff(time) > 0):
        raise InputError("time: expected at least three samples that grow")
    check_duration(time[-1] - time[0])
    if np.shape(q) != (len(time), robot.n):
        expected = f"({len(time)}, {robot.n}) for robot '{robot.name}'"
        raise InputError(f"q: shape {np.shape(q)}, expected {expected}")
    if not np.all(np.isfinite(q)):
        raise InputError("q: contains a value that is not finite")


def check_duration(duration: float) -> None:
    """Check that a motion of this duration [s] can be shown.

    Raises:
        InputError: if it is too long.
    """
    if not duration <= MAX_DURATION:
        raise InputError(f"lasts {duration:g} s, expected at most {MAX_DURATION:g} s to show")


# --- the scene ------------------------------------------------------------------------------------


class Scene:
    """A robot with the trace of its head and the specific force, in Meshcat.

    Args:
        robot: the robot, with the shapes of its **file**; changes in memory are not drawn.
        frames: all pictures that will be shown; trace, floor and camera depend on them.
        meshcat: the Meshcat to draw in; it is emptied first.

    Attributes:
        has_shapes: True if the file has a shape of a moving link.
        eye: position from which the camera sees everything, in the world [m].
        target: point that the camera looks at, in the world [m].

    Raises:
        InputError: if Drake cannot draw a shape of the file, or a shape is too far away.
    """

    def __init__(self, robot: Robot, frames: Frames, meshcat: Meshcat) -> None:
        self.meshcat, self.frames = meshcat, frames
        meshcat.Delete()
        try:  # bad shapes are found here, as `load_robot` reads none
            builder = DiagramBuilder()
            plant, scene_graph, self.has_shapes = add_robot_drawing(
                builder, robot=robot, meshcat=meshcat
            )
            self._drawing = builder.Build()
            self._context = self._drawing.CreateDefaultContext()
            reached = _reached(robot, plant, scene_graph, frames)
        except InputError:
            raise
        except (Exception, SystemExit) as error:  # Drake refuses a radius by SystemExit
            reason = re.sub(rf"\S*{re.escape(robot.path.name)}:", "line ", one_line(error))
            raise InputError(
                f"{robot.path}: a <visual> cannot be drawn ({reason}); a robot without any is "
                "drawn as rods and rings"
            ) from None
        low, high = reached.min(axis=1), reached.max(axis=1)
        _draw_surroundings(meshcat, low, high)
        if frames.head is not None:
            _draw_head(meshcat, frames.head.position)
        if frames.head is not None and frames.felt is not None:
            _draw_felt(meshcat)
            self._felt = felt_rotation(frames.head.rotation, frames.felt.gravity)
        self.target = (low + high) / 2
        self.eye = self.target + _distance(reached - self.target[:, None]) * _FROM
        self.show(0)

    def show(self, k: int, *, record: bool = False) -> None:
        """Show picture k, or, with `record`, add it to the running recording."""
        frames, head = self.frames, self.frames.head
        at = frames.time[k] if record else None
        self._context.SetTime(frames.time[k])
        self.place(frames.q[k])
        if head is None:
            return
        pose = RigidTransform(RotationMatrix(head.rotation[k]), head.position[k])
        self.meshcat.SetTransform(_HEAD_PATH, pose, at)
        arrow, length = arrow_pose(head.position[k], head.force_in_world[k])
        self.meshcat.SetTransform(_ARROW_PATH, arrow, at)
        self.meshcat.SetProperty(f"{_ARROW_PATH}/unit", "scale", [1.0, 1.0, length], at)
        if frames.felt is not None:
            felt = RigidTransform(RotationMatrix(self._felt[k]), head.position[k])
            self.meshcat.SetTransform(_FELT_PATH, felt, at)

    def place(self, q: Array) -> None:
        """Draw the robot alone at these joint angles [rad], shape (n,)."""
        state = np.concatenate([q, np.zeros_like(q)])
        self._drawing.get_input_port().FixValue(self._context, state)
        self._drawing.ForcedPublish(self._context)

    def query(self) -> QueryObject:
        """Return where all shapes are."""
        scene_graph = cast(SceneGraph, self._drawing.GetSubsystemByName("scene_graph"))
        context = scene_graph.GetMyContextFromRoot(self._context)
        query: Any = scene_graph.get_query_output_port().Eval(context)
        return cast(QueryObject, query)

    def overview(self) -> None:
        """Move the camera to where it sees everything."""
        self.meshcat.SetProperty(_CAMERA, "fov", FIELD_OF_VIEW)
        self.meshcat.SetCameraPose(self.eye, self.target)

    def pilot_view(self, k: int) -> None:
        """Move the camera to the head of picture k, looking forward."""
        head = self.frames.head
        assert head is not None, "for a robot with a head"
        self.meshcat.SetProperty(_FELT_PATH, "visible", False)  # it encloses the camera
        eye, (x, _, z) = head.position[k], head.rotation[k].T
        self.meshcat.SetCameraPose(eye, eye + x)
        # Meshcat keeps its camera upright, by a vector `up` with y upwards: that can roll it.
        values = {"fov": PILOT_FIELD, "near": PILOT_NEAR}
        values |= {"up.x": z[0], "up.y": z[2], "up.z": -z[1]}
        for name, value in values.items():
            self.meshcat.SetProperty(_CAMERA, name, value)


def arrow_pose(position: Array, specific_force: Array) -> tuple[RigidTransform, float]:
    """Return pose and length [m] of the arrow of a specific force [m/s²]; z is along the arrow."""
    size = float(np.linalg.norm(specific_force))
    if size < 1e-6:  # in free fall there is no direction
        return RigidTransform(position), 0.0
    rotation = RotationMatrix.MakeFromOneVector(specific_force, 2)
    return RigidTransform(rotation, position), METRES_PER_G * size / GRAVITY


def _reached(robot: Robot, plant: MultibodyPlant, scene_graph: SceneGraph, frames: Frames) -> Array:
    """Return points that the camera must see, in the world [m], shape (3, M).

    They are the corners of the shapes in about 60 pictures, and the head and the tip of its arrow
    in all pictures.
    """
    inspector = scene_graph.model_inspector()
    corners = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1)
    boxes = []
    for geometry in inspector.GetAllGeometryIds():
        box = inspector.GetObbInGeometryFrame(geometry)
        if box is not None:  # a half space has none
            pose = inspector.GetPoseInFrame(geometry) @ box.pose()
            body = plant.GetBodyFromFrameId(inspector.GetFrameId(geometry))
            boxes.append((body, pose.multiply(corners * box.half_width()[:, None])))
    own, points = plant.CreateDefaultContext(), []
    if frames.head is not None:
        arrows = METRES_PER_G / GRAVITY * frames.head.force_in_world
        points += [frames.head.position.T, (frames.head.position + arrows).T]
    for row in frames.q[:: max(1, len(frames.q) // 60)]:
        plant.SetPositions(own, row)
        points += [plant.EvalBodyPoseInWorld(own, body).multiply(local) for body, local in boxes]
    cloud = np.hstack(points)
    if not np.all(np.abs(cloud) <= MAX_REACH):
        raise InputError(
            f"{robot.path}: reaches {np.abs(cloud).max():g} m from the world's origin, expected at "
            f"most {MAX_REACH:g} m to show"
        )
    return cloud


def _distance(points: Array) -> float:
    """Return the distance of the camera from its target [m] at which it sees all points.

    Args:
        points: points relative to the target [m], shape (3, M).
    """
    right = np.array([-_FROM[1], _FROM[0], 0.0]) / np.hypot(_FROM[0], _FROM[1])
    up = np.cross(_FROM, right)
    beside = np.maximum(np.abs(right @ points) / WIDTH, np.abs(up @ points))
    return float(np.max(_FROM @ points + beside / np.tan(np.radians(FIELD_OF_VIEW / 2))))


def _draw_surroundings(meshcat: Meshcat, low: Array, high: Array) -> None:
    """Draw the sky, and a floor below the lowest point with lines every metre."""
    for path in ("/Axes", "/Grid"):
        meshcat.SetProperty(path, "visible", False)
    meshcat.SetProperty("/Background/<object>", "top_color", _SKY)
    meshcat.SetProperty("/Background/<object>", "bottom_color", _HORIZON)
    radius = float(np.ceil(1.1 * np.abs([low[:2], high[:2]]).max()))
    _light(meshcat, radius)
    meshcat.SetObject("/floor", Cylinder(radius, _FLOOR), Rgba(0.86, 0.87, 0.88))
    meshcat.SetTransform("/floor", RigidTransform(np.array([0.0, 0.0, low[2] - _FLOOR])))
    at = np.arange(1 - radius, radius)
    half, z = np.sqrt(radius**2 - at**2), np.full(len(at), low[2] - 0.4 * _FLOOR)
    starts = np.hstack([[at, -half, z], [-half, at, z]])
    ends = np.hstack([[at, half, z], [half, at, z]])
    meshcat.SetLineSegments("/lines", starts, ends, 1.0, Rgba(0.66, 0.68, 0.71))


def _light(meshcat: Meshcat, radius: float) -> None:
    """Add a lamp from above that casts shadows within `radius` [m] of the origin."""
    for lamp in ("PointLightNegativeX", "PointLightPositiveX"):  # within the device
        meshcat.SetProperty(f"/Lights/{lamp}", "visible", False)
    meshcat.SetProperty("/Lights/AmbientLight/<object>", "intensity", 1.6)
    values: dict[str, Any] = {"intensity": 2.2, "position": [4.0, -7.0, 14.0]}
    values |= {"castShadow": True, "shadow.normalBias": 0.03}
    values |= {"shadow.mapSize.x": 2048.0, "shadow.mapSize.y": 2048.0}
    for side, sign in {"left": -1, "right": 1, "bottom": -1, "top": 1}.items():
        values[f"shadow.camera.{side}"] = sign * radius
    for name, value in values.items():
        meshcat.SetProperty("/Lights/FillLight/<object>", name, value)


def _draw_head(meshcat: Meshcat, position: Array) -> None:
    """Draw the trace, and an arrow of 1 m along z that `Scene.show` scales."""
    meshcat.SetLine("/trace", position.T, 3.0, Rgba(*TRACE))
    unit = f"{_ARROW_PATH}/unit"
    meshcat.SetObject(f"{unit}/shaft", Cylinder(_SHAFT_RADIUS, 1 - _TIP), Rgba(*ARROW))
    meshcat.SetTransform(f"{unit}/shaft", RigidTransform(np.array([0.0, 0.0, (1 - _TIP) / 2])))
    # A Meshcat cone has its apex at the origin and opens along +z.
    meshcat.SetObject(f"{unit}/tip", MeshcatCone(_TIP, _TIP_RADIUS, _TIP_RADIUS), Rgba(*ARROW))
    flip = RotationMatrix.MakeXRotation(np.pi)
    meshcat.SetTransform(f"{unit}/tip", RigidTransform(flip, np.array([0.0, 0.0, 1.0])))


def _draw_felt(meshcat: Meshcat) -> None:
    """Draw a translucent head that looks along x, within a horizontal disc."""
    colour = Rgba(*FELT, 0.45)
    meshcat.SetObject(f"{_FELT_PATH}/head", Ellipsoid(0.16, 0.13, 0.2), colour)
    meshcat.SetObject(f"{_FELT_PATH}/level", Cylinder(0.75, 0.01), Rgba(*FELT, 0.3))
    meshcat.SetObject(f"{_FELT_PATH}/forward", MeshcatCone(0.3, 0.07, 0.07), colour)
    # The apex of the cone, its origin, is 0.95 m ahead; the cone opens backwards.
    ahead = RigidTransform(RotationMatrix.MakeYRotation(-np.pi / 2), np.array([0.95, 0.0, 0.0]))
    meshcat.SetTransform(f"{_FELT_PATH}/forward", ahead)
    for part in ("head", "level", "forward"):  # drawn before a canopy that would hide them
        meshcat.SetProperty(f"{_FELT_PATH}/{part}/<object>", "renderOrder", -1.0)
