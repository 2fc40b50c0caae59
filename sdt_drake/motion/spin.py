"""Spin about the vertical for a commanded G, and alignment of a joint with the resultant."""

from dataclasses import dataclass

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.robot.robot import Robot

_GEOMETRY_TOLERANCE = 1e-6  # rad, m; round-off of angles in an SDF


@dataclass(frozen=True)
class SpinGeometry:
    """The resultant of gravity and centripetal acceleration in a spin about the vertical.

    >>> arm = SpinGeometry(radius=2.6, gravity=9.81, fastest=3.0, sign=0.0)
    >>> round(arm.speed(1.5), 3), round(arm.largest_g, 3)
    (2.054, 2.586)
    """

    radius: float
    """R, distance of the aligned (or else the last) joint's origin from the spin axis at q = 0 [m].
    The resultant differs elsewhere in the gondola."""
    gravity: float
    """g [m/s²]"""
    fastest: float
    """Speed limit of the spin joint [rad/s], inf without one."""
    sign: float
    """Sign of the aligned joint's angle that turns 'up' onto the resultant; 0 without alignment."""

    def speed(self, resultant_g: float) -> float:
        """Return the spin speed [rad/s] for a commanded G: omega² R / g = sqrt(G² - 1)."""
        ratio = np.sqrt(resultant_g - 1) * np.sqrt(resultant_g + 1)
        return float(np.sqrt(ratio * self.gravity / self.radius))

    @property
    def largest_g(self) -> float:
        """G at the speed limit of the spin joint [-]."""
        return float(np.hypot(1, self.fastest**2 * self.radius / self.gravity))

    def alignment_speed(self, omega: Array, omegad: Array) -> Array:
        """Return the speed of the aligned joint [rad/s], which keeps 'up' along the resultant.

        theta = sign atan(omega² R / g), theta' = sign 2 omega omega' R / g / (1 + (omega² R / g)²)

        Args:
            omega, omegad: spin speed [rad/s] and acceleration [rad/s²], shape (N,).
        """
        R, g = self.radius, self.gravity
        return self.sign * (2 * omega * omegad * R / g) / (1 + (omega**2 * R / g) ** 2)


def spin_geometry(robot: Robot, spin: str, align: str | None, where: str) -> SpinGeometry:
    """Return the geometry of a spin, measured with all joints at 0.

    Args:
        robot: robot with both joints.
        spin: name of the spin joint.
        align: name of the aligned joint; None for no alignment.
        where: place in error messages.

    Raises:
        InputError: if the robot has no gravity, the spin axis is not vertical, or the other joint
            is not on an arm of the spin joint or cannot align.
    """
    gravity = robot.plant.gravity_field().gravity_vector()
    g = float(np.linalg.norm(gravity))
    if g == 0:
        raise InputError(f"robot '{robot.name}' has no gravity, expected some", place=where)
    up = -gravity / g
    spin_axis, centre = robot.joint_at_zero(spin)
    if np.linalg.norm(np.cross(spin_axis, up)) > _GEOMETRY_TOLERANCE:
        raise InputError(
            f"the axis of '{spin}' is not vertical, expected a joint with a vertical axis",
            place=f"{where}.spin",
        )
    carried = align or robot.joint_names[-1]
    axis, origin = robot.joint_at_zero(carried)
    arm = origin - centre
    arm = arm - (arm @ up) * up
    radius = float(np.linalg.norm(arm))
    inboard = robot.joint_names.index(spin) < robot.joint_names.index(carried)
    if not inboard or radius < _GEOMETRY_TOLERANCE:
        key = "align" if align else "spin"
        raise InputError(
            f"'{carried}' is not on an arm of '{spin}', expected a joint that it carries around",
            place=f"{where}.{key}",
        )
    sign = 0.0
    if align is not None:
        # Turned by theta about its axis, 'up' is cos(theta) up + sin(theta) axis x up.
        towards_centre = np.cross(axis, up) @ (-arm / radius)
        if 1 - abs(towards_centre) > _GEOMETRY_TOLERANCE:
            raise InputError(
                f"the axis of '{align}' is not along the path of the arm, "
                "expected an axis that turns 'up' towards the spin axis",
                place=f"{where}.align",
            )
        sign = float(np.sign(towards_centre))
    fastest = float(robot.velocity_limit[robot.joint_names.index(spin)])
    return SpinGeometry(radius, g, fastest, sign)
