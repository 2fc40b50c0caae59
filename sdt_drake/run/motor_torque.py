"""Torque of the motors within the periods of a run, from its values at the ends of all steps."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, cast

import numpy as np

from sdt_drake.io.arrays import Array, Index
from sdt_drake.robot.envelope import widened
from sdt_drake.run.controllers.base import Controller
from sdt_drake.run.design import Design
from sdt_drake.run.loop import Loop
from sdt_drake.systems import mean_torque

_HAIR = 1e-6  # of a period: just before or after an instant


def period_torque(loop: Loop, signals: Mapping[str, Array]) -> dict[str, Array]:
    """Return what the motors give in each period of the reference, limits and drives included.

    In a step of the integrator the torque is the parabola through its values at both ends with the
    mean of the meter, and the command a straight line, as its limits are. The peak is the largest
    torque at the ends of steps.

    Args:
        loop: that was run.
        signals: what it recorded.

    Returns:
        Columns of a `Recording`, motor side, shape (N + 1, n): tau_peak, tau_rms, tau_mean [N m]
        and saturated [-], the share of the time.
    """
    steps, period = _steps(loop, signals), loop.design.reference.period
    mean = mean_torque(steps.metered, loop.design.robot.motor_torque_limit, steps.span)
    middle, half = steps.tau.mean(axis=0), np.diff(steps.tau, axis=0)[0] / 2
    square = mean**2 + half**2 / 3 + (middle - mean) ** 2 / 5  # by Legendre's polynomials
    above, below = steps.tau_cmd - steps.upper, steps.lower - steps.tau_cmd
    saturated = _share_above_zero(above) + _share_above_zero(below)
    ends = np.arange(round(signals["step_time"][-1] / period)) * period
    first = np.searchsorted(steps.begin, ends - _HAIR * period)

    def over_periods(x: Array) -> Array:
        return np.add.reduceat(x * steps.span, first) / period

    start = signals["tau"][:1]
    columns = {
        "tau_peak": (np.abs(start), np.maximum.reduceat(np.abs(steps.tau).max(axis=0), first)),
        "tau_rms": (np.abs(start), np.sqrt(over_periods(square))),
        "tau_mean": (start, over_periods(mean)),
        "saturated": (np.zeros_like(start), over_periods(saturated)),
    }
    return {name: np.vstack(parts) for name, parts in columns.items()}


class _Steps(NamedTuple):
    """Signals at both ends of M steps of the integrator, motor side, each of shape (2, M, n).

    Attributes:
        begin: time at which each begins [s], shape (M,).
        span: length of each [s], shape (M, 1).
        tau_cmd, tau: torque asked for, and as the drives give it [N m].
        metered: integral of the meter.
        lower, upper: least and largest torque that the saturation lets pass [N m].
    """

    begin: Array
    span: Array
    tau_cmd: Array
    tau: Array
    metered: Array
    lower: Array
    upper: Array


def _steps(loop: Loop, signals: Mapping[str, Array]) -> _Steps:
    time, design = signals["step_time"], loop.design
    begin = np.flatnonzero(np.diff(time) > 0)  # of two rows at an update, the later
    rows = np.stack([begin, begin + 1])
    after_or_before = np.array([[_HAIR], [-_HAIR]])
    newest = arrived(design, time[rows], after_or_before)
    tau_cmd, _, tau, metered = np.split(signals["torques"][rows], 4, axis=-1)
    speed = np.zeros_like(tau)  # of no interest without an envelope
    if "motor_state" in signals:
        speed = np.split(signals["motor_state"][rows], 2, axis=-1)[1]
    limits = torque_limits(design, newest, speed, loop.widened)
    lower, upper = (np.broadcast_to(limit, tau.shape) for limit in limits)
    span = np.diff(time)[begin, None]
    steps = _Steps(time[begin], span, tau_cmd, tau, metered, lower, upper)
    if loop.is_told:
        _tell_starts(loop, signals, steps)
    return steps


def _tell_starts(loop: Loop, signals: Mapping[str, Array], steps: _Steps) -> None:
    """Let steps begin with the torque just after an update, as the controller tells it."""
    drive, period = loop.design.drive, loop.updates[-1]
    updates = np.arange(len(signals["tau_cmd"]) - 1) * period
    first = np.searchsorted(steps.begin, updates - _HAIR * period)
    newest = arrived(loop.design, updates, _HAIR)
    controller = cast(Controller, loop.controller)
    after = controller.after_updates(signals["tau_cmd"], signals["measured"], newest)
    steps.tau_cmd[0, first] = after
    if drive.torque_bandwidth is None:  # else it does not jump
        error = np.array(0.0 if drive.torque_error is None else drive.torque_error)
        limited = np.clip(after, steps.lower[0, first], steps.upper[0, first])
        steps.tau[0, first] = (1 + error) * limited


def _share_above_zero(ends: Array) -> Array:
    """Share of each step for which a line between its ends, shape (2, ...), is above 0."""
    above, below = np.maximum(ends.max(axis=0), 0), np.minimum(ends.min(axis=0), 0)
    return np.divide(above, above - below, out=np.zeros_like(above), where=above > 0)


def arrived(design: Design, time: Array, margin: float | Array = -_HAIR) -> Index:
    """Return the sample of the reference that a loop has just before a time.

    Args:
        design: of the loop.
        time: [s], shape (...).
        margin: periods by which to look after each time; before it where negative.
    """
    periods = (time - design.drive.reference_delay) / design.reference.period
    return np.maximum(np.floor(periods + margin).astype(int), 0)


def torque_limits(
    design: Design, newest: Index, speed: Array, widens: bool | None = None
) -> tuple[Array, Array]:
    """Least and largest torque that the saturation lets pass, motor side [N m].

    Args:
        design: of the loop.
        newest: samples of the reference that have arrived, shape (...); see `arrived`.
        speed: of the joints, on the motors' side of elastic ones, joint side [rad/s], (..., n).
        widens: whether the help of the other motors widens the limits; as the plant has it by
            default.

    Returns:
        Both of shape (..., n), or (n,) where they are constant.
    """
    limits = envelope(design, speed)
    if design.scenario.plant.kind == "axis" if widens is None else widens:
        return widened(*limits, design.loads.alleviating_torque[newest])
    return limits


def envelope(design: Design, speed: Array) -> tuple[Array, Array]:
    """Least and largest torque of the motors alone, motor side [N m]; see `torque_limits`."""
    limit = design.robot.motor_torque_limit
    if design.envelope is None:
        return -limit, limit
    return design.envelope.range(limit, design.robot.gear_ratio * speed)
