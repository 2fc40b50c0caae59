"""Torque of the motors within each period, from values logged at the integrator's steps."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from sdt_drake.io.arrays import Array, Index
from sdt_drake.robot.envelope import widened
from sdt_drake.run.design import Design
from sdt_drake.run.loop import Loop
from sdt_drake.run.recorded import after_updates
from sdt_drake.systems import mean_torque

_MARGIN = 1e-6
"""Distance from an instant to look just before or after it [interpolation periods]."""


def period_torque(loop: Loop, signals: Mapping[str, Array]) -> dict[str, Array]:
    """Return torque and saturation of the motors in each period of the reference.

    Within a step of the integrator, the torque is taken as the parabola through its values at both
    ends with the mean that the meter gives. Command and limits are taken as straight lines. The
    peak is the largest torque at the ends of steps.

    Args:
        loop: the loop that was run.
        signals: the signals that it recorded, see `recorded`.

    Returns:
        Columns of a `Recording`, motor side, shape (N + 1, n): tau_peak, tau_rms, tau_mean [N m]
        and saturated, the saturated share of the period [-].
    """
    steps, period = _steps(loop, signals), loop.design.reference.held.period
    mean = mean_torque(steps.metered, loop.design.device.simulated.motor_torque_limit, steps.span)
    middle, half = steps.tau.mean(axis=0), np.diff(steps.tau, axis=0)[0] / 2
    square = mean**2 + half**2 / 3 + (middle - mean) ** 2 / 5  # by Legendre's polynomials
    above, below = steps.tau_cmd - steps.upper, steps.lower - steps.tau_cmd
    saturated = _share_above_zero(above) + _share_above_zero(below)
    ends = np.arange(round(signals["step_time"][-1] / period)) * period
    first = np.searchsorted(steps.begin, ends - _MARGIN * period)

    def over_periods(x: Array) -> Array:
        return np.add.reduceat(x * steps.span, first) / period

    start = signals["tau"][:1]
    columns = {
        "tau_peak": (np.abs(start), np.maximum.reduceat(np.abs(steps.tau).max(axis=0), first)),
        "tau_rms": (np.abs(start), np.sqrt(over_periods(square))),
        "tau_mean": (start, over_periods(mean)),
        "saturated": (np.zeros_like(start), np.minimum(over_periods(saturated), 1.0)),
    }
    return {name: np.vstack(parts) for name, parts in columns.items()}


class _Steps(NamedTuple):
    """Signals at both ends of M steps of the integrator, motor side, shape (2, M, n)."""

    begin: Array
    """Start of each step [s], shape (M,)."""
    span: Array
    """Length of each step [s], shape (M, 1)."""
    tau_cmd: Array
    """Commanded torque [N m]."""
    tau: Array
    """Torque of the motors [N m]."""
    metered: Array
    """Integral of the meter."""
    lower: Array
    """Lower limit of the saturation [N m]."""
    upper: Array
    """Upper limit of the saturation [N m]."""


def _steps(loop: Loop, signals: Mapping[str, Array]) -> _Steps:
    """Return the steps of the integrator, without the zero-length ones at updates."""
    time, design = signals["step_time"], loop.design
    begin = np.flatnonzero(np.diff(time) > 0)  # the later of two rows at an update
    rows = np.stack([begin, begin + 1])
    after_or_before = np.array([[_MARGIN], [-_MARGIN]])
    newest = arrived(design, time[rows], after_or_before)
    tau_cmd, _, tau, metered = np.split(signals["torques"][rows], 4, axis=-1)
    speed = np.zeros_like(tau)  # not used without an envelope
    if "motor_state" in signals:
        speed = np.split(signals["motor_state"][rows], 2, axis=-1)[1]
    limits = torque_limits(design, newest, speed)
    lower, upper = (np.broadcast_to(limit, tau.shape) for limit in limits)
    span = np.diff(time)[begin, None]
    steps = _Steps(time[begin], span, tau_cmd, tau, metered, lower, upper)
    if (D := loop.feedthrough) is not None:
        _set_starts(loop, D, signals, steps)
    return steps


def _set_starts(
    loop: Loop, D: Mapping[str, Array], signals: Mapping[str, Array], steps: _Steps
) -> None:
    """Set the torque at the start of steps to that just after an update, from the controller."""
    drive, period = loop.design.drive, loop.updates[-1]
    updates = np.arange(len(signals["tau_cmd"]) - 1) * period
    first = np.searchsorted(steps.begin, updates - _MARGIN * period)
    newest = arrived(loop.design, updates, _MARGIN)
    after = after_updates(loop.design, D, signals["tau_cmd"], signals["measured"], newest)
    steps.tau_cmd[0, first] = after
    if drive.torque_bandwidth is None:  # a torque loop does not jump
        error = np.array(0.0 if drive.torque_error is None else drive.torque_error)
        limited = np.clip(after, steps.lower[0, first], steps.upper[0, first])
        steps.tau[0, first] = (1 + error) * limited


def _share_above_zero(ends: Array) -> Array:
    """Return the share of each step in which the line between its ends, (2, ...), exceeds 0."""
    above, below = np.maximum(ends.max(axis=0), 0), np.minimum(ends.min(axis=0), 0)
    return np.divide(above, above - below, out=np.zeros_like(above), where=above > 0)


def arrived(design: Design, time: Array, margin: float | Array = -_MARGIN) -> Index:
    """Return the newest sample of the reference that has arrived just before a time.

    Args:
        design: the design of the loop.
        time: times [s], shape (...).
        margin: shift of each time [interpolation periods]; negative for just before.
    """
    periods = (time - design.drive.reference_delay) / design.reference.held.period
    return np.maximum(np.floor(periods + margin).astype(int), 0)


def torque_limits(design: Design, newest: Index, speed: Array) -> tuple[Array, Array]:
    """Return lower and upper torque limit of the saturation, motor side [N m].

    Args:
        design: the design of the loop.
        newest: newest samples of the reference, shape (...); see `arrived`.
        speed: speed of the motors, joint side [rad/s], shape (..., n).

    Returns:
        Two arrays of shape (..., n), or (n,) if the limits are constant.
    """
    limits = motor_limits(design, speed)
    if design.widens_limits:
        return widened(*limits, design.loads.alleviating_torque[newest])
    return limits


def motor_limits(design: Design, speed: Array) -> tuple[Array, Array]:
    """Return lower and upper torque limit of the motors alone, motor side [N m], (..., n)."""
    limit = design.device.simulated.motor_torque_limit
    if design.envelope is None:
        return -limit, limit
    return design.envelope.range(limit, design.device.simulated.gear_ratio * speed)
