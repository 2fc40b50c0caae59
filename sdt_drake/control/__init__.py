"""Tuning of the PI speed controllers, and metrics of step responses."""

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
    "STRUCTURES",
    "SpeedGains",
    "StepMetrics",
    "damping_ratio",
    "natural_frequency",
    "oscillation_frequency",
    "step_metrics",
    "tune",
]
