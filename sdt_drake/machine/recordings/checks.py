"""Checks of a recording before a fit.

They find uneven sampling, lost samples, frozen or clipped signals, and wrong units of positions,
speeds and times.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from sdt_drake.io.arrays import Array, Index, Mask
from sdt_drake.io.shown import listed
from sdt_drake.machine.recordings.recorded import Recorded
from sdt_drake.robot.robot import Robot

_UNEVEN, _EVEN = 0.1, 0.02  # deviation of a step over the median; share of uneven steps
_SMOOTHER = 0.7  # roughness over an even clock over that over the recorded times
_MIN_SHARE = 0.005  # share of samples that are repeated, missing or clipped by chance
_MIN_ROWS = 5  # repeated rows of a finding
_MIN_INCREMENTS = 3.0  # motion in a sample that an encoder resolves, in its increments
_MIN_FROZEN = 0.1  # duration of a frozen signal [s]
_MOVING = 0.1  # speed over the largest one
_EDGE = 0.01  # distance from the largest torque over the range of torques
_PILE = 5.0  # samples at the largest torque over those within _EDGE of it
_FAR, _SPEED_LIMIT = 5.0, 5.0  # value over its limit; speed limit without one in the file [rad/s]
_NEAR_LIMIT, _OFTEN = 0.98, 0.01  # torque over its limit; share of time there
_CORRELATED, _SAME = 0.5, 0.05  # squared correlation; relative difference of equal factors
_MIN_DELAY = 0.6  # delay of speeds in samples
_WINDOW = 0.2  # longest delay of speeds [s]


class Finding(NamedTuple):
    """A suspicion about a recording; `str` gives one sentence."""

    kind: str
    """One word: "uneven", "rounded", "missing", "repeated", "held", "frozen", "clipped",
    "degrees", "speeds", "late", "clock", "limit", "unit"."""
    place: str
    """Signal and joint, such as "tau_2"; "" for the whole recording."""
    number: float
    """The evidence, as described in `text`."""
    text: str
    """The finding."""
    write: str = ""
    """The remedy as an entry of the mapping file; "" if there is none."""

    @property
    def spoils(self) -> bool:
        """True if the recording must be corrected before other conclusions."""
        return self.kind in ("repeated", "frozen", "clipped", "degrees", "clock", "rounded")

    def __str__(self) -> str:
        where = f"{self.place}: {self.text}" if self.place else self.text
        return where + f" ({self.write} in the mapping file)" * bool(self.write)


def check_recording(robot: Robot, recorded: Recorded) -> Iterator[Finding]:
    """Yield suspicions about a recording, from its signals and the limits of the robot.

    Args:
        robot: The robot with its limits and gear ratios.
        recorded: A recording with q, tau or both.
    """
    yield from _sampling(recorded)
    signals = recorded.signals
    if "q" in signals:
        yield from _positions(robot, recorded)
        speed = np.abs(np.gradient(signals["q"], recorded.time, axis=0))
        moves = speed > _MOVING * np.quantile(speed, 0.99, axis=0)
        yield from _repeated(recorded, moves)
        for name in ("q", "tau"):
            if name in signals:
                yield from _frozen(recorded, name, moves)
        if "v" in signals:
            yield from _speeds(robot, recorded)
        if "tau" in signals:
            yield from _clipped(robot, recorded, moves)
    if "tau" in signals:
        yield from _torque_limits(robot, signals["tau"])


# --- times -----------------------------------------------------------------------------------


def _sampling(recorded: Recorded) -> Iterator[Finding]:
    """Check for missing samples and uneven or rounded times."""
    time = recorded.time
    steps = np.delete(np.diff(time), recorded.gaps)
    usual = float(np.median(steps))
    lost = np.round(steps / usual).astype(int) - 1
    is_whole = np.abs(steps / usual - 1 - lost) < _UNEVEN
    gone = int(lost[(lost > 0) & is_whole].sum())
    if gone > _MIN_SHARE * len(time) and is_whole.mean() > 1 - _EVEN:
        share = 100 * gone / (len(time) + gone)
        text = f"{gone} samples of {1e3 * usual:.4g} ms are missing, {share:.1f} %"
        yield Finding("missing", "time", share, text)
        return
    off = np.abs(steps / usual - 1) > _UNEVEN
    if off.mean() < _EVEN:
        return
    steps_off = f"{100 * off.mean():.0f} % of the steps differ from {1e3 * usual:.4g} ms by more "
    steps_off += f"than {100 * _UNEVEN:.0f} %"
    rate = (len(time) - 1) / float(time[-1] - time[0])
    even = time[0] + np.arange(len(time)) / rate
    if "q" in recorded.signals and not len(recorded.gaps) and np.abs(time - even).max() < 1 / rate:
        q = recorded.signals["q"]
        by_stamps, by_clock = _roughness(time, q), _roughness(even, q)
        if by_clock < _SMOOTHER * by_stamps:
            text = f"{steps_off}, and positions are {by_stamps / by_clock:.3g} times as smooth "
            text += f"over an even clock of {rate:.5g} Hz: times were rounded, or taken on writing"
            write = f"time: '', rate: {rate:.6g}"
            yield Finding("rounded", "time", by_stamps / by_clock, text, write)
            return
    text = f"{steps_off}: uneven sampling, or times that are not those of the samples"
    yield Finding("uneven", "time", float(off.mean()), text)


def _roughness(time: Array, values: Array) -> float:
    """Return the RMS distance of samples from the line between neighbours, over the spread [-]."""
    share = ((time[1:-1] - time[:-2]) / (time[2:] - time[:-2]))[:, None]
    off = values[1:-1] - (1 - share) * values[:-2] - share * values[2:]
    return float(np.sqrt(np.mean((off / np.maximum(np.std(values, axis=0), 1e-12)) ** 2)))


# --- repeated, frozen and clipped signals ----------------------------------------------------


def _increments(values: Array) -> Array:
    """Return the smallest change of each column, shape (n,): the increment of an encoder."""
    steps = np.abs(np.diff(values, axis=0))
    return np.min(np.where(steps > 0, steps, np.inf), axis=0, initial=np.inf)


def _repeated(recorded: Recorded, moves: Mask) -> Iterator[Finding]:
    """Check for rows that repeat all positions or torques of the row before, during motion."""
    q = recorded.signals["q"]
    increments = np.where(np.isfinite(_increments(q)), _increments(q), 0.0)
    wide = np.abs(q[2:] - q[:-2]) / 2 > _MIN_INCREMENTS * increments  # over two samples
    expected = np.any(wide & moves[1:-1], axis=1)
    if not expected.any():
        return
    still = {
        name: np.all(np.diff(recorded.signals[name], axis=0)[:-1] == 0, axis=1)
        for name in ("q", "tau")
        if name in recorded.signals
    }
    shares = {name: float(np.mean(rows[expected])) for name, rows in still.items()}
    rate = 1 / float(np.median(np.diff(recorded.time)))
    for name, share in shares.items():
        rows = still[name] & expected
        if share <= _MIN_SHARE or rows.sum() < _MIN_ROWS:
            continue
        if share > 1 / 3:
            text = f"each value repeats over {1 / (1 - share):.3g} rows: recorded at "
            text += f"{rate * (1 - share):.4g} Hz, not at {rate:.4g} Hz"
            late = (1 / (1 - share) - 1) / 2 / rate
            write = f"torque_delay: {late:.3g}" if name == "tau" and shares["q"] < share / 2 else ""
            yield Finding("held", name, share, text, write)
        elif name == "q" or shares["q"] <= _MIN_SHARE:
            first = recorded.time[1 + int(np.flatnonzero(rows)[0])]
            text = f"{100 * share:.1f} % of the rows repeat the one before while joints move, the "
            text += f"first at {first:.4g} s"
            yield Finding("repeated", name, share, text)


def _frozen(recorded: Recorded, name: str, moves: Mask) -> Iterator[Finding]:
    """Check for a signal that is constant for _MIN_FROZEN while its joint and others move."""
    values, time = recorded.signals[name], recorded.time
    period = float(np.median(np.diff(time)))
    least = max(5, round(_MIN_FROZEN / period))
    increments = _increments(values)
    changes = np.any(np.diff(values, axis=0) != 0, axis=1)
    for k, column in enumerate(values.T):
        starts, ends = _runs(np.diff(column) == 0)
        usual = len(column) / max(1, int(np.count_nonzero(np.diff(column))))
        for start, end in zip(starts, ends, strict=True):
            length = end - start
            is_end = name == "tau" and column[start] in (column.min(), column.max())  # clipped
            if length < max(least, 5 * usual) or is_end or changes[start:end].mean() < 0.5:
                continue
            around = moves[max(0, start - 3), k] and moves[min(len(moves) - 1, end + 3), k]
            after = column[min(len(column) - 1, end + 2)] - column[start]
            is_jump = np.abs(after) > _MIN_INCREMENTS * increments[k]
            if is_jump and (around or (name == "tau" and moves[start:end, k].mean() > 0.5)):
                text = f"frozen at {column[start]:.4g} for {length * period:.3g} s from "
                text += f"{time[start]:.4g} s while its joint moves"
                yield Finding("frozen", f"{name}_{k + 1}", float(length * period), text)
                break


def _runs(mask: Mask) -> tuple[Index, Index]:
    """Return the starts of runs of true, and the places after their ends."""
    edges = np.diff(np.concatenate([[0], mask.astype(int), [0]]))
    return np.flatnonzero(edges > 0), np.flatnonzero(edges < 0)


def _clipped(robot: Robot, recorded: Recorded, moves: Mask) -> Iterator[Finding]:
    """Check for torques that pile up at the end of their range, below the motor's limit."""
    for k, column in enumerate(robot.gear_torque(recorded.signals["tau"]).T):
        size = np.ptp(column)
        for end, is_at in ((column.max(), "largest"), (column.min(), "smallest")):
            if abs(end) >= _NEAR_LIMIT * robot.effort_limit[k] or size == 0:
                continue
            rows = moves[:, k] & (column == end)
            beside = moves[:, k] & ~rows & (np.abs(column - end) < _EDGE * size)
            longest = np.subtract(*_runs(column == end)[::-1]).max()
            is_pile = rows.mean() > _MIN_SHARE and rows.sum() > _PILE * beside.sum()
            if is_pile and longest > 3:
                text = f"clipped: at its {is_at} value, {end:.4g} N m, for "
                text += f"{100 * rows.mean():.1f} % of the time, but hardly ever near it"
                yield Finding("clipped", f"tau_{k + 1}", float(rows.mean()), text)


