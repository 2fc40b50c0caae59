"""Commands and robots for the tests of the planners, and a motion in closed form."""

import numpy as np

from sdt_drake.motion import Command, Motion, SpeedProfile
from sdt_drake.robot.device import Drive
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
A_1 = LIMITS[0] / INERTIA_1  # rad/s²; what joint 1 can do alone


def knots(*points) -> SpeedProfile:
    """Straight from point to point, each [time s, speed rad/s]."""
    return SpeedProfile.linear(*np.transpose(np.array(points, dtype=float)))


def alone(speed: SpeedProfile, joint: int = 1, joints: int = 4) -> Command:
    """One joint as given, the others at rest."""
    still = knots([0, 0], [speed.times[-1], 0])
    speeds = tuple(speed if k + 1 == joint else still for k in range(joints))
    return Command("alone", speed.times[-1], np.zeros(joints), speeds)


SWING = alone(knots([0, 0], [2, 1], [4, 0]))
"""It needs 0.5 / A_1 of the torque: 0.67."""


def falling(robot: Robot, n1: float, n0: float) -> Robot:
    """The robot whose first motor loses its torque between two joint speeds [rad/s]."""
    return as_driven(robot, Drive(n1=[67.2 * n1, 90, 90, 90], n0=[67.2 * n0, 91, 91, 91]))


def sampled(whole: Command, period: float = PERIOD) -> Motion:
    """The motion that a command is, whatever the robot can do."""
    time = np.arange(round(whole.duration / period) + 1) * period
    return Motion.from_speeds(period, whole.q0, whole.speeds(time))


TIME = np.arange(401) * 0.005  # 2 s


def smooth(robot, time=TIME):
    """Angles, speeds and accelerations of joints that all turn."""
    a, w = np.linspace(0.3, 0.6, robot.n), np.linspace(1.0, 2.5, robot.n)
    s, c = np.sin(np.outer(time, w)), np.cos(np.outer(time, w))
    return a * s, a * w * c, -a * w**2 * s
