"""Convert a motion to the integers that drives read in every cycle, and back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.machine.drive_files.drives import INT32, OBJECTS, POSITION, SPEED, TORQUE, Drives
from sdt_drake.motion import Motion, ends_in_motion
from sdt_drake.robot.dynamics import inverse_dynamics
from sdt_drake.robot.robot import Robot

Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Samples:
    """Position, speed and torque of all joints at equal time steps, joint side."""

    period: float
    """Time between rows [s]."""
    q: Array
    """Positions [rad], shape (N + 1, n)."""
    v: Array
    """Speeds [rad/s], shape (N + 1, n)."""
    tau: Array
    """Feedforward torques, such as inverse dynamics with the motors' inertia [N m],
    shape (N + 1, n)."""

    def every(self, m: int) -> Samples:
        """Return every m-th row, with the mean speed up to the next; the last row is repeated."""
        rows = m * -(-(len(self.q) - 1) // m) + 1
        q, v, tau = (
            np.pad(x, ((0, rows - len(x)), (0, 0)), mode="edge") for x in (self.q, self.v, self.tau)
        )
        mean = v[:-1].reshape(-1, m, v.shape[1]).mean(axis=1)
        return Samples(m * self.period, q[::m], np.vstack([mean, v[-1:]]), tau[::m])


def samples_of(robot: Robot, motion: Motion, period: float, torque: Array | None = None) -> Samples:
    """Return the samples of a motion at another period, by linear interpolation of its speeds.

    The last sample is held until the end of the last step.

    Args:
        robot: robot of the inverse dynamics.
        motion: motion from rest to rest.
        period: time between rows [s].
        torque: torques that are held from each sample of the motion to the next, joint side [N m],
            shape (N + 1, n); inverse dynamics by default.

    Raises:
        InputError: if the motion does not start and end at rest.
    """
    moving = ends_in_motion(robot, motion)
    if moving:
        raise InputError(f"{moving[0]}, expected rest, as a drive starts and ends at rest")
    steps = np.ceil(motion.duration / period - 1e-6)
    t = np.minimum(np.arange(steps + 1) * period, motion.duration)
    held = np.minimum((t / motion.period + 1e-6).astype(int), len(motion.q) - 1)
    since = (t - motion.time[held])[:, None]
    vd = motion.vd[held]
    v = motion.v[held] + since * vd
    q = motion.q[held] + since * (motion.v[held] + since * vd / 2)
    tau = inverse_dynamics(robot, q, v, vd) if torque is None else torque[held]
    return Samples(period, q, v, tau)


@dataclass(frozen=True, eq=False)
class SetPoints:
    """Integers of all axes, a row for each cycle."""

    position: Integers
    """Increments, shape (N + 1, n). Each is rounded by itself, so that errors do not add up."""
    speed: Integers
    """Speeds of the cycle that begins, in the axis' unit, shape (N + 1, n): differences of
    positions on the grid of that unit. So the sum of speeds follows the positions without drift."""
    torque: Integers
    """Per mille of the rated torque, shape (N + 1, n)."""

    def of_object(self, index: str) -> Integers:
        """Return the integers of one of OBJECTS."""
        return {POSITION: self.position, SPEED: self.speed, TORQUE: self.torque}[OBJECTS[index][1]]


def set_points(robot: Robot, drives: Drives, samples: Samples) -> SetPoints:
    """Return the integers for the drives of a robot; `samples` must have their cycle time.

    Raises:
        InputError: with joint and time, for an integer beyond 32 bits (16 for torques) or a torque
            beyond the drive's maximum.
    """
    exact = drives.zeros() + samples.q @ drives.increments_per_rad(robot).T
    grid = np.round(exact * (drives.speed_per_increment() / samples.period))
    speed = np.vstack([np.diff(grid, axis=0), np.zeros_like(grid[:1])])
    torque = np.round(samples.tau @ np.linalg.inv(drives.torque_per_mille(robot)))
    for what, unit, values, limit in (
        ("position", "increments", exact, drives.max_integer(POSITION, INT32)),
        ("speed", "speed units", speed, drives.max_integer(SPEED, INT32)),
        ("torque", "per mille of the rated torque", torque, drives.max_per_mille()),
    ):
        beyond = np.argwhere(np.abs(values) > limit)
        if len(beyond):
            i, k = beyond[0]
            raise InputError(
                f"{robot.joint(k)} at {i * samples.period:.3f} s: {what} of "
                f"{values[i, k]:.0f} {unit}, its drive accepts {limit[k]:.0f}"
            )
    return SetPoints(*(np.round(x).astype(np.int64) for x in (exact, speed, torque)))


def samples_from(robot: Robot, drives: Drives, points: SetPoints, start: Array) -> Samples:
    """Return the samples that drives follow when they read their objects of set points.

    An axis without a position integrates its speeds from the joint angles `start` [rad], shape
    (n,). One without a speed uses differences of positions, one without a torque none.
    """
    per_rad, period = drives.increments_per_rad(robot), drives.cycle_time
    per_speed, per_joint = drives.speed_per_increment(), np.linalg.inv(per_rad).T
    position = points.position.astype(float)
    for k in np.flatnonzero(~drives.reads(POSITION)):
        position[0, k] = drives.zeros()[k] + per_rad[k] @ start
        travelled = np.cumsum(points.speed[:-1, k]) * period / per_speed[k]
        position[1:, k] = position[0, k] + travelled
    differences = np.vstack([np.diff(position, axis=0) / period, np.zeros(robot.n)])
    speeds = np.where(drives.reads(SPEED), points.speed / per_speed, differences)
    torque = np.where(drives.reads(TORQUE), points.torque, 0)
    return Samples(
        period,
        (position - drives.zeros()) @ per_joint,
        speeds @ per_joint,
        torque @ drives.torque_per_mille(robot),
    )
