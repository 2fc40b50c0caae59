"""Reading of motion profiles and motion files, and planning of their motions."""

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Literal, NamedTuple

from sdt_drake.io.arguments import a_path, instance_of, one_of, positive, share, takes
from sdt_drake.io.errors import InputError, within
from sdt_drake.io.resources import find_file
from sdt_drake.motion.command import Command, TimedSegment, load_command
from sdt_drake.motion.limiter import plan_motion
from sdt_drake.motion.plan import INTERPOLATION_PERIOD, Plan, checked_plan, commanded_motion
from sdt_drake.motion.profile import IntendedIllusion, load_profile
from sdt_drake.motion.retiming import retime
from sdt_drake.motion.trajectory import Motion, import_motion
from sdt_drake.robot.lacks import PLANNING
from sdt_drake.robot.robot import Robot, load_robot


class Story(NamedTuple):
    """The purpose of a motion, for captions and reports; empty if its file does not give it."""

    title: str = ""
    """Name of the illusion."""
    feels: str = ""
    """Sentence on what the pilot should feel."""
    segments: tuple[TimedSegment, ...] = ()
    """Segments with their times in the planned motion, track after track."""
    illusion: IntendedIllusion | None = None
    """Illusion that the motion should give."""


def story_of(path: str | Path, robot: Robot, motion: Motion) -> Story:
    """Return the title, the purpose and the segments that a motion profile gives.

    The story is empty for a CSV and for a file that cannot be read. It has no segments and no
    illusion if the planner has changed the duration: their times are then unknown. Segments that
    last for more than 0.9 of the motion are left out.

    Args:
        path: motion profile or motion file, or the name of a shipped one.
        robot: robot that does the motion.
        motion: planned motion.
    """
    try:
        file = find_file(path, "motion")
        if file.suffix not in (".yaml", ".yml"):
            return Story()
        profile, command = load_profile(file), load_command(file, robot)
    except InputError:
        return Story()
    if abs(command.duration - motion.duration) > motion.period / 2:
        return Story(profile.title, profile.feels)
    longest = 0.9 * command.duration
    segments = tuple(one for one in command.timeline if one.end - one.start < longest)
    return Story(profile.title, profile.feels, segments, profile.illusion)


def load_commanded(path: str | Path, robot: Robot, period: float) -> Motion:
    """Return the commanded motion of a file, without a check of the robot's limits.

    Args:
        path: motion profile (.yaml) or motion file (.csv), or the name of a shipped one.
        robot: robot with the joints of the motion.
        period: interpolation period [s].

    Raises:
        InputError: if the file is invalid, or does not fit the robot or the period.
    """
    file = find_file(path, "motion")
    with within(file):
        if file.suffix == ".csv":
            return import_motion(file, period)[0]
        return commanded_motion(robot, load_command(file, robot), period)


Planner = Literal["limiter", "retiming"]
PLANNERS = {"limiter": plan_motion, "retiming": retime}
"""Planners by name: functions `(robot, command, *, period, torque_margin) -> Plan`."""


@takes(
    path=a_path,
    robot=instance_of(Robot, "sdt_drake.load_robot"),
    period=positive,
    torque_margin=share,
)
def load_plan(
    path: str | Path,
    robot: Robot | None = None,
    *,
    period: float = INTERPOLATION_PERIOD,
    torque_margin: float = 1.0,
    planner: str = "limiter",
) -> Plan:
    """Read a motion and plan it.

    A motion profile (.yaml) is planned. A motion file (.csv) at another period is resampled and
    planned. A motion file at `period` is planned by the retiming planner, and only checked against
    the limits by the limiter.

    Args:
        path: motion profile or motion file, or the name of a shipped one.
        robot: robot with its limits; the shipped one by default.
        period: interpolation period [s].
        torque_margin: share of the motors' torque that may be used, in (0, 1].
        planner: "limiter" (a weak joint lags and catches up) or "retiming" (all joints slow down).

    Raises:
        InputError: if an argument or the file is invalid, or the robot cannot do the motion.

    >>> plan = load_plan("graveyard_spin")
    >>> plan.motion.duration, plan.longer
    (85.0, 0.0)
    """
    one_of(planner, "planner", tuple(PLANNERS))
    robot = (load_robot() if robot is None else robot).having(*PLANNING)
    file = find_file(path, "motion")
    plan = partial(PLANNERS[planner], robot, period=period, torque_margin=torque_margin)
    with within(file):
        if file.suffix in (".yaml", ".yml"):
            return plan(load_command(file, robot))
        if file.suffix == ".csv":
            motion, loss = import_motion(file, period)
            if loss is None and planner == "limiter":
                return checked_plan(robot, motion, motion, torque_margin)
            return replace(plan(Command.of_motion(file.stem, motion)), loss=loss)
    raise InputError(f"{file}: expected a motion profile (.yaml) or a motion file (.csv)")
