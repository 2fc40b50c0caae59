"""What motors give within the periods of a run, from what a loop logs at their ends."""

from __future__ import annotations

from typing import NamedTuple, cast

import numpy as np
from pydrake.systems.framework import System

from sdt_drake.arrays import Array, Index
from sdt_drake.controllers import Controller
from sdt_drake.design import Design
from sdt_drake.device import Drive

# Points within a period, as shares of it: denser at its start, where torque jumps and then falls.
_GRID = (np.arange(17) / 16) ** 2
_AT_ONCE = 4096  # periods: what they need stays in the cache


class PeriodTorque(NamedTuple):
    """Torque of the motors in each interpolation period, each of shape (N, n).

    Attributes:
        peak: largest magnitude, motor side [N m].
        rms: root of the mean square, motor side [N m].
        mean: with its sign, motor side [N m].
        saturated: share of the period in which the motor gives less than is asked [-].
    """

    peak: Array
    rms: Array
    mean: Array
    saturated: Array


class Seen(NamedTuple):
    """What a controller was seen to command within its periods, linear between.

    Attributes:
        shares: of a period at which it was looked at, from 0 to 1, shape (M,); those within twice,
            just before the updates there and just after.
        command: motor side [N m], shape (periods, M, n).
    """

    shares: Array
    command: Array


def knows_its_command(controller: System) -> bool:
    """Whether a controller tells what it commands within a period, from what is logged."""
    if not isinstance(controller, Controller):
        return False
    return controller.is_sampled or type(controller).memoryless is not Controller.memoryless


