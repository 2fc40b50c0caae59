"""A robot in 3D with sliders, axes and masses: live in Meshcat, and as an offline page."""

import re
import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.geometry import Ellipsoid, Meshcat, Rgba, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.tree import RigidBody

from sdt_drake.io.arrays import Array
from sdt_drake.io.files import write_text
from sdt_drake.io.shown import joint_count, numbered
from sdt_drake.robot.parsed import parts_of
from sdt_drake.robot.robot import Robot
from sdt_drake.robot.rotors import without_friction, without_rotors
from sdt_drake.robot.shapes import drawable
from sdt_drake.show.documents import html_of, render_html
from sdt_drake.show.sections import Block, Table, bullets
from sdt_drake.show.view3d.scene import FIELD_OF_VIEW, FRAME_RATE, WIDTH, Frames, Scene
from sdt_drake.show.view3d.viewer import freeing_meshcat, in_browser, open_meshcat, page_with
from sdt_drake.systems.skeleton import arrow, bones

MASS = (0.85, 0.25, 0.1)
"""Colour of centres of mass and ellipsoids of inertia, RGB in 0..1."""

_AXES, _MASSES = "axes", "masses"  # paths of the scene
_STEP = 0.01  # of sliders [rad]
_TURNED = np.pi / 2  # angle of a single joint that the camera must show, too [rad]


@dataclass(frozen=True, eq=False)
class Link:
    """A moving link, with all joints at 0."""

    name: str
    path: str
    """The path in the scene."""
    joint: int
    """The last joint before the link, counted from 0."""
    pose: RigidTransform
    """The pose in the world."""
    mass: float
    """The mass [kg]."""
    centre: Array
    """The centre of mass, in the link [m], shape (3,)."""
    semi_axes: Array
    """The semi-axes of the homogeneous ellipsoid with the link's inertia [m], shape (3,)."""
    turned: RotationMatrix
    """The rotation from the ellipsoid's axes to the link."""


def moving_links(robot: Robot) -> list[Link]:
    """Return all moving links, base to tip."""
    plant, context = robot.plant, robot.context_at_zero()
    return [
        _link(body, k, plant.EvalBodyPoseInWorld(context, body))
        for k, name in enumerate(robot.joint_names)
        for body in plant.GetBodiesWeldedTo(plant.GetJointByName(name).child_body())
    ]


def _link(body: RigidBody, joint: int, pose: RigidTransform) -> Link:
    """Describe a body. The second moments of mass of an ellipsoid are m a² / 5."""
    mass, centre, central = parts_of(body) if body.default_mass() > 0 else _NOTHING
    second, axes = np.linalg.eigh(np.trace(central) / 2 * np.eye(3) - central)
    if np.linalg.det(axes) < 0:
        axes[:, 0] *= -1
    semi_axes = np.sqrt(5 * np.maximum(second, 0) / mass) if mass > 0 else np.zeros(3)
    path = "/robot/" + body.scoped_name().get_full().replace("::", "/")
    turned = RotationMatrix.ProjectToRotationMatrix(axes)
    return Link(body.name(), path, joint, pose, mass, centre, semi_axes, turned)


_NOTHING = 0.0, np.zeros(3), np.zeros((3, 3))


# --- in numbers ----------------------------------------------------------------------------------


def sentence(robot: Robot, links: Sequence[Link]) -> str:
    """Return a sentence with the robot's joints and moving mass."""
    mass = sum(link.mass for link in links)
    return f"{robot.name}: {joint_count(robot.n)}, {mass:.5g} kg of moving links"


def limits_of_use(robot: Robot) -> list[str]:
    """Return what a robot's file lacks, and what that means, as sentences."""
    left_out = filter(None, (without_rotors(robot), without_friction(robot)))
    return [*map(str, robot.lacks), *left_out]


