"""What motors give within the periods of a run, from what a loop logs at their ends."""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast

import numpy as np

from sdt_drake.io.arrays import Array, Index
from sdt_drake.robot.device import Drive
from sdt_drake.run.controllers import Controller
from sdt_drake.run.design import Design
from sdt_drake.run.loop import Loop

# Points within a part of a period, as shares of it: denser at its start, where torque jumps and
# then falls.
_POINTS = (np.arange(17) / 16) ** 2
_LOOKS = 3  # within a period, at a continuous controller that does not tell its command
_AT_ONCE = 256  # periods: what they need stays in the cache


def tells_command(loop: Loop) -> bool:
    """Whether what a loop logs tells its command within a period; else somebody has to look."""
    own = getattr(type(loop.controller), "memoryless", Controller.memoryless)
    knows = own is not Controller.memoryless and loop.design.drive.period is None
    return knows or _is_sampled(loop)


def _is_sampled(loop: Loop) -> bool:
    return isinstance(loop.controller, Controller) and loop.controller.is_sampled


def cuts(loop: Loop) -> Array:
    """Between which times of a period a loop's command is smooth, from 0 to the period [s].

    A period is one of the drives, or of the reference where they are continuous. The reference may
    arrive within it, and a controller that does not tell its command is looked at within, unless
    its drive holds what it sees.
    """
    drive = loop.design.drive
    period = drive.period or loop.design.reference.period
    late = drive.reference_delay % period
    if _is_sampled(loop):
        return np.array([0.0, period])
    parts = 1 if drive.period or tells_command(loop) else _LOOKS
    looks = np.linspace(0, period, parts + 1)
    return looks if min(late, period - late) < 1e-6 * period else np.union1d(looks, late)


