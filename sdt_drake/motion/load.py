"""From the file of a motion to its plan."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

from sdt_drake.io.arguments import a, a_path, positive, share, takes
from sdt_drake.io.errors import InputError, checked_choice, within
from sdt_drake.io.resources import find_file
from sdt_drake.motion.command import Command, TimedSegment, load_command
from sdt_drake.motion.limiter import plan_motion
from sdt_drake.motion.plan import INTERPOLATION_PERIOD, Plan, checked_plan, commanded_motion
from sdt_drake.motion.profile import IntendedIllusion, load_profile
from sdt_drake.motion.retiming import retime
from sdt_drake.motion.trajectory import Motion, import_motion
from sdt_drake.robot.robot import Robot, load_robot


class Story(NamedTuple):
    """What a motion is for, for people.

    Attributes:
        title: of the illusion; "" for none.
        feels: what the pilot should feel; "" where nobody says.
        segments: with their times in the planned motion, track after track.
        illusion: the error of feeling that is meant; None where nobody says.
    """

    title: str = ""
    feels: str = ""
    segments: tuple[TimedSegment, ...] = ()
    illusion: IntendedIllusion | None = None


def story_of(path: str | Path, robot: Robot, motion: Motion) -> Story:
    """What the file of a motion, or the shipped one of a name, says beside its numbers.

    Without segments and illusion where their times are not known: of a CSV, and of a motion that
    the planner has made longer; nor are there segments that last for nearly all of it.

    An empty one where the file has none, or is not what the motion was planned of.

    Args:
        path: as of `load_plan`.
        robot: that does it.
        motion: as planned.
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
    """What the file of a motion asks for, whether the robot can do it or not.

    Args:
        path, robot, period: as of `load_plan`.

    Raises:
        InputError: for a file that cannot be used, or does not fit the robot or the period.
    """
    file = find_file(path, "motion")
    with within(file):
        if file.suffix == ".csv":
            return import_motion(file, period)[0]
        return commanded_motion(robot, load_command(file, robot), period)


PLANNERS = {"limiter": plan_motion, "retiming": retime}
"""Each `(robot, command, *, period, torque_margin) -> Plan`."""


@takes(path=a_path, robot=a(Robot, "sdt_drake.load_robot"), period=positive, torque_margin=share)
def load_plan(
    path: str | Path,
    robot: Robot | None = None,
    *,
    period: float = INTERPOLATION_PERIOD,
    torque_margin: float = 1.0,
    planner: str = "limiter",
) -> Plan:
    """Plan the motion of a file, or the shipped one of a name.

    A command (.yaml) is planned. So is a CSV, resampled if it has to be; but one that is a motion
    at `period` already is planned only by the retiming planner, for the limiter just checked.

    Args:
        path: of the file, or the name of a shipped motion.
        robot: that has to do it; the shipped one by default.
        period: of the samples [s].
        torque_margin: share of the motors' torque that the motion may take, > 0 and at most 1 [-].
        planner: one of PLANNERS.

    Raises:
        InputError: if there is no such file, or `robot` cannot do the motion; naming an argument
            that is none.
    """
    checked_choice(planner, tuple(PLANNERS), "planner")
    robot = load_robot() if robot is None else robot
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
    raise InputError(f"{file}: expected a profile (.yaml) or a motion (.csv)")