# --- units -----------------------------------------------------------------------------------


def _positions(robot: Robot, recorded: Recorded) -> Iterator[Finding]:
    """Check for positions in degrees, by the limits of speed and position."""
    q = recorded.signals["q"]
    usual = np.quantile(np.abs(np.gradient(q, recorded.time, axis=0)), 0.99, axis=0)
    limit = np.where(np.isinf(robot.velocity_limit), _SPEED_LIMIT, robot.velocity_limit)
    stops = robot.position_upper - robot.position_lower  # inf without stops
    over = np.flatnonzero((usual > _FAR * limit) | (np.ptp(q, axis=0) > _FAR * stops))
    if len(over):
        k = int(over[0])
        text = f"joint {k + 1} moves over {np.ptp(q[:, k]):.4g} rad at up to {usual[k]:.4g} rad/s: "
        text += "are its positions in degrees?"
        yield Finding("degrees", "", float(usual[k] / limit[k]), text, "angle: deg")


def _speeds(robot: Robot, recorded: Recorded) -> Iterator[Finding]:
    """Check recorded speeds by differences of the positions."""
    time, v = recorded.time, recorded.signals["v"]
    slope = np.gradient(recorded.signals["q"], time, axis=0)
    smooth, seen = (_smoothed(x, time) for x in (slope, v))
    ratios = np.full(robot.n, np.nan)
    for k in range(robot.n):
        if np.ptp(smooth[:, k]) < 1e-3 or not np.any(v[:, k]):
            continue
        if np.corrcoef(seen[:, k], smooth[:, k])[0, 1] ** 2 > _CORRELATED:
            ratios[k] = seen[:, k] @ smooth[:, k] / (smooth[:, k] @ smooth[:, k])
    known = np.flatnonzero(np.isfinite(ratios)).tolist()
    odd = [k for k in known if abs(ratios[k] - 1) > 0.3]
    clock = float(np.median(ratios[known])) if len(known) else 1.0
    if len(known) > 1 and len(odd) == len(known) and clock > 0:
        whys = [_reason(float(ratios[k]), float(robot.gear_ratio[k])) for k in odd]
        if not any(whys) and np.ptp(ratios[known]) < _SAME * clock:
            text = f"all speeds are {clock:.4g} times the derivatives of their positions: is a "
            text += f"second of the clock {1 / clock:.4g} s?"
            if recorded.time_factor is None:
                write = f"rate: {clock / float(np.median(np.diff(time))):.4g}"
            else:
                write = f"time_factor: {recorded.time_factor / clock:.4g}"
            yield Finding("clock", "time", clock, text, write)
            return
    for k in odd:
        why = _reason(float(ratios[k]), float(robot.gear_ratio[k]))
        text = f"is {ratios[k]:.4g} times the derivative of q_{k + 1}" + f": {why}" * bool(why)
        yield Finding("speeds", f"v_{k + 1}", float(ratios[k]), text)
    if len(known) and not odd:
        yield from _speeds_late(recorded, smooth, seen, known)


