"""Commands and robots for the tests of the planners."""

from __future__ import annotations

import dataclasses

import numpy as np
from test_robot import ARM

from sdt_drake.motion import Command, Course, Motion, load_command
from sdt_drake.robot.device import Drive
from sdt_drake.robot.motors import as_driven
from sdt_drake.robot.robot import Robot, load_robot

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


def write_robot(folder, text: str, *changes: tuple[str, str]) -> Robot:
    """A robot of an SDF text with some changes."""
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path = folder / "robot.sdf"
    path.write_text(text, encoding="utf-8")
    return load_robot(path)


def falling(robot: Robot, n1: float, n0: float) -> Robot:
    """The robot whose first motor loses its torque between two joint speeds [rad/s]."""
    n1_, n0_ = ([67.2 * x, 90.0 + k, 90.0 + k, 90.0 + k] for k, x in enumerate((n1, n0)))
    return as_driven(robot, Drive(n1=n1_, n0=n0_))


def tough_swing(folder) -> tuple[Robot, Command]:
    """A textbook arm of much friction and weak motors, and a swing of its first joint."""
    changes = ("<damping>0.7", "<damping>20"), ("<effort>90", "<effort>45")
    swing = knots([0, 0], [0.1, 1], [0.6, 1], [1, 0])
    swing = command(swing, knots([0, 0], [1, 0]), q0=[-1.5, 0.2])
    return write_robot(folder, ARM, *changes), swing


def sampled(whole: Command, period: float = PERIOD) -> Motion:
    """The motion that a command is, whatever the robot can do."""
    time = np.arange(round(whole.duration / period) + 1) * period
    return Motion.from_speeds(period, whole.q0, whole.speeds(time))


# Texts of profiles: what moves, and a way back from a wanted G.
SPIN = "resultant: {spin: planetary}"
ALIGNED = "resultant: {spin: planetary, align: roll}"
ROLL, YAW, PLANETARY = "joint: roll", "joint: yaw", "joint: planetary"
BACK = "!Ramp {at: 12, to_g: 1, duration: 6}"


def profile_text(*tracks, duration=20, more=""):
    """YAML of a profile with `tracks`, each what moves and its segments."""
    text = f"name: test\nduration: {duration}\n{more}\ntracks:\n"
    for what, *segments in tracks:
        text += f"  - {what}\n    segments:\n" + "".join(f"      - {s}\n" for s in segments)
    return text