def joint_table(robot: Robot) -> Table:
    """Make the table of the joints' limits and motors."""
    lower, upper = np.degrees(robot.position_lower), np.degrees(robot.position_upper)
    rows = [
        (
            name,
            "revolute" if np.isfinite([lower[k], upper[k]]).any() else "continuous",
            f"{_or_any(lower[k])} to {_or_any(upper[k])}".replace("any to any", "any"),
            _or_any(np.degrees(robot.velocity_limit[k])),
            _or_any(robot.effort_limit[k], 5).replace("any", "unknown"),
            f"{robot.gear_ratio[k]:.5g}",
            f"{robot.rotor_inertia[k]:.4g}",
        )
        for k, name in enumerate(numbered(robot.joint_names))
    ]
    return Table(
        ("joint", "type", "angle [deg]", "speed [deg/s]", "torque [N m]", "gear ratio",
         "rotor, motor side [kg m²]"), rows,
    )  # fmt: skip


def link_table(links: Sequence[Link]) -> Table:
    """Make the table of the links' masses, centres of mass and ellipsoids of inertia."""
    rows = [
        (
            link.name,
            f"{link.mass:.5g}",
            ", ".join(f"{x:.4g}" for x in link.centre),
            ", ".join(f"{x:.3g}" for x in sorted(link.semi_axes, reverse=True)),
        )
        for link in links
    ]
    return Table(
        ("link", "mass [kg]", "centre of mass, in the link [m]", "ellipsoid's semi-axes [m]"), rows
    )


def _or_any(limit: float, digits: int = 4) -> str:
    return f"{limit:.{digits}g}" if np.isfinite(limit) else "any"


# --- the scene -----------------------------------------------------------------------------------


class RobotScene:
    """A robot in Meshcat at any joint angles, with its axes and masses.

    Attributes:
        scene: the scene of the robot.
        links: the moving links.
        marks: drawn axes and masses by path: the joint that moves each, from 0, and its pose in the
            world with all joints at 0.
    """

    def __init__(self, robot: Robot, meshcat: Meshcat) -> None:
        q = np.vstack([np.zeros((1, robot.n)), *(x * np.eye(robot.n) for x in (_TURNED, -_TURNED))])
        low, high = (np.nan_to_num(x) for x in (robot.position_lower, robot.position_upper))
        self.robot, self.start = robot, np.clip(0.0, low, high)
        self.scene = Scene(robot, Frames(np.arange(len(q)) / FRAME_RATE, q), meshcat)
        self.links = moving_links(robot)
        self.marks: dict[str, tuple[int, RigidTransform]] = {}
        self._draw_masses(meshcat)
        if self.scene.has_shapes:
            self._draw_axes(meshcat)
        self.place(self.start)

    def _draw_masses(self, meshcat: Meshcat) -> None:
        least = 0.004 * bones(self.robot).size
        for link in self.links:
            if link.mass > 0:
                path = f"/{_MASSES}/{link.name}"
                meshcat.SetObject(f"{path}/centre", Sphere(2 * least), Rgba(*MASS))
                body = Ellipsoid(*np.maximum(link.semi_axes, least))
                meshcat.SetObject(f"{path}/ellipsoid", body, Rgba(*MASS, 0.3))
                at = link.pose @ RigidTransform(link.turned, link.centre)
                self.marks[path] = link.joint, at

    def _draw_axes(self, meshcat: Meshcat) -> None:
        own = bones(self.robot)
        for k in range(self.robot.n):
            for name, shape, pose, colour in arrow(own, k, 0.1 * own.size):
                path = f"/{_AXES}/{name}_{k}"
                meshcat.SetObject(path, shape, Rgba(*colour))
                self.marks[path] = k, pose

    def place(self, q: Array) -> None:
        """Move the joints to these angles [rad], shape (n,)."""
        self.scene.place(q)
        plant = self.robot.plant
        context = plant.CreateDefaultContext()
        plant.SetPositions(context, q)
        bodies = [plant.GetJointByName(name).child_body() for name in self.robot.joint_names]
        zero = self.robot.context_at_zero()
        moved = [
            plant.EvalBodyPoseInWorld(context, body)
            @ plant.EvalBodyPoseInWorld(zero, body).inverse()
            for body in bodies
        ]
        for path, (joint, pose) in self.marks.items():
            self.scene.meshcat.SetTransform(path, moved[joint] @ pose)

    def data(self) -> dict[str, object]:
        """Return the data of the page's script: joints [deg, m], and poses of moving objects at 0.

        Axes and origins of the joints are in the world.
        """
        places = [self.robot.joint_at_zero(name) for name in self.robot.joint_names]
        low, high = self.ranges()
        moved = [(link.path, link.joint, link.pose) for link in self.links]
        moved += [(path, *mark) for path, mark in self.marks.items()]
        return {
            "joints": [
                {"name": name, "axis": axis.tolist(), "origin": origin.tolist(),
                 **dict(zip(("low", "high", "start"), row, strict=True))}
                for name, (axis, origin), row in zip(
                    numbered(self.robot.joint_names), places,
                    np.degrees([low, high, self.start]).T.round(1).tolist(), strict=True,
                )
            ],
            "moved": [
                {"path": path.strip("/").split("/"), "joint": joint,
                 "pose": pose.GetAsMatrix4().T.ravel().tolist()}
                for path, joint, pose in moved
            ],
        }  # fmt: skip

    def ranges(self) -> tuple[Array, Array]:
        """Return the least and the largest angle of the sliders [rad], shape (n,).

        A joint without stops has a whole turn.
        """
        low, high = self.robot.position_lower, self.robot.position_upper
        return np.where(np.isfinite(low), low, -np.pi), np.where(np.isfinite(high), high, np.pi)


