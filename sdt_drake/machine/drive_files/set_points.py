"""A motion as the integers that drives read in every cycle."""

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
    """Position, speed and torque of all joints at equal steps of time, joint side.

    Attributes:
        period: of the rows [s].
        q: [rad], shape (N + 1, n).
        v: [rad/s], shape (N + 1, n).
        tau: of motors and links, the motors' inertia included, or what else is fed forward [N m],
            shape (N + 1, n).
    """

    period: float
    q: Array
    v: Array
    tau: Array

    def every(self, m: int) -> Samples:
        """Every m-th row, with the mean speed up to the next one; it rests on its last row."""
        rows = m * -(-(len(self.q) - 1) // m) + 1
        q, v, tau = (
            np.pad(x, ((0, rows - len(x)), (0, 0)), mode="edge") for x in (self.q, self.v, self.tau)
        )
        mean = v[:-1].reshape(-1, m, v.shape[1]).mean(axis=1)
        return Samples(m * self.period, q[::m], np.vstack([mean, v[-1:]]), tau[::m])


def samples_of(robot: Robot, motion: Motion, period: float, torque: Array | None = None) -> Samples:
    """A motion at another period, by its own interpolation: its speeds are linear between samples.

    It rests on the last sample for the rest of the last step.

    Args:
        robot: of the inverse dynamics.
        motion: from rest to rest.
        period: of the rows [s].
        torque: at the samples of the motion, each held up to the next one, joint side [N m], shape
            (N + 1, n); by default that of the inverse dynamics.

    Raises:
        InputError: if it starts or ends in motion.
    """
    moving = ends_in_motion(robot, motion)
    if moving:
        raise InputError(f"{moving[0]}, expected rest: no drive starts or ends in motion")
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
    """Integers of all axes, a row for each cycle; shape (N + 1, n) each.

    Attributes:
        position: increments, each rounded by itself: they do not drift.
        speed: in the axis' unit: differences of the position on the grid of that unit, so that
            speeds add up to the positions, to an increment; of the cycle that begins.
        torque: per mille of the rated torque.
    """

    position: Integers
    speed: Integers
    torque: Integers

    def of_object(self, index: str) -> Integers:
        """What an object of OBJECTS holds."""
        return {POSITION: self.position, SPEED: self.speed, TORQUE: self.torque}[OBJECTS[index][1]]


def set_points(robot: Robot, drives: Drives, samples: Samples) -> SetPoints:
    """The integers for the drives of a robot; `samples` at their cycle time.

    Raises:
        InputError: naming joint and time: beyond 32 or 16 bits of what a drive reads, or beyond its
            largest torque.
    """
    exact = drives.zeros() + samples.q @ drives.increments_per_rad(robot).T
    grid = np.round(exact * (drives.speed_per_increment() / samples.period))
    speed = np.vstack([np.diff(grid, axis=0), np.zeros_like(grid[:1])])
    torque = np.round(samples.tau @ np.linalg.inv(drives.torque_per_mille(robot)))
    for what, unit, values, most in (
        ("position", "increments", exact, drives.most(POSITION, INT32)),
        ("speed", "speed units", speed, drives.most(SPEED, INT32)),
        ("torque", "per mille of the rated torque", torque, drives.most_per_mille()),
    ):
        beyond = np.argwhere(np.abs(values) > most)
        if len(beyond):
            i, k = beyond[0]
            raise InputError(
                f"{robot.joint(k)} at {i * samples.period:.3f} s: {what} of "
                f"{values[i, k]:.0f} {unit}, its drive takes {most[k]:.0f}"
            )
    return SetPoints(*(np.round(x).astype(np.int64) for x in (exact, speed, torque)))


def samples_from(robot: Robot, drives: Drives, points: SetPoints, start: Array) -> Samples:
    """What drives make of set points, joint side: those objects of it that each reads.

    An axis without a position integrates its speeds, from `start` [rad], shape (n,); one without a
    speed takes the differences of its positions, one without a torque none.
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