def period_torque(
    loop: Loop, signals: Mapping[str, Array], seen: Array | None = None
) -> dict[str, Array]:
    """What the motors give in each interpolation period, their limits and drives included: columns
    of a `Recording`, motor side, shape (N + 1, n): tau_peak, tau_rms, tau_mean and saturated.

    A log shows the ends of the periods. At their starts the reference jumps, and with it what the
    controller asks for; while it is held, the integral of the error swings out. So:

    - a sampled controller asks for one torque from sample to sample, that at its end;
    - a continuous one for  y + memoryless(t),  with y and v parabolas, through both ends and the
      way that q went: a third-order error;
    - of any other system it was looked at, and is linear in between.

    Good to 0.3 % of the motor; to 2 % where the reference arrives within a period. Behind an
    elastic joint a light rotor answers a jolt faster than a parabola can: an estimate. What arrives
    between two samples of a sampled controller counts from the next one on.

    Args:
        loop: that was run.
        signals: what it logged, just before each update, the first row just after it.
        seen: command of the controller at both ends of each part between `cuts`, motor side [N m],
            shape (rows, parts, 2, n), a row for each period of the drives; needed where the loop
            does not tell it.
    """
    rows, n = np.arange(len(signals["tau"]) - 1), loop.design.robot.n
    samples = len(rows) // (len(signals["measured"]) - 1)
    chunks = np.array_split(rows, -(-len(rows) // _AT_ONCE))
    found = np.hstack([_in_rows(loop, signals, seen, at, samples) for at in chunks])
    peak, square, mean, share = found.reshape(4, -1, samples, n)
    start = signals["tau"][:1]
    columns = {
        "tau_peak": (np.abs(start), peak.max(axis=1)),
        "tau_rms": (np.abs(start), np.sqrt(square.mean(axis=1))),
        "tau_mean": (start, mean.mean(axis=1)),
        "saturated": (np.zeros_like(start), share.mean(axis=1)),
    }
    return {name: np.vstack(parts) for name, parts in columns.items()}


def _in_rows(
    loop: Loop, signals: Mapping[str, Array], seen: Array | None, at: Index, samples: int
) -> Array:
    """Peak, mean square, mean, and share saturated, of the periods `at`, (M,), of the drives, of
    which there are `samples` in one of the reference; shape (4, M, n)."""
    design, i = loop.design, at // samples
    ends, period = cuts(loop), design.reference.period
    grid = (np.outer(ends[:-1], 1 - _POINTS) + np.outer(ends[1:], _POINTS)).ravel() / ends[-1]
    # What arrives is in force from the next part on: there is a cut, but for sampled controllers.
    begun = at[:, None] / samples + np.repeat(ends[:-1], len(_POINTS)) / period
    late = design.drive.reference_delay / period
    newest = np.maximum(np.floor(begun - late + 2e-6).astype(int), 0)
    speed = _speeds(signals, i, (at % samples)[:, None] / samples + grid / samples, period)
    if _is_sampled(loop):
        command = np.repeat(signals["tau_cmd"][at + 1, None], len(grid), axis=1)
    elif seen is not None:
        way = _POINTS[:, None]
        command = (1 - way) * seen[at, :, None, 0] + way * seen[at, :, None, 1]
        command = command.reshape(speed.shape)
    else:
        command = _continuous(loop, signals, i, newest, speed, grid)
    limited = np.clip(command, *torque_limits(design, newest, speed))
    steps = np.diff(grid)
    given = _given(design.drive, limited, signals["tau"][at], steps * period / samples)
    start, end = given[:, :-1], given[:, 1:]

    squares, saturated = (start**2 + start * end + end**2) / 3, saturated_share(command, limited)
    means = [np.einsum("g,mgn->mn", steps, x) for x in (squares, (start + end) / 2, saturated)]
    return np.stack([np.abs(given).max(axis=1), *means])


def _speeds(signals: Mapping[str, Array], i: Index, share: Array, period: float) -> Array:
    """Of what the encoders are on, at shares (M, G) of the periods i, joint side [rad/s]: parabolas
    through both ends and the way that q went, shape (M, G, n)."""
    q, v = np.hsplit(signals["measured"], 2)
    bulge = 1.5 * ((q[i + 1] - q[i]) / period - (v[i] + v[i + 1]) / 2)
    s = share[..., None]
    return v[i, None] + s * (v[i + 1] - v[i])[:, None] + 4 * s * (1 - s) * bulge[:, None]


def _continuous(
    loop: Loop, signals: Mapping[str, Array], i: Index, newest: Index, speed: Array, grid: Array
) -> Array:
    """What a continuous controller asks for at shares `grid`, (G,), of the periods `i`, (M,), where
    the samples `newest`, (M, G), of the reference are in force; (M, G, n), as is `speed` there."""
    controller, period = cast(Controller, loop.controller), loop.design.reference.period
    (q, v), tau_cmd = np.hsplit(signals["measured"], 2), signals["tau_cmd"]

    def memoryless(held: Index, sample: Index, v: Array) -> Array:
        held, sample = (np.maximum(index, 0).ravel() for index in (held, sample))
        told = cast(Array, controller.memoryless(held, sample, q, v.reshape(-1, v.shape[-1])))
        return told.reshape(v.shape)

    first = (i == 0).astype(int)  # whose first torque is just after its update
    last = newest[:, -1]
    y0 = tau_cmd[i] - memoryless(last - 1 + first, i - 1 + first, v[i])
    y1 = tau_cmd[i + 1] - memoryless(last, i, v[i + 1])
    bulge = controller.integral_gain(last) * period * (v[i + 1] - v[i]) / 8
    s = grid[:, None]
    y = y0[:, None] + s * (y1 - y0)[:, None] + 4 * s * (1 - s) * bulge[:, None]
    return y + memoryless(newest, np.broadcast_to(i[:, None], newest.shape), speed)


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
        help_ = design.loads.alleviating_torque[newest]
        lower, upper = lower + np.minimum(help_, 0), upper + np.maximum(help_, 0)
    return lower, upper


def envelope(design: Design, speed: Array) -> tuple[Array, Array]:
    """Least and largest torque of the motors alone, motor side [N m]; see `torque_limits`."""
    limit = design.robot.motor_torque_limit
    if design.envelope is None:
        return -limit, limit
    return design.envelope.range(limit, design.robot.gear_ratio * speed)


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
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # as large as numbers go
        change = np.diff(command, axis=1)
        until = np.where(start == 0, 0.0, np.clip(-start / change, 0, 1))
        since = np.where(end == 0, 0.0, np.clip(end / change, 0, 1))
        return np.where(start * end > 0, 1.0, until + since)
