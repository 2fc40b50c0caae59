"""How a spin about the vertical makes a wanted G, and how a joint aligns with it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.robot.robot import Robot

_PARALLEL = 1e-6  # rad, m; how far an SDF with rounded angles may be off


@dataclass(frozen=True)
class SpinGeometry:
    """How a spin about the vertical makes a resultant of gravity and centripetal acceleration.

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
        """Spin speed [rad/s] that makes a wanted G: omega² R / g = sqrt(G² - 1)."""
        ratio = np.sqrt(resultant_g - 1) * np.sqrt(resultant_g + 1)
        return float(np.sqrt(ratio * self.gravity / self.radius))

    @property
    def largest_g(self) -> float:
        """The G of the spin joint's speed limit [-]."""
        return float(np.hypot(1, self.fastest**2 * self.radius / self.gravity))

    def alignment_speed(self, omega: Array, omegad: Array) -> Array:
        """theta' [rad/s] of theta = sign atan(omega² R / g): 'up' stays along the resultant.

        theta' = sign 2 omega omega' R / g / (1 + (omega² R / g)²)

        Args:
            omega, omegad: spin speed [rad/s] and acceleration [rad/s²], shape (N,).
        """
        R, g = self.radius, self.gravity
        return self.sign * (2 * omega * omegad * R / g) / (1 + (omega**2 * R / g) ** 2)


def spin_geometry(robot: Robot, spin: str, align: str | None, where: str) -> SpinGeometry:
    """How a spin joint makes a resultant, from the plant at q = 0.

    Args:
        robot: has both joints.
        spin: name of the joint that spins.
        align: name of the joint that aligns what it carries; None if nothing is aligned.
        where: named in errors.

    Raises:
        InputError: if there is no gravity, the axis of spin is not vertical, or the other joint is
            not carried around by it, or cannot align.
    """
    gravity = robot.plant.gravity_field().gravity_vector()
    g = float(np.linalg.norm(gravity))
    if g == 0:
        raise InputError(f"no gravity in '{robot.name}', expected some", place=where)
    up = -gravity / g
    spin_axis, centre = robot.joint_at_zero(spin)
    if np.linalg.norm(np.cross(spin_axis, up)) > _PARALLEL:
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
    if not inboard or radius < _PARALLEL:
        key = "align" if align else "spin"
        raise InputError(
            f"'{spin}' does not carry '{carried}' around, expected a joint on an arm",
            place=f"{where}.{key}",
        )
    sign = 0.0
    if align is not None:
        # Turned by theta about its axis, 'up' is cos(theta) up + sin(theta) axis x up.
        towards_centre = np.cross(axis, up) @ (-arm / radius)
        if 1 - abs(towards_centre) > _PARALLEL:
            raise InputError(
                f"the axis of '{align}' is not along the path of the arm, "
                "expected one that turns 'up' towards the axis of spin",
                place=f"{where}.align",
            )
        sign = float(np.sign(towards_centre))
    fastest = float(robot.velocity_limit[robot.joint_names.index(spin)])
    return SpinGeometry(radius, g, fastest, sign)