def period_torque(
    design: Design,
    controller: System,
    q: Array,
    v: Array,
    tau_cmd: Array,
    tau: Array,
    seen: Seen | None = None,
) -> PeriodTorque:
    """What the motors give in each interpolation period, their limits and drives included.

    A log shows the ends of the periods. At their starts the reference jumps, and with it what the
    controller asks for; while it is held, the integral of the error swings out. So:

    - a sampled controller asks for one torque from sample to sample, that at its end;
    - a continuous one for  y + memoryless(t),  with y and v parabolas, through both ends and the
      way that q went: a third-order error;
    - of any other system it was looked at, at both ends and within.

    Good to 0.3 % of the motor; to 2 % where the reference arrives within a period. Behind an
    elastic joint a light rotor answers a jolt faster than a parabola can: an estimate. What arrives
    between two samples of a sampled controller counts from the next one on.

    Args:
        design, controller: of the loop.
        q, v: as measured, at the samples, joint side [rad, rad/s], shape (N + 1, n).
        tau_cmd, tau: just before each update of the controller, the first row just after it; motor
            side [N m], shape (N k + 1, n) with k samples of the controller per period.
        seen: what it was seen to command in its N k periods; needed where it does not know it.
    """
    n, drive = design.robot.n, design.drive
    samples = (len(tau_cmd) - 1) // (len(q) - 1)
    is_sampled = isinstance(controller, Controller) and controller.is_sampled
    whole, late = divmod(drive.reference_delay / design.motion.period + 1e-9, 1.0)
    if late < 1e-6 or is_sampled or seen is not None:
        late = 0.0
    grid = _GRID if seen is None else seen.shares
    grid = np.sort([*grid, late, late]) if late else grid
    steps = np.diff(grid)
    peaks, squares, means, saturated = [], [], [], []
    rows = np.arange(len(tau_cmd) - 1)
    for at in np.array_split(rows, -(-len(rows) // _AT_ONCE)):
        i = at // samples
        newest = i - int(whole)
        begin = (at % samples)[:, None, None] / samples
        speed = v[i, None] + (begin + grid[:, None] / samples) * (v[i + 1] - v[i])[:, None]
        if is_sampled:
            command = np.repeat(tau_cmd[at + 1, None], len(grid), axis=1)
        elif seen is not None:
            command = seen.command[at]
        elif isinstance(controller, Controller):
            command = _continuous(controller, (grid, late), (i, newest), design, q, v, tau_cmd)
        limited = np.clip(command, *torque_limits(design, newest[:, None], speed))
        given = _given(drive, limited, tau[at], steps * design.motion.period / samples)
        start, end = given[:, :-1], given[:, 1:]
        peaks.append(np.abs(given).max(axis=1))
        squares.append(_mean(steps, (start**2 + start * end + end**2) / 3))
        means.append(_mean(steps, (start + end) / 2))
        saturated.append(_mean(steps, saturated_share(command, limited)))
    peak, square, mean, share = (
        np.vstack(parts).reshape(-1, samples, n) for parts in (peaks, squares, means, saturated)
    )
    rms = np.sqrt(square.mean(axis=1))
    return PeriodTorque(peak.max(axis=1), rms, mean.mean(axis=1), share.mean(axis=1))


def _mean(steps: Array, of_parts: Array) -> Array:
    """Over a period, of values (M, len(steps), n) of its parts."""
    return np.asarray(np.einsum("g,mgn->mn", steps, of_parts))


def _continuous(
    controller: Controller,
    points: tuple[Array, float],
    periods: tuple[Index, Index],
    design: Design,
    q: Array,
    v: Array,
    tau_cmd: Array,
) -> Array:
    """What a continuous controller asks for in some periods, shape (M, points, n).

    Args:
        controller: of the loop.
        points: shares of a period, and that at which the reference arrives, twice among them.
        periods: their numbers i, and those of the samples of the reference that arrive in them.
        design: of the loop.
        q, v, tau_cmd: of the whole run, see `period_torque`.
    """
    (grid, late), (i, newest), period = points, periods, design.motion.period

    def memoryless(held: Index, sample: Index, speed: Array) -> Array:
        told = controller.memoryless(np.maximum(held, 0), np.maximum(sample, 0), q, speed)
        return cast(Array, told)

    first = (i == 0).astype(int)  # whose first torque is just after its update
    y0 = tau_cmd[i] - memoryless(newest - 1 + first, i - 1 + first, v[i])
    y1 = tau_cmd[i + 1] - memoryless(newest, i, v[i + 1])
    change = v[i + 1] - v[i]
    bulge_y = controller.integral_gain(np.maximum(newest, 0)) * period * change / 8
    bulge_v = 1.5 * ((q[i + 1] - q[i]) / period - (v[i] + v[i + 1]) / 2)
    arrives = np.searchsorted(grid, late, side="right") - 1
    parts = []
    for g, s in enumerate(grid):
        hump = 4 * s * (1 - s)
        speed = v[i] + s * change + hump * bulge_v
        rest = memoryless(newest - (g < arrives), i, speed)
        parts.append(y0 + s * (y1 - y0) + hump * bulge_y + rest)
    return np.stack(parts, axis=1)


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
    lower, upper = envelope(design, speed)
    if design.scenario.plant.kind == "axis":  # which widens them by what the other motors help
        help_ = design.loads.alleviating_torque[np.maximum(newest, 0)]
        lower, upper = lower + np.minimum(help_, 0), upper + np.maximum(help_, 0)
    return lower, upper


def envelope(design: Design, speed: Array) -> tuple[Array, Array]:
    """Least and largest torque of the motors alone, motor side [N m]; see `torque_limits`."""
    limit, drive = design.robot.motor_torque_limit, design.drive
    if drive.n1 is None or drive.n0 is None:
        return -limit, limit
    n1, n0 = np.array(drive.n1), np.array(drive.n0)
    motor_speed = design.robot.gear_ratio * speed
    down, up = (limit * np.clip((n0 - w) / (n0 - n1), 0, 1) for w in (-motor_speed, motor_speed))
    return -down, up


def _given(drive: Drive, limited: Array, before: Array, steps: Array) -> Array:
    """What the torque loop makes of `limited`, linear in each step [s]; `before` at the start."""
    asked = limited if drive.torque_error is None else (1 + np.array(drive.torque_error)) * limited
    if drive.torque_bandwidth is None:
        return asked
    lag = 1 / (2 * np.pi * drive.torque_bandwidth)
    given = [before]
    for g, step in enumerate(steps):
        if step == 0:  # the reference arrives
            given.append(given[-1])
            continue
        behind = lag * (asked[:, g + 1] - asked[:, g]) / step  # of a ramp, in the long run
        fades = (given[-1] - asked[:, g] + behind) * np.exp(-step / lag)
        given.append(asked[:, g + 1] - behind + fades)
    return np.stack(given, axis=1)


def saturated_share(command: Array, limited: Array) -> Array:
    """Share of each part of a period in which a command is beyond its limit, linear within.

    Args:
        command, limited: before and after the saturation, at the ends of the parts, (M, G, n).

    Returns:
        [-], shape (M, G - 1, n).
    """
    beyond = command - limited
    start, end = beyond[:, :-1], beyond[:, 1:]
    change = np.diff(command, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        until = np.where(start == 0, 0.0, np.clip(-start / change, 0, 1))
        since = np.where(end == 0, 0.0, np.clip(end / change, 0, 1))
    return np.where(start * end > 0, 1.0, until + since)
