"""Limits of a motion that excites a robot: those of its file, and what is assumed without them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.machine.identify.targets import ANY_SPEED
from sdt_drake.robot.robot import Robot

_POSES = 200  # in which inertias are looked at


@dataclass(frozen=True, eq=False)
class Limits:
    """What a motion may take; joint side, each of shape (n,).

    Attributes:
        middle, range: positions are within range of the middle [rad].
        speed, acceleration, torque: largest ones [rad/s, rad/s², N m]; inf for none.
    """

    middle: Array
    range: Array
    speed: Array
    acceleration: Array
    torque: Array

    @staticmethod
    def of(
        robot: Robot,
        margin: float,
        gently: float = 1.0,
        acceleration: Sequence[float] | None = None,
    ) -> Limits:
        """The share `margin` of the limits of a robot; of speeds and accelerations `gently` of
        that. What the file does not limit is as `assumed` says; acceleration: other limits than
        the file's, n of them [rad/s²].
        """
        lower = np.where(np.isinf(robot.position_lower), -np.pi, robot.position_lower)
        upper = np.where(np.isinf(robot.position_upper), np.pi, robot.position_upper)
        speed = np.minimum(robot.velocity_limit, ANY_SPEED)
        highest = robot.acceleration_limit if acceleration is None else np.array(acceleration)
        if np.isinf(highest).any():
            highest = np.where(np.isinf(highest), _what_motors_give(robot), highest)
        return Limits(
            middle=(lower + upper) / 2,
            range=margin * np.maximum(upper - lower, 1e-3) / 2,
            speed=margin * gently * speed,
            acceleration=margin * gently * highest,
            torque=margin * robot.effort_limit,
        )

    def use(self, q: Array, v: Array, vd: Array, torque: Array) -> Array:
        """Share of each limit that a motion uses, shape (4, ..., n)."""
        return np.abs(
            [
                (q - self.middle) / self.range,
                v / self.speed,
                vd / self.acceleration,
                torque / self.torque,
            ]
        )


def _what_motors_give(robot: Robot) -> Array:
    """Largest torque over the least inertia about each joint, in many poses [rad/s²], shape (n,):
    in others the torque alone limits."""
    plant, rng = robot.plant, np.random.default_rng(0)
    context, inertias = plant.CreateDefaultContext(), []
    for q in rng.uniform(-np.pi, np.pi, (_POSES, robot.n)):
        plant.SetPositions(context, q)
        inertias.append(plant.CalcMassMatrix(context).diagonal())
    return np.asarray(robot.effort_limit / np.min(inertias, axis=0))


def assumed(robot: Robot, acceleration: Sequence[float] | None = None) -> list[str]:
    """What is assumed where the robot's file has no limits, in sentences."""
    said = []
    if acceleration is None and np.isinf(robot.acceleration_limit).any():
        highest = Limits.of(robot, 1.0).acceleration
        values = ", ".join(f"{x:.3g}" for x in highest)
        said.append(
            f"accelerations are limited to {values} rad/s²: where the file has none "
            "(<drake:acceleration>), by the largest torque over the least inertia; "
            "--acceleration says what the drives allow"
        )
    if np.any(robot.velocity_limit > ANY_SPEED):
        said.append(f"no joint moves faster than {ANY_SPEED:g} rad/s, whatever its file allows")
    if np.isinf(robot.position_lower).any() or np.isinf(robot.position_upper).any():
        said.append("joints without stops turn by at most half a turn to both sides of 0")
    return said