@freeing_meshcat()
def robot_html(robot: Robot, path: Path) -> None:
    """Write a page that shows a robot, with sliders for its joints and tables of its data.

    Raises:
        InputError: if its shapes cannot be drawn, or the file cannot be written.
    """
    meshcat = open_meshcat()
    shown = RobotScene(robot, meshcat)
    overlay = render_html(
        "robot_viewer.html.j2",
        title=robot.name,
        sentence=sentence(robot, shown.links),
        file=robot.path.name,
        notes=html_of(_notes(robot)),
        tables=html_of([joint_table(robot), link_table(shown.links)]),
        data=shown.data(),
        axes=_AXES if shown.scene.has_shapes else "",
        masses=_MASSES,
        eye=in_browser(shown.scene.eye),
        target=in_browser(shown.scene.target),
        field=FIELD_OF_VIEW,
        width=WIDTH,
    )
    write_text(path, page_with(meshcat, robot.name, overlay))


def _notes(robot: Robot) -> list[Block]:
    """Return what was changed on reading the robot's file, and what is not drawn."""
    accepted, left_out = robot.accepted, drawable(robot)[1]
    lacking = limits_of_use(robot)
    changed = f"Changed on reading {robot.path.name}:"
    return [
        *([changed, bullets(accepted)] if accepted else []),
        *(["For use beyond this view:", bullets(lacking)] if lacking else []),
        *(["Not drawn:", bullets(left_out)] if left_out else []),
    ]


@freeing_meshcat()
def show_robot(
    robot: Robot, *, port: int | None, once: bool, announce: Callable[[str], None]
) -> None:
    """Show a robot in a browser with Meshcat's sliders for its joints, until Ctrl-C.

    Masses are hidden at first; Meshcat's list of the scene shows them.

    Args:
        robot: the robot, with the shapes of its file.
        port: port of the server on this machine; by default the first free one from 7000 on.
        once: return when the robot is drawn.
        announce: function that is called with the address of the page.
    """
    meshcat = open_meshcat(port)
    shown = RobotScene(robot, meshcat)
    shown.scene.overview()
    meshcat.SetProperty(f"/{_MASSES}", "visible", False)
    names = [slider_name(name) for name in numbered(robot.joint_names)]
    for name, *numbers in zip(names, *shown.ranges(), shown.start, strict=True):
        low, high, start = map(float, numbers)
        meshcat.AddSlider(name, min=low, max=high, step=_STEP, value=start)
    try:
        announce(meshcat.web_url())
        q = shown.start
        while True:
            chosen = np.array([meshcat.GetSliderValue(name) for name in names])
            if not np.array_equal(chosen, q):
                shown.place(q := chosen)
                meshcat.Flush()
            if once:
                return
            clock.sleep(1 / FRAME_RATE)
    except KeyboardInterrupt:
        return


def slider_name(name: str) -> str:
    """Return a joint's name for a slider, with "_" for characters that HTML or scripts may need.

    Meshcat shows the names of sliders as HTML, and evaluates a script that contains them.

    >>> slider_name("2 arm's <pitch>")
    '2 arm_s _pitch_'
    """
    return re.sub(r"[^\w .:+-]", "_", name)
