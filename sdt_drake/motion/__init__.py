"""From commanded joint speeds to a motion that the motors can do."""

from sdt_drake.motion.planner import Plan, check_motion, plan_motion
from sdt_drake.motion.profile import (
    CommandProfile,
    Knots,
    Oscillation,
    Sampled,
    load_profile,
)
from sdt_drake.motion.trajectory import Motion

__all__ = [
    "CommandProfile",
    "Knots",
    "Motion",
    "Oscillation",
    "Plan",
    "Sampled",
    "check_motion",
    "load_profile",
    "plan_motion",
]
