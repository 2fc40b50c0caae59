"""What the pilot feels: the motion of the head, the canals and otoliths, thresholds."""

from sdt_drake.pilot.felt import CHANNELS, DETECTORS, LINEAR, FeltDifference, felt_difference
from sdt_drake.pilot.head import (
    GRAVITY,
    HEAD_FRAME,
    HeadMotion,
    check_head,
    has_head,
    head_motion,
    head_motion_of_samples,
)
from sdt_drake.pilot.perception import (
    UNPERCEIVED_RATE,
    canals,
    false_sensation_after_stop,
    felt_upright,
)

__all__ = [
    "CHANNELS", "DETECTORS", "GRAVITY", "HEAD_FRAME", "LINEAR", "UNPERCEIVED_RATE",
    "FeltDifference", "HeadMotion", "canals", "check_head", "false_sensation_after_stop",
    "felt_difference", "felt_upright", "has_head", "head_motion", "head_motion_of_samples",
]  # fmt: skip
