"""The parameters to identify, as columns of the joint torques, with their expected values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.machine.identify.base_parameters import Unknown, rigid_columns, rigid_parameters
from sdt_drake.robot.lacks import PLANNING
from sdt_drake.robot.robot import Robot

NOISE = 0.01  # standard deviation of measured torques over the largest torque
MAX_SPEED = 5.0  # largest speed of an exciting motion [rad/s]

_SIGN_WIDTH = 0.02  # speed over which friction changes its sign, over the largest speed


@dataclass(frozen=True, eq=False)
class Target:
    """The parameters that an exciting motion has to determine."""

    robot: Robot
    """The robot with kinematics, limits and expected values."""
    unknown: Unknown
    """The unknown parameters of links and motors."""
    friction: bool
    """True if viscous friction, Coulomb friction and an offset of each joint are unknown, too."""
    noise: Array
    """Standard deviation of the torque in a sample, at the gears [N m], shape (n,)."""

    @staticmethod
    def everything(robot: Robot, noise: float = NOISE) -> Target:
        """Make the target of links, motors and friction.

        Args:
            robot: The robot.
            noise: Standard deviation of torques over the largest torque [-].

        Raises:
            InputError: The file lacks masses or limits.
        """
        unknown = Unknown.everything(robot.having(*PLANNING))
        return Target(robot, unknown, True, noise * robot.effort_limit)

    @staticmethod
    def payload(robot: Robot, link: str, noise: float = NOISE) -> Target:
        """Make the target of the body that contains a link; all else is known.

        Raises:
            InputError: No joint turns this link, or the file lacks masses or limits.
        """
        unknown = Unknown.body(robot.having(*PLANNING), link)
        return Target(robot, unknown, False, noise * robot.effort_limit)

    @property
    def names(self) -> list[str]:
        """Names of the unknown parameters with their units."""
        links = [f"{name} [{_unit(name)}]" for name in self.unknown.base.words]
        if not self.friction:
            return links
        units = {"viscous friction": "N m s/rad", "Coulomb friction": "N m", "offset": "N m"}
        joints = self.robot.joint_names
        return links + [f"{x} of {joint} [{unit}]" for x, unit in units.items() for joint in joints]

    @property
    def expected(self) -> Array:
        """Values of the unknown parameters in the robot's file; NaN for friction."""
        known = rigid_parameters(self.robot)[self.unknown.columns]
        friction = np.full(3 * self.robot.n if self.friction else 0, np.nan)
        return np.concatenate([self.unknown.base.combination @ known, friction])

    def rows(self, q: Array, v: Array, vd: Array) -> tuple[Array, Array]:
        """Return the columns of the unknown parameters over the noise, shape (N, n, p).

        Returns:
            The columns, and the torque of the robot's file at the gears [N m], shape (N, n).
        """
        robot = self.robot
        rigid = rigid_columns(robot, q, v, vd)
        torque = rigid @ rigid_parameters(robot) + robot.gear_torque(robot.damping * v)
        columns = rigid[:, :, self.unknown.independent]
        if self.friction:
            slow = _SIGN_WIDTH * np.minimum(robot.velocity_limit, MAX_SPEED)
            speed = robot.gear_speed(v)
            own = (speed, np.tanh(speed / slow), np.ones_like(v))
            columns = np.concatenate([columns, *(x[:, :, None] * np.eye(robot.n) for x in own)], 2)
        return columns / self.noise[:, None], torque


def _unit(name: str) -> str:
    """Return the unit of a base parameter with this name."""
    if name.startswith("h"):
        return "kg m"
    return "kg" if name.startswith("mass of") else "kg m²"
