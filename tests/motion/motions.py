"""Commands and robots for the tests of the planners."""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import csr_array

from sdt_drake.motion import Command, Course, Motion, load_command
from sdt_drake.robot.device import Drive
from sdt_drake.robot.dynamics import inverse_dynamics
from sdt_drake.robot.motors import as_driven
from sdt_drake.robot.robot import Robot

PERIOD = 0.005
LIMITS = np.array([13655.04, 3950, 2150, 2150])
# What joint 1 turns at q = 0 [kg m²]: the links by the parallel-axis theorem, and its motor.
INERTIA_1 = (
    (9067.5 + 5600 * 0.4**2)
    + (95 + 535.8 + 249.749 + (300 + 340 + 370) * 2.6**2)
    + 67.2**2 * 0.1291
)


def knots(*points) -> Course:
    """Straight from point to point, each [time s, speed rad/s]."""
    return Course.linear(*np.transpose(np.array(points, dtype=float)))


def command(*courses: Course, q0=None, name="test") -> Command:
    q0 = np.zeros(len(courses)) if q0 is None else np.array(q0, dtype=float)
    return Command(name, courses[0].times[-1], q0, courses)


def alone(course: Course, joint: int = 1, joints: int = 4) -> Command:
    """One joint as given, the others at rest."""
    still = knots([0, 0], [course.times[-1], 0])
    return command(*(course if k + 1 == joint else still for k in range(joints)), name="alone")


# 4 s from rest to rest: arm at constant speed from 1 to 3 s, the gondola back and forth.
SHORT = command(
    knots([0, 0], [1, 0.45], [3, 0.45], [4, 0]),
    knots(*([t / 2, 1.5 * v] for t, v in enumerate([0, 1, 0, -1, 0, 1, 0, -1, 0]))),
    knots([0, 0], [1, 0.1], [3, -0.1], [4, 0]),
    knots([0, 0], [0.5, 0.2], [2, 0.2], [2.5, -0.2], [3.5, -0.2], [4, 0]),
    name="short",
)


def reference(robot: Robot) -> Command:
    return load_command("reference", robot)


def faster(robot: Robot, speed: float) -> Command:
    """The reference motion with another speed of joint 1 [rad/s]."""
    whole = reference(robot)
    first, *others = whole.joints
    first = dataclasses.replace(first, values=first.values * speed / 2.4)
    return dataclasses.replace(whole, joints=(first, *others))


def falling(robot: Robot, n1: float, n0: float) -> Robot:
    """The robot whose first motor loses its torque between two joint speeds [rad/s]."""
    n1_, n0_ = ([67.2 * x, 90.0 + k, 90.0 + k, 90.0 + k] for k, x in enumerate((n1, n0)))
    return as_driven(robot, Drive(n1=n1_, n0=n0_))


def sampled(whole: Command, period: float = PERIOD) -> Motion:
    """The motion that a command is, whatever the robot can do."""
    time = np.arange(round(whole.duration / period) + 1) * period
    return Motion.from_speeds(period, whole.q0, whole.speeds(time))


def least_time(robot: Robot, motion: Motion) -> float:
    """Least duration along a path from rest to rest, without friction: one linear program.

    Unknowns are x = s'^2 at all samples. Of two x within the limits, so is the larger at each
    sample: the fastest has the largest sum. In a cell s'' = (x[i+1] - x[i]) / (2 h); torques and
    accelerations are limited at both its ends.
    """
    h, count, n = motion.period, len(motion.q) - 1, robot.n
    rest = np.zeros_like(motion.q[1:])
    blocks, most = [], []
    for j in (0, 1):  # ends of the cells
        q, v, vd = motion.q[j : count + j], motion.v[j : count + j], motion.vd[:-1]
        gravity = inverse_dynamics(robot, q, rest, rest)
        inertia = (inverse_dynamics(robot, q, rest, v) - gravity) / (2 * h)
        velocity = inverse_dynamics(robot, q, v, vd) - gravity - robot.damping * v
        of_s2, of_x = np.hstack([inertia, v / (2 * h)]), np.hstack([velocity, vd])
        limit = np.concatenate([robot.effort_limit, np.minimum(robot.acceleration_limit, 1e9)])
        fixed = np.hstack([gravity, rest])
        of_ends = [of_x - of_s2, of_s2] if j == 0 else [-of_s2, of_x + of_s2]
        for sign in (1, -1):
            blocks.append([sign * x for x in of_ends])
            most.append(limit - sign * fixed)
    of_start, of_end = (np.array([block[k] for block in blocks]) for k in (0, 1))
    shape = of_start.shape  # (4, count, 2 n)
    rows = np.arange(of_start.size).reshape(shape)
    cells = np.broadcast_to(np.arange(count)[:, None], shape)
    A = csr_array(
        (
            np.concatenate([of_start.ravel(), of_end.ravel()]),
            (np.tile(rows.ravel(), 2), np.concatenate([cells.ravel(), cells.ravel() + 1])),
        ),
        shape=(of_start.size, count + 1),
    )
    speed = np.max(np.abs(motion.v) / np.broadcast_to(robot.velocity_limit, (n,)), axis=1)
    top = 1 / np.maximum(speed, 1) ** 2
    top[[0, -1]] = 0
    bounds = np.column_stack([np.zeros(count + 1), top])
    x = linprog(-np.ones(count + 1), A_ub=A, b_ub=np.ravel(most), bounds=bounds).x
    speed = np.sqrt(np.maximum(x, 0))
    return float(np.sum(2 * h / (speed[1:] + speed[:-1])))
