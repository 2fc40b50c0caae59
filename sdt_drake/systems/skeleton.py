"""Drawings of robots without shapes: rods, rings where axes meet, arrows along axes."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydrake.common import MemoryFile
from pydrake.geometry import Cylinder, InMemoryMesh, Mesh, MeshcatCone, Shape
from pydrake.math import RigidTransform, RotationMatrix

from sdt_drake.io.arrays import Array
from sdt_drake.robot.robot import Robot

JOINT, AXIS, BASE = (0.2, 0.3, 0.5, 1.0), (0.84, 0.47, 0.0, 1.0), (0.5, 0.5, 0.5, 1.0)
"""Colours of joints, axes and the base, RGBA in 0..1."""
LINKS = (0.62, 0.64, 0.66, 1.0), (0.42, 0.44, 0.47, 1.0)
"""Alternating colours of links, RGBA in 0..1."""

_MAX_ROD, _ROD_SHARE = 0.07, 0.024  # radius of a rod: limit [m], share of the robot's size [-]
_MEETING = 0.03  # largest distance of axes that meet, over the robot's size [-]
_MAX_RING_SHARE = 0.25  # largest radius of a ring on an arm, over the longest rod [-]
_RING_RATIO = 1.3  # radius of a ring over that of the next inner one [-]
_AROUND, _ACROSS = 48, 12  # corners of a ring


class Part(NamedTuple):
    """A shape at a pose in a link."""

    link: str
    """Name of the link; "" for the world."""
    name: str
    shape: Shape
    pose: RigidTransform
    colour: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Bones:
    """The joints and links of a robot with all joints at 0, in world coordinates."""

    links: tuple[str, ...]
    """Names of the links that the joints carry."""
    poses: tuple[RigidTransform, ...]
    """Poses of these links."""
    origin: Array
    """Origins of the joints [m], shape (n, 3)."""
    axis: Array
    """Axes of the joints, length 1, shape (n, 3)."""
    end: Array
    """Vector from each joint to the next, or to the last centre of mass [m], shape (n, 3)."""
    gyration: Array
    """Largest radius of gyration of each link about its centre of mass [m], shape (n,)."""

    @property
    def size(self) -> float:
        """Size of the robot [m]: length from the world to the last centre of mass.

        For a gimbal, whose joints have hardly any distance, twice its largest radius of gyration.
        """
        rods, links = np.linalg.norm(self.end, axis=1).sum(), self.gyration.max()
        way = np.linalg.norm(self.origin[0]) + rods
        return float(max(way, 2 * links * (rods < links / 4), 0.01))

    @property
    def rod(self) -> float:
        """Radius of rods [m]."""
        return min(_MAX_ROD, _ROD_SHARE * self.size)


def bones(robot: Robot) -> Bones:
    """Return the joints and links of a robot; bodies welded to each other are one link."""
    plant, context = robot.plant, robot.context_at_zero()
    world, joints = plant.world_frame(), [plant.GetJointByName(name) for name in robot.joint_names]
    axis, origin = (
        np.array(x) for x in zip(*map(robot.joint_at_zero, robot.joint_names), strict=True)
    )
    centre, gyration = np.zeros_like(origin), np.zeros(robot.n)
    for k, joint in enumerate(joints):
        welded = [body.index() for body in plant.GetBodiesWeldedTo(joint.child_body())]
        whole = plant.CalcSpatialInertia(context, world, welded)
        centre[k] = origin[k]
        if whole.get_mass() > 0:
            centre[k] = whole.get_com()
            moments = whole.Shift(centre[k]).get_unit_inertia().CalcPrincipalMomentsOfInertia()
            gyration[k] = np.sqrt(max(*moments, 0.0))
    bodies = [joint.child_body() for joint in joints]
    poses = tuple(plant.EvalBodyPoseInWorld(context, body) for body in bodies)
    end = np.vstack([origin[1:], centre[-1:]]) - origin
    return Bones(tuple(body.name() for body in bodies), poses, origin, axis, end, gyration)


def skeleton(robot: Robot) -> Iterator[Part]:
    """Yield the parts of a drawing: rods as links, drums as joints, an arrow along each axis.

    A link whose next axis meets its own is a ring of its radius of gyration, as in a gimbal. If it
    is the last link, it is a plate.
    """
    own = bones(robot)
    meets = np.linalg.norm(own.end, axis=1) < _MEETING * own.size
    radius = np.where(meets, _radii(own, meets), 0.0)
    foot = _short_of(own.origin[0], float(radius[0]))
    if np.any(foot):
        yield Part("", "post", *_between(np.zeros(3), foot, own.rod), BASE)
    for k, link in enumerate(own.links):
        within = own.poses[k].inverse()
        start = radius[k - 1] if k and meets[k - 1] else radius[k]
        for name, shape, pose, colour in (
            *_joint(own, meets, radius, k),
            _link(own, meets, radius, k),
            *arrow(own, k, start),
        ):
            yield Part(link, f"{name}_{k}", shape, within @ pose, colour)


_Piece = tuple[str, Shape, RigidTransform, tuple[float, ...]]


def arrow(own: Bones, k: int, start: float) -> list[_Piece]:
    """Return an arrow along the positive axis of joint k, from `start` [m] off its origin."""
    shaft, tip = start + 0.14 * own.size, 0.06 * own.size
    a, b = own.origin[k] + np.outer([start, shaft], own.axis[k])
    # MeshcatCone: apex at the origin, open along +z.
    point = RigidTransform(RotationMatrix.MakeFromOneVector(-own.axis[k], 2), b + tip * own.axis[k])
    return [
        ("axis", *_between(a, b, own.rod / 4), AXIS),
        ("tip", MeshcatCone(tip, 0.8 * own.rod, 0.8 * own.rod), point, AXIS),
    ]


def _joint(own: Bones, meets: NDArray[np.bool_], radius: Array, k: int) -> list[_Piece]:
    """Return a drum, or two pins from the outer ring to the ring that the joint carries."""
    origin, axis, hangs = own.origin[k], own.axis[k], bool(k and meets[k - 1])
    if not hangs and not (meets[k] and k < len(meets) - 1):
        half = 2 * own.rod * axis
        return [("joint", *_between(origin - half, origin + half, 1.7 * own.rod), JOINT)]
    outer = radius[k - 1] if hangs else radius[k] + 2 * own.rod
    return [
        (name, *_between(origin + radius[k] * way, origin + outer * way, 0.8 * own.rod), JOINT)
        for name, way in (("joint", axis), ("joint_behind", -axis))
    ]


def _link(own: Bones, meets: NDArray[np.bool_], radius: Array, k: int) -> _Piece:
    """Return a rod to the next joint, a ring through its axis, or a plate for the last link."""
    origin, axis, colour = own.origin[k], own.axis[k], LINKS[k % 2]
    if not meets[k]:
        end = _short_of(own.end[k], float(radius[k + 1]) if k + 1 < len(radius) else 0.0)
        return ("rod", *_between(origin, origin + end, own.rod), colour)
    if k == len(own.links) - 1:
        half = own.rod / 2 * axis
        return ("plate", *_between(origin - half, origin + half, radius[k]), colour)
    normal = np.cross(axis, own.axis[k + 1])
    if np.linalg.norm(normal) < 1e-6:  # parallel axes
        normal = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    pose = RigidTransform(RotationMatrix.MakeFromOneVector(normal, 2), origin)
    return ("ring", _ring(radius[k], 0.6 * own.rod), pose, colour)


def _radii(own: Bones, meets: NDArray[np.bool_]) -> Array:
    """Return radii of rings [m], each larger than the next inner one."""
    longest = np.linalg.norm(own.end, axis=1).max()
    limit = _MAX_RING_SHARE * longest if longest > _MEETING * own.size else np.inf
    radii, within = np.zeros(len(meets)), 0.0
    for k in reversed(range(len(meets))):
        radii[k] = within = max(min(own.gyration[k], limit), _RING_RATIO * within, 3 * own.rod)
        if k and not meets[k - 1]:
            within = 0.0
    return radii


def _short_of(way: Array, radius: float) -> Array:
    """Return `way` [m] shortened to a ring of `radius` around its end; 0 from inside."""
    length = float(np.linalg.norm(way))
    return way * (1 - radius / length) if length > radius else 0 * way


def _between(a: Array, b: Array, radius: float) -> tuple[Shape, RigidTransform]:
    """Return a cylinder from a to b [m] and its pose."""
    length = float(np.linalg.norm(b - a))
    turned = RotationMatrix.MakeFromOneVector(b - a, 2) if length > 0 else RotationMatrix()
    return Cylinder(radius, max(length, 1e-6)), RigidTransform(turned, (a + b) / 2)


def _ring(radius: float, thickness: float) -> Mesh:
    """Return a torus about z; `radius` is that of the tube's middle [m]."""
    u, w = np.meshgrid(*(np.arange(m) * 2 * np.pi / m for m in (_AROUND, _ACROSS)), indexing="ij")
    out = radius + thickness * np.cos(w)
    corners = np.stack([out * np.cos(u), out * np.sin(u), thickness * np.sin(w)], axis=-1)
    number = np.arange(1, u.size + 1).reshape(u.shape)
    beside, above = np.roll(number, -1, axis=0), np.roll(number, -1, axis=1)
    faces = np.stack([number, beside, np.roll(beside, -1, axis=1), above], axis=-1)
    text = [f"v {x:.6g} {y:.6g} {z:.6g}" for x, y, z in corners.reshape(-1, 3)]
    for a, b, c, d in faces.reshape(-1, 4):
        text += [f"f {a} {b} {c}", f"f {a} {c} {d}"]
    return Mesh(InMemoryMesh(mesh_file=MemoryFile("\n".join(text), ".obj", "ring")))
