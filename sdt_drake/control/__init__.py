"""The controllers by name, their tuning, and metrics of step responses."""

from sdt_drake.control.controllers import (
    CONTROLLERS,
    FEEDFORWARDS,
    ControllerKind,
    feedforward_torque,
    needs,
)
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
    "CONTROLLERS",
    "FEEDFORWARDS",
    "STRUCTURES",
    "ControllerKind",
    "SpeedGains",
    "StepMetrics",
    "damping_ratio",
    "feedforward_torque",
    "natural_frequency",
    "needs",
    "oscillation_frequency",
    "step_metrics",
    "tune",
]