def _reason(ratio: float, gear: float) -> str:
    """Return a reason for this ratio of a speed and the derivative of its position, or ""."""
    near = {180 / np.pi: "one of them is in degrees", np.pi / 180: "one of them is in degrees"}
    near |= {-1.0: "one of them has the opposite sign", gear: "speeds are those of the motor"}
    near |= {gear * 180 / np.pi: "speeds are those of the motor, in degrees"}
    near |= {gear * 30 / np.pi: "speeds are those of the motor, in rpm"}
    fits = [text for value, text in near.items() if abs(ratio / value - 1) < 0.3]
    return fits[0] if fits and abs(ratio - 1) > 0.3 else ""


def _speeds_late(recorded: Recorded, slope: Array, v: Array, known: list[int]) -> Iterator[Finding]:
    """Check for speeds that lag behind the positions, as after a filter."""
    time = recorded.time
    period = float(np.median(np.diff(time)))
    turn = np.gradient(slope, time, axis=0)
    # v(t) = slope(t - late): to first order the part of the difference along -d(slope)/dt.
    late = np.array(
        [-(v[:, k] - slope[:, k]) @ turn[:, k] / (turn[:, k] @ turn[:, k]) for k in known]
    )
    usual = float(np.median(late))
    if usual > max(_MIN_DELAY * period, 0.002) and np.all(np.abs(late - usual) < 0.5 * usual):
        text = f"speeds are {1e3 * usual:.3g} ms behind the derivatives of the positions (of the "
        text += f"joints: {1e3 * late.min():.3g} to {1e3 * late.max():.3g} ms), as after a filter"
        yield Finding("late", "v", usual, text, "v: []")


