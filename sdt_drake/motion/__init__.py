"""From commanded joint speeds to a motion that the motors can do."""

from sdt_drake.motion.command import Command
from sdt_drake.motion.drive_table import ends_in_motion, write_drive_table
from sdt_drake.motion.margins import Margins, Tightest, margins
from sdt_drake.motion.planner import INTERPOLATION_PERIOD, Plan, check_motion, plan_motion
from sdt_drake.motion.profile import (
    CommandProfile,
    Knots,
    Oscillation,
    Sampled,
    load_profile,
)
from sdt_drake.motion.resampling import Loss, import_motion, resample
from sdt_drake.motion.retiming import retime
from sdt_drake.motion.training import (
    TrainingProfile,
    find_motion,
    load_command,
    load_training,
    motion_beside,
    shipped_motions,
)
from sdt_drake.motion.trajectory import Motion

PLANNERS = {"limiter": plan_motion, "retiming": retime}
"""Each `(robot, command, *, period, torque_margin) -> Plan`."""

__all__ = [
    "INTERPOLATION_PERIOD",
    "PLANNERS",
    "Command",
    "CommandProfile",
    "Knots",
    "Loss",
    "Margins",
    "Motion",
    "Oscillation",
    "Plan",
    "Sampled",
    "Tightest",
    "TrainingProfile",
    "check_motion",
    "ends_in_motion",
    "find_motion",
    "import_motion",
    "load_command",
    "load_profile",
    "load_training",
    "margins",
    "motion_beside",
    "plan_motion",
    "resample",
    "retime",
    "shipped_motions",
    "write_drive_table",
]
