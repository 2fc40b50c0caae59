"""Tuning, torque feedforward, and metrics of step responses."""

from sdt_drake.control.feedforward import FEEDFORWARDS, feedforward_torque
from sdt_drake.control.step_response import StepMetrics, step_metrics
from sdt_drake.control.tuning import (
    STRUCTURES,
    SpeedGains,
    damping_ratio,
    natural_frequency,
    oscillation_frequency,
    tune,
)

__all__ = [
    "FEEDFORWARDS",
    "STRUCTURES",
    "SpeedGains",
    "StepMetrics",
    "damping_ratio",
    "feedforward_torque",
    "natural_frequency",
    "oscillation_frequency",
    "step_metrics",
    "tune",
]
