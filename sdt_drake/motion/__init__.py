"""Planned motions: from commanded joint speeds to a motion within the robot's limits."""

from sdt_drake.motion.command import Command, SpeedProfile, TimedSegment, command_of, load_command
from sdt_drake.motion.learned import LearnedReference, load_learned
from sdt_drake.motion.limiter import plan_motion
from sdt_drake.motion.load import PLANNERS, Planner, Story, load_commanded, load_plan, story_of
from sdt_drake.motion.plan import (
    INTERPOLATION_PERIOD,
    Margins,
    Plan,
    checked_torque,
    commanded_motion,
    ends_in_motion,
    margins,
)
from sdt_drake.motion.profile import (
    FELT_QUANTITIES,
    IntendedIllusion,
    MotionProfile,
    load_profile,
    shipped_motions,
)
from sdt_drake.motion.retiming import retime
from sdt_drake.motion.trajectory import Motion, import_motion
