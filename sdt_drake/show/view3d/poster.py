"""A still picture of a scene, without a graphics card: shown before a page in 3D plays."""

import base64
import io
from typing import Any

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from pydrake.geometry import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    GeometryId,
    QueryObject,
    Rgba,
    Shape,
    Sphere,
)

from sdt_drake.io.arrays import Array
from sdt_drake.show.view3d.scene import Scene

_SIZE, _DPI = (8.0, 4.5), 100  # inch, dots per inch
_ROOM = 1.15  # width of the picture over that of the robot
_SIDES = 16  # of a circle
_LIGHT = np.array([0.3, -0.5, 0.8])  # direction to the lamp
_LONGEST = 0.4  # edge of a triangle [m]; long ones would not have one depth


def poster(scene: Scene) -> str:
    """Return a picture of a scene as it stands, as an address of the kind data:image/jpeg."""
    depths, corners, colours = [], [], []
    towards = scene.target - scene.eye
    towards /= np.linalg.norm(towards)
    right = np.cross(towards, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    view = np.array([right, np.cross(right, towards), towards])
    query = scene.query()
    for geometry in query.inspector().GetAllGeometryIds():
        faces = triangles(query, geometry) - scene.eye
        normal = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
        normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-12)[:, None]
        seen = np.einsum("ij,ij->i", normal, faces.mean(axis=1)) < 0
        shade = 0.62 + 0.38 * np.clip(normal[seen] @ _LIGHT, 0, 1)
        properties = query.inspector().GetIllustrationProperties(geometry)
        colour: Any = Rgba(0.8, 0.8, 0.8)
        if properties is not None:
            colour = properties.GetPropertyOrDefault("phong", "diffuse", colour)
        own = np.array([colour.r(), colour.g(), colour.b(), colour.a()])
        colours.append(np.column_stack([shade[:, None] * own[:3], np.full(len(shade), own[3])]))
        placed = faces[seen] @ view.T
        depths.append(placed[:, :, 2].mean(axis=1))
        corners.append(placed[:, :, :2] / placed[:, :, 2:])
    order = np.argsort(-np.concatenate(depths))
    figure = Figure(figsize=_SIZE, facecolor="#eef3f8")
    ax = figure.add_axes((0, 0, 1, 1))
    ax.add_collection(
        PolyCollection(
            list(np.concatenate(corners)[order]),
            facecolors=np.concatenate(colours)[order],
            linewidths=0,
            antialiaseds=False,
        )
    )
    points = np.concatenate(corners).reshape(-1, 2)
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    half = _ROOM * (np.ptp(points, axis=0) / _SIZE).max() / 2 * np.array(_SIZE)
    ax.set(xlim=middle[0] + [-half[0], half[0]], ylim=middle[1] + [-half[1], half[1]])
    ax.set_axis_off()
    drawn = io.BytesIO()
    figure.savefig(drawn, format="jpg", dpi=_DPI, pil_kwargs={"quality": 80})
    return "data:image/jpeg;base64," + base64.b64encode(drawn.getvalue()).decode()


def triangles(query: QueryObject, geometry: GeometryId) -> Array:
    """Return the faces of a geometry in the world [m], counterclockwise, shape (M, 3, 3)."""
    from scipy.spatial import ConvexHull

    inspector = query.inspector()
    points = _points(inspector.GetShape(geometry))
    if points is None:
        box = inspector.GetObbInGeometryFrame(geometry)
        if box is None:  # a half space
            return np.zeros((0, 3, 3))
        points = box.pose().multiply((_CORNERS * box.half_width()).T).T
    points = query.GetPoseInWorld(geometry).multiply(points.T).T
    hull = ConvexHull(points)
    faces = points[hull.simplices]
    normal = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    turned = np.einsum("ij,ij->i", normal, hull.equations[:, :3]) < 0
    faces[turned] = faces[turned][:, ::-1]
    while len(faces):
        edges = np.linalg.norm(faces - np.roll(faces, -1, axis=1), axis=2)
        long = edges.max(axis=1) > _LONGEST
        if not long.any():
            break
        faces = np.concatenate([faces[~long], _halved(faces[long], edges[long].argmax(axis=1))])
    return faces


def _halved(faces: Array, longest: Array) -> Array:
    """Return each face as two, divided in the middle of its longest edge."""
    at = np.arange(len(faces))
    a, b, c = (faces[at, (longest + k) % 3] for k in range(3))
    middle = (a + b) / 2
    return np.concatenate([np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)])


_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
_ANGLES = 2 * np.pi * np.arange(_SIDES) / _SIDES
_BALL = np.array([
    [np.cos(a) * np.sin(b), np.sin(a) * np.sin(b), np.cos(b)]
    for a in _ANGLES for b in np.pi * np.arange(9) / 8
])  # fmt: skip


def _points(shape: Shape) -> Array | None:
    """Return points whose convex hull is the shape, in its frame [m]; None for a mesh."""
    match shape:
        case Box():
            return _CORNERS * shape.size() / 2
        case Cylinder():
            ring = shape.radius() * np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)])
            ends = np.repeat([-shape.length() / 2, shape.length() / 2], _SIDES)
            return np.column_stack([np.tile(ring, (2, 1)), ends])
        case Sphere():
            return shape.radius() * _BALL
        case Ellipsoid():
            return _BALL * [shape.a(), shape.b(), shape.c()]
        case Capsule():
            shift = np.sign(_BALL[:, 2:]) * [0, 0, shape.length() / 2]
            return shape.radius() * _BALL + shift
    return None
