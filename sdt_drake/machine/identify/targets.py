"""What is to be found of a robot, as columns of its torques; and what it may be expected to be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.machine.identify.base_parameters import Unknown, rigid_columns, rigid_parameters
from sdt_drake.robot.robot import Robot

NOISE = 0.01  # of the largest torque of each joint
ANY_SPEED = 5.0  # rad/s, where the file gives no limit

_SLOW = 0.02  # of the largest speed: friction changes its sign over it


@dataclass(frozen=True, eq=False)
class Target:
    """What an exciting motion is to tell of, and what of the torques is known beside it.

    Attributes:
        robot: gives kinematics, limits, and what is expected.
        unknown: which parameters of its links and motors are to be found.
        friction: whether viscous and Coulomb friction and an offset of each joint are unknown, too.
        noise: standard deviation of the torques in each sample, joint side [N m], shape (n,).
    """

    robot: Robot
    unknown: Unknown
    friction: bool
    noise: Array

    @staticmethod
    def everything(robot: Robot, noise: float = NOISE) -> Target:
        """The target of links, motors and friction; noise: over the largest torque of each joint
        [-]."""
        return Target(robot, Unknown.everything(robot), True, noise * robot.effort_limit)

    @staticmethod
    def payload(robot: Robot, link: str, noise: float = NOISE) -> Target:
        """The target of the body that a link is part of, all else being known.

        Raises:
            InputError: if no joint turns such a link.
        """
        return Target(robot, Unknown.body(robot, link), False, noise * robot.effort_limit)

    @property
    def names(self) -> list[str]:
        """Names of what is to be found, with units."""
        links = [f"{name} [{_unit(name)}]" for name in self.unknown.base.words]
        if not self.friction:
            return links
        units = {"viscous friction": "N m s/rad", "Coulomb friction": "N m", "offset": "N m"}
        joints = self.robot.joint_names
        return links + [f"{x} of {joint} [{unit}]" for x, unit in units.items() for joint in joints]

    @property
    def expected(self) -> Array:
        """Values that the robot's file expects; NaN of friction, which it does not know."""
        known = rigid_parameters(self.robot)[self.unknown.columns]
        friction = np.full(3 * self.robot.n if self.friction else 0, np.nan)
        return np.concatenate([self.unknown.base.combination @ known, friction])

    def rows(self, q: Array, v: Array, vd: Array) -> tuple[Array, Array]:
        """Columns of what is to be found, over the noise, shape (N, n, p); and the torque that the
        file expects, joint side [N m], shape (N, n)."""
        robot = self.robot
        rigid = rigid_columns(robot, q, v, vd)
        torque = rigid @ rigid_parameters(robot) + robot.damping * v
        columns = rigid[:, :, self.unknown.independent]
        if self.friction:
            slow = _SLOW * np.minimum(robot.velocity_limit, ANY_SPEED)
            own = (v, np.tanh(v / slow), np.ones_like(v))
            columns = np.concatenate([columns, *(x[:, :, None] * np.eye(robot.n) for x in own)], 2)
        return columns / self.noise[:, None], torque


def _unit(name: str) -> str:
    """Of a base parameter, by the first of its parts."""
    if name.startswith("h"):
        return "kg m"
    return "kg" if name.startswith("mass of") else "kg m²"
