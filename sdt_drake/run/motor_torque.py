"""What motors give within the periods of a run: means by the meter, peaks at the ends of parts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast

import numpy as np

from sdt_drake.io.arrays import Array, Index
from sdt_drake.robot.envelope import widened
from sdt_drake.run.controllers.base import Controller
from sdt_drake.run.design import Design
from sdt_drake.run.loop import Loop
from sdt_drake.systems import read_meter


def period_torque(loop: Loop, signals: Mapping[str, Array]) -> dict[str, Array]:
    """What the motors give in each interpolation period, their limits and drives included: columns
    of a `Recording`, motor side, shape (N + 1, n): tau_peak, tau_rms, tau_mean and saturated.

    Mean, RMS and saturation are the increments of the meter. The peak is the largest torque at the
    ends of the integrator's steps and just after updates.

    Args:
        loop: that was run.
        signals: what it recorded.
    """
    period = loop.design.reference.period
    instants = (np.arange(len(signals["metered"])) - 1e-6) * period
    before = np.searchsorted(signals["step_time"], instants)  # rows just before the updates
    size = np.abs(np.hsplit(signals["torques"], 3)[2])
    peak = np.maximum.reduceat(size[: before[-1] + 1], before[:-1] + 1)
    if loop.design.drive.torque_bandwidth is not None:  # it does not jump
        peak = np.maximum(peak, size[before[:-1]])
    elif loop.is_told:
        after = np.abs(_after_updates(loop, signals))
        peak = np.maximum(peak, after.reshape(len(peak), -1, peak.shape[1]).max(axis=1))
    limit, start = loop.design.robot.motor_torque_limit, signals["tau"][:1]
    mean, rms, share = read_meter(signals["metered"], limit, period)
    columns = {
        "tau_peak": (np.abs(start), peak),
        "tau_rms": (np.abs(start), rms),
        "tau_mean": (start, mean),
        "saturated": (np.zeros_like(start), share),
    }
    return {name: np.vstack(parts) for name, parts in columns.items()}


def _after_updates(loop: Loop, signals: Mapping[str, Array]) -> Array:
    """Torque just after each update but the last, as the controller tells, motor side [N m]."""
    design = loop.design
    drive, period = design.drive, design.reference.period
    updates = np.arange(len(signals["tau_cmd"]) - 1) * (drive.period or period)
    newest = np.maximum(np.floor((updates - drive.reference_delay) / period + 1e-6).astype(int), 0)
    controller = cast(Controller, loop.controller)
    command = controller.after_updates(signals["tau_cmd"], signals["measured"], newest)
    speed = np.zeros_like(command)  # of no interest without an envelope
    if "motor_state" in signals:
        speed = np.hsplit(signals["motor_state"], 2)[1][:-1]
    limited = np.clip(command, *torque_limits(design, newest, speed))
    return limited if drive.torque_error is None else (1 + np.array(drive.torque_error)) * limited


def arrived(design: Design, count: int) -> Index:
    """The sample of the reference that a loop has just before each of `count` updates."""
    late = design.drive.reference_delay / design.reference.period
    newest = np.ceil(np.arange(count) - late - 1e-9).astype(int) - 1
    return np.maximum(newest, 0)


def torque_limits(design: Design, newest: Index, speed: Array) -> tuple[Array, Array]:
    """Least and largest torque that the saturation lets pass, motor side [N m].

    Args:
        design: of the loop.
        newest: samples of the reference that have arrived, shape (...); see `arrived`.
        speed: of the joints, on the motors' side of elastic ones, joint side [rad/s], (..., n).

    Returns:
        Both of shape (..., n), or (n,) where they are constant.
    """
    limits = envelope(design, speed)
    if design.scenario.plant.kind == "axis":  # which widens them by what the other motors help
        return widened(*limits, design.loads.alleviating_torque[newest])
    return limits


def envelope(design: Design, speed: Array) -> tuple[Array, Array]:
    """Least and largest torque of the motors alone, motor side [N m]; see `torque_limits`."""
    limit = design.robot.motor_torque_limit
    if design.envelope is None:
        return -limit, limit
    return design.envelope.range(limit, design.robot.gear_ratio * speed)
