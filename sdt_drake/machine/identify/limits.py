"""Limits of an exciting motion: those of the robot's file, and assumed ones where it has none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.machine.identify.targets import MAX_SPEED
from sdt_drake.robot.robot import Robot
from sdt_drake.robot.rotors import assumed_inertia

_POSES = 200  # random poses for the least inertia


@dataclass(frozen=True, eq=False)
class Limits:
    """The limits of a motion, joint side, each of shape (n,)."""

    middle: Array
    """Middle of the position range [rad]."""
    range: Array
    """Largest distance from the middle [rad]."""
    speed: Array
    """Largest speed [rad/s]."""
    acceleration: Array
    """Largest acceleration [rad/s²]."""
    torque: Array
    """Largest torque [N m]."""

    @staticmethod
    def of(
        robot: Robot,
        margin: float,
        gently: float = 1.0,
        acceleration: Sequence[float] | None = None,
    ) -> Limits:
        """Return shares of a robot's limits; missing limits are replaced as in `assumed`.

        Args:
            robot: The robot of the file.
            margin: Share of all limits [-].
            gently: Further factor on speeds and accelerations [-].
            acceleration: Limits in place of those of the file [rad/s²], length n.
        """
        lower = np.where(np.isinf(robot.position_lower), -np.pi, robot.position_lower)
        upper = np.where(np.isinf(robot.position_upper), np.pi, robot.position_upper)
        speed = np.minimum(robot.velocity_limit, MAX_SPEED)
        highest = robot.acceleration_limit if acceleration is None else np.array(acceleration)
        if np.isinf(highest).any():
            highest = np.where(np.isinf(highest), _motor_acceleration(robot), highest)
        return Limits(
            middle=(lower + upper) / 2,
            range=margin * np.maximum(upper - lower, 1e-3) / 2,
            speed=margin * gently * speed,
            acceleration=margin * gently * highest,
            torque=margin * robot.effort_limit,
        )

    def use(self, q: Array, v: Array, vd: Array, torque: Array) -> Array:
        """Return the share of each limit that a motion uses, shape (4, ..., n)."""
        angle, speed = (q - self.middle) / self.range, v / self.speed
        return np.abs([angle, speed, vd / self.acceleration, torque / self.torque])


def _motor_acceleration(robot: Robot) -> Array:
    """Return the largest torque over the least inertia of many poses [rad/s²], shape (n,).

    Rotors that the file lacks have the assumed inertia.
    """
    plant, rng = robot.plant, np.random.default_rng(0)
    context, inertias = plant.CreateDefaultContext(), []
    for q in rng.uniform(-np.pi, np.pi, (_POSES, robot.n)):
        plant.SetPositions(context, q)
        inertias.append(plant.CalcMassMatrix(context).diagonal())
    rotors = np.where(robot.motor_inertia > 0, 0.0, assumed_inertia(robot))
    return np.asarray(robot.effort_limit / (np.min(inertias, axis=0) + rotors))


def assumed(robot: Robot, acceleration: Sequence[float] | None = None) -> list[str]:
    """Return the assumptions for limits that the robot's file does not have, as sentences."""
    notes = []
    if acceleration is None and np.isinf(robot.acceleration_limit).any():
        highest = Limits.of(robot, 1.0).acceleration
        values = ", ".join(f"{x:.3g}" for x in highest)
        rotors = " with assumed rotors" * bool(np.any(robot.motor_inertia == 0))
        notes.append(
            f"accelerations are limited to {values} rad/s²: without a limit in the file "
            f"(<drake:acceleration>), to the largest torque over the least inertia{rotors}; "
            "give those of the drives (acceleration)"
        )
    if np.any(robot.velocity_limit > MAX_SPEED):
        notes.append(f"speeds are limited to {MAX_SPEED:g} rad/s; limits of the file are higher")
    if np.isinf(robot.position_lower).any() or np.isinf(robot.position_upper).any():
        notes.append("joints without stops turn by at most half a turn to both sides of 0")
    return notes