def _smoothed(values: Array, time: Array) -> Array:
    """Return means over about _WINDOW / 2, without delay."""
    half = max(1, round(_WINDOW / 4 / float(np.median(np.diff(time)))))
    sums = np.cumsum(np.pad(values, [(half + 1, half), (0, 0)], mode="edge"), axis=0)
    return np.asarray((sums[2 * half + 1 :] - sums[: -2 * half - 1]) / (2 * half + 1))


# --- limits ----------------------------------------------------------------------------------


def _torque_limits(robot: Robot, tau: Array) -> Iterator[Finding]:
    """Check for torques beyond or at the limits of the motors."""
    tau = robot.gear_torque(tau)
    times = np.abs(tau).max(axis=0) / robot.effort_limit
    over = np.flatnonzero(times > _FAR).tolist()
    if over:
        text = f"up to {times.max():.3g} times the largest torque of the motors, joint side: wrong "
        text += "side (--side) or unit?"
        yield Finding("unit", listed([f"tau_{k + 1}" for k in over]), float(times.max()), text)
    for k in range(robot.n):
        share = float(np.mean(np.abs(tau[:, k]) >= _NEAR_LIMIT * robot.effort_limit[k]))
        if k not in over and share > _OFTEN:
            text = f"motor {k + 1} is at its limit for {100 * share:.1f} % of the time"
            yield Finding("limit", "", share, text)
