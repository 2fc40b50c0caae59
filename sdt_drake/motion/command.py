"""Joint speeds that a training motion commands: courses in pieces, and a gondola aligned with G."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sdt_drake.errors import InputError
from sdt_drake.robot import Robot

Array = NDArray[np.float64]

_PARALLEL = 1e-6  # rad, m; how far an SDF with rounded angles may be off


@dataclass(frozen=True, eq=False)
class Course:
    """A speed in m pieces, each linear or along half a cosine.

    Attributes:
        times: [s], growing, shape (m + 1,).
        values: speed at these times [rad/s], shape (m + 1,).
        cosine: whether a piece is along a cosine, shape (m,).
    """

    times: Array
    values: Array
    cosine: NDArray[np.bool_]

    @staticmethod
    def at_rest(duration: float) -> Course:
        """No speed for `duration` [s]."""
        return Course(np.array([0.0, duration]), np.zeros(2), np.array([False]))

    def speed(self, time: Array) -> Array:
        """[rad/s] at `time` [s], shape (N,)."""
        i, s, _ = self._piece(time)
        share = np.where(self.cosine[i], (1 - np.cos(np.pi * s)) / 2, s)
        return self.values[i] + np.diff(self.values)[i] * share

    def acceleration(self, time: Array) -> Array:
        """[rad/s²] at `time` [s], shape (N,); where it jumps, that of the later piece."""
        i, s, duration = self._piece(time)
        share = np.where(self.cosine[i], np.pi / 2 * np.sin(np.pi * s), 1.0)
        return np.diff(self.values)[i] / duration * share

    def _piece(self, time: Array) -> tuple[NDArray[np.intp], Array, Array]:
        """Number of the piece, share of it that is over [-], and how long it is [s]."""
        last = len(self.cosine) - 1
        i = np.clip(np.searchsorted(self.times, time, side="right") - 1, 0, last)
        duration = np.diff(self.times)[i]
        return i, np.clip((time - self.times[i]) / duration, 0, 1), duration


@dataclass(frozen=True)
class SpinGeometry:
    """How a spin about the vertical makes a resultant.

    Attributes:
        radius: R, of the origin of the aligned joint (of the last joint if none is aligned) about
            the axis of spin, at q = 0 [m]. Elsewhere in the gondola the resultant is another one.
        gravity: g [m/s²].
        fastest: speed limit of the spin joint [rad/s], inf where there is none.
        sign: of the angle that turns 'up' onto the resultant about the aligned joint's axis; 0 if
            none is aligned.
    """

    radius: float
    gravity: float
    fastest: float
    sign: float

    def speed(self, resultant_g: float) -> float:
        """Spin speed [rad/s] that makes G: omega² R / g = sqrt(G² - 1)."""
        ratio = np.sqrt(resultant_g - 1) * np.sqrt(resultant_g + 1)
        return float(np.sqrt(ratio * self.gravity / self.radius))

    @property
    def largest_g(self) -> float:
        """The G of the speed limit."""
        return float(np.hypot(1, self.fastest**2 * self.radius / self.gravity))


@dataclass(frozen=True, eq=False)
class Alignment:
    """Turns 'up' of what a joint carries onto gravity plus centripetal acceleration.

    theta = sign atan(omega² R / g), so theta' = sign 2 omega omega' R / g / (1 + (omega² R / g)²)

    Attributes:
        joint: number of the joint, from 0.
        spin: omega.
        geometry: R, g and the sign.
    """

    joint: int
    spin: Course
    geometry: SpinGeometry

    def speed(self, time: Array) -> Array:
        """theta' [rad/s] at `time` [s], shape (N,)."""
        R, g = self.geometry.radius, self.geometry.gravity
        omega, omegad = self.spin.speed(time), self.spin.acceleration(time)
        return self.geometry.sign * (2 * omega * omegad * R / g) / (1 + (omega**2 * R / g) ** 2)


@dataclass(frozen=True, eq=False)
class Command:
    """Commanded joint speeds of a training motion.

    Attributes:
        name: of the motion.
        duration: [s].
        q0: joint angles at the start [rad], shape (n,).
        joints: speed of each joint, base to tip, without alignment.
        alignment: what one joint does beside that; None for nothing.
    """

    name: str
    duration: float
    q0: Array
    joints: tuple[Course, ...]
    alignment: Alignment | None

    def start(self) -> Array:
        """Joint angles at time 0 [rad], shape (n,)."""
        return self.q0.copy()

    def corners(self) -> Array:
        """Times [s] between which every speed goes one way, growing."""
        return np.unique(np.concatenate([course.times for course in self.joints]))

    def speeds(self, time: Array) -> Array:
        """Commanded joint speeds [rad/s] at `time` [s] of shape (N,), shape (N, n)."""
        v = np.stack([course.speed(time) for course in self.joints], axis=1)
        if self.alignment is not None:
            v[:, self.alignment.joint] += self.alignment.speed(time)
        return v


def spin_geometry(robot: Robot, spin: str, align: str | None, where: str) -> SpinGeometry:
    """How a spin joint makes a resultant, from the plant at q = 0.

    Args:
        robot: has both joints.
        spin: name of the joint that spins.
        align: name of the joint that aligns what it carries; None if nothing is aligned.
        where: named in errors.

    Raises:
        InputError: naming `where`, if there is no gravity, the axis of spin is not vertical, or
            the other joint is not carried around by it, or cannot align.
    """
    gravity = robot.plant.gravity_field().gravity_vector()
    g = float(np.linalg.norm(gravity))
    if g == 0:
        raise InputError(f"{where}: no gravity in '{robot.name}', expected some")
    up = -gravity / g
    spin_axis, centre = _axis_and_origin(robot, spin)
    if np.linalg.norm(np.cross(spin_axis, up)) > _PARALLEL:
        raise InputError(
            f"{where}.spin: the axis of '{spin}' is not vertical, "
            "expected a joint with a vertical axis"
        )
    carried = align or robot.joint_names[-1]
    axis, origin = _axis_and_origin(robot, carried)
    arm = origin - centre
    arm = arm - (arm @ up) * up
    radius = float(np.linalg.norm(arm))
    inboard = robot.joint_names.index(spin) < robot.joint_names.index(carried)
    if not inboard or radius < _PARALLEL:
        key = "align" if align else "spin"
        raise InputError(
            f"{where}.{key}: '{spin}' does not carry '{carried}' around, expected a joint on an arm"
        )
    sign = 0.0
    if align is not None:
        # Turned by theta about its axis, 'up' is cos(theta) up + sin(theta) axis x up.
        towards_centre = np.cross(axis, up) @ (-arm / radius)
        if 1 - abs(towards_centre) > _PARALLEL:
            raise InputError(
                f"{where}.align: the axis of '{align}' is not along the path of the arm, "
                "expected one that turns 'up' towards the axis of spin"
            )
        sign = float(np.sign(towards_centre))
    fastest = float(robot.velocity_limit[robot.joint_names.index(spin)])
    return SpinGeometry(radius, g, fastest, sign)


def _axis_and_origin(robot: Robot, name: str) -> tuple[Array, Array]:
    """Axis and origin [m] of a joint in the world at q = 0."""
    context = robot.plant.CreateDefaultContext()
    robot.plant.SetPositions(context, np.zeros(robot.n))
    joint = robot.plant.GetJointByName(name)
    pose = joint.frame_on_parent().CalcPoseInWorld(context)
    return pose.rotation().matrix() @ joint.revolute_axis(), pose.translation()
