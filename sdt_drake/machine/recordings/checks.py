"""Checks of a recording before anything is fitted to it: sampling, dropouts, signals that stand or
are cut off, units of positions, speeds and times."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from sdt_drake.io.arrays import Array, Index, Mask
from sdt_drake.io.shown import listed
from sdt_drake.machine.recordings.recorded import Recorded
from sdt_drake.robot.robot import Robot

_UNEVEN, _EVEN = 0.1, 0.02  # of a step, off the usual one; share of the steps that may be
_SMOOTHER = 0.7  # over an even clock than over the recorded times
_TOLD = 0.005  # share of samples: fewer are repeated, missing or cut off by chance
_FEWEST = 5  # of rows that are told
_INCREMENTS = 3.0  # of an encoder in a sample: a joint that moves so fast changes its position
_STANDS = 0.1  # s, of a signal that changes otherwise
_MOVING = 0.1  # of the largest speed
_EDGE = 0.01  # of a torque's range, beside its end
_PILE = 5.0  # times as many samples at the end as in that edge
_FAR, _ANY_SPEED = 5.0, 5.0  # times a limit; rad/s, where the file gives none
_NEAR_LIMIT, _OFTEN = 0.98, 0.01  # of the largest torque, and the share of time there
_ALIKE, _SAME = 0.5, 0.05  # square of a correlation; of a factor
_LATE = 0.6  # of a sample
_WINDOW = 0.2  # s; delays of speeds up to that are looked for


class Finding(NamedTuple):
    """Something that looks wrong in a recording, as data; its text is one sentence.

    Attributes:
        kind: one word: "uneven", "rounded", "missing", "repeated", "held", "frozen", "clipped",
            "degrees", "speeds", "late", "clock", "limit", "unit".
        place: signal and joint, "tau_2"; "" for all.
        number: the evidence; what it is, `text` says.
        text: what was found.
        write: what to write into the mapping file; "" where nothing there would help.
    """

    kind: str
    place: str
    number: float
    text: str
    write: str = ""

    @property
    def spoils(self) -> bool:
        """Whether nothing else is to be concluded from the recording before it is mended."""
        return self.kind in ("repeated", "frozen", "clipped", "degrees", "clock", "rounded")

    def __str__(self) -> str:
        told = f"{self.place}: {self.text}" if self.place else self.text
        return told + f" ({self.write} in the mapping file)" * bool(self.write)


def check_recording(robot: Robot, recorded: Recorded) -> Iterator[Finding]:
    """What looks wrong in a recording, seen in itself and in the limits of the robot.

    Args:
        robot: gives limits and gear ratios.
        recorded: with q and tau, or some of them.
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
    time = recorded.time
    steps = np.delete(np.diff(time), recorded.gaps)
    usual = float(np.median(steps))
    lost = np.round(steps / usual).astype(int) - 1
    is_whole = np.abs(steps / usual - 1 - lost) < _UNEVEN
    gone = int(lost[(lost > 0) & is_whole].sum())
    if gone > _TOLD * len(time) and is_whole.mean() > 1 - _EVEN:
        share = 100 * gone / (len(time) + gone)
        text = f"{gone} samples of {1e3 * usual:.4g} ms are missing, {share:.1f} %"
        yield Finding("missing", "time", share, text)
        return
    off = np.abs(steps / usual - 1) > _UNEVEN
    if off.mean() < _EVEN:
        return
    told = f"{100 * off.mean():.0f} % of the steps are off {1e3 * usual:.4g} ms by more than "
    told += f"{100 * _UNEVEN:.0f} %"
    rate = (len(time) - 1) / float(time[-1] - time[0])
    even = time[0] + np.arange(len(time)) / rate
    if "q" in recorded.signals and not len(recorded.gaps) and np.abs(time - even).max() < 1 / rate:
        q = recorded.signals["q"]
        by_stamps, by_clock = _roughness(time, q), _roughness(even, q)
        if by_clock < _SMOOTHER * by_stamps:
            text = f"{told}, and positions are {by_stamps / by_clock:.3g} times as smooth over an "
            text += f"even clock of {rate:.5g} Hz: times were rounded, or stamped when written"
            write = f"time: '', rate: {rate:.6g}"
            yield Finding("rounded", "time", by_stamps / by_clock, text, write)
            return
    text = f"{told}: uneven sampling, or a clock that is not that of the samples"
    yield Finding("uneven", "time", float(off.mean()), text)


def _roughness(time: Array, values: Array) -> float:
    """How far samples are off the line between their neighbours, over the values' spread [-]."""
    share = ((time[1:-1] - time[:-2]) / (time[2:] - time[:-2]))[:, None]
    off = values[1:-1] - (1 - share) * values[:-2] - share * values[2:]
    return float(np.sqrt(np.mean((off / np.maximum(np.std(values, axis=0), 1e-12)) ** 2)))


# --- signals that stand ----------------------------------------------------------------------


def _increments(values: Array) -> Array:
    """The smallest change of each column, shape (n,): the increment of an encoder."""
    steps = np.abs(np.diff(values, axis=0))
    return np.min(np.where(steps > 0, steps, np.inf), axis=0, initial=np.inf)


def _repeated(recorded: Recorded, moves: Mask) -> Iterator[Finding]:
    """Rows whose positions, or torques, are all those of the row before, while joints move."""
    q = recorded.signals["q"]
    increments = np.where(np.isfinite(_increments(q)), _increments(q), 0.0)
    wide = np.abs(q[2:] - q[:-2]) / 2 > _INCREMENTS * increments  # seen over two samples
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
        if share <= _TOLD or rows.sum() < _FEWEST:
            continue
        if share > 1 / 3:
            text = f"each sample stands for {1 / (1 - share):.3g} rows: recorded at "
            text += f"{rate * (1 - share):.4g} Hz, not {rate:.4g}"
            late = (1 / (1 - share) - 1) / 2 / rate
            write = f"torque_delay: {late:.3g}" if name == "tau" and shares["q"] < share / 2 else ""
            yield Finding("held", name, share, text, write)
        elif name == "q" or shares["q"] <= _TOLD:
            first = recorded.time[1 + int(np.flatnonzero(rows)[0])]
            text = f"{100 * share:.1f} % of the rows repeat the one before while joints move, the "
            text += f"first at {first:.4g} s"
            yield Finding("repeated", name, share, text)


def _frozen(recorded: Recorded, name: str, moves: Mask) -> Iterator[Finding]:
    """A signal that stands for _STANDS and longer, where others of its kind change, and it does
    before and after."""
    values, time = recorded.signals[name], recorded.time
    period = float(np.median(np.diff(time)))
    least = max(5, round(_STANDS / period))
    increments = _increments(values)
    changes = np.any(np.diff(values, axis=0) != 0, axis=1)
    for k, column in enumerate(values.T):
        starts, ends = _runs(np.diff(column) == 0)
        usual = len(column) / max(1, int(np.count_nonzero(np.diff(column))))
        for start, end in zip(starts, ends, strict=True):
            length = end - start
            is_end = name == "tau" and column[start] in (column.min(), column.max())  # see below
            if length < max(least, 5 * usual) or is_end or changes[start:end].mean() < 0.5:
                continue
            around = moves[max(0, start - 3), k] and moves[min(len(moves) - 1, end + 3), k]
            after = column[min(len(column) - 1, end + 2)] - column[start]
            is_jump = np.abs(after) > _INCREMENTS * increments[k]
            if is_jump and (around or (name == "tau" and moves[start:end, k].mean() > 0.5)):
                text = f"stands at {column[start]:.4g} for {length * period:.3g} s at "
                text += f"{time[start]:.4g} s while its joint moves: frozen"
                yield Finding("frozen", f"{name}_{k + 1}", float(length * period), text)
                break


def _runs(mask: Mask) -> tuple[Index, Index]:
    """First places in runs of true, and those after their last."""
    edges = np.diff(np.concatenate([[0], mask.astype(int), [0]]))
    return np.flatnonzero(edges > 0), np.flatnonzero(edges < 0)


def _clipped(robot: Robot, recorded: Recorded, moves: Mask) -> Iterator[Finding]:
    """Torques that pile up at the end of their range, below what the motor has."""
    for k, column in enumerate(recorded.signals["tau"].T):
        size = np.ptp(column)
        for end, is_at in ((column.max(), "largest"), (column.min(), "smallest")):
            if abs(end) >= _NEAR_LIMIT * robot.effort_limit[k] or size == 0:
                continue
            rows = moves[:, k] & (column == end)
            beside = moves[:, k] & ~rows & (np.abs(column - end) < _EDGE * size)
            longest = np.subtract(*_runs(column == end)[::-1]).max()
            many = rows.mean() > _TOLD and rows.sum() > _PILE * beside.sum() and longest > 3
            if many:
                text = f"is at its {is_at} value, {end:.4g} N m, for {100 * rows.mean():.1f} % of "
                text += "the time, and hardly ever near it: clipped"
                yield Finding("clipped", f"tau_{k + 1}", float(rows.mean()), text)


# --- units -----------------------------------------------------------------------------------


def _positions(robot: Robot, recorded: Recorded) -> Iterator[Finding]:
    q = recorded.signals["q"]
    usual = np.quantile(np.abs(np.gradient(q, recorded.time, axis=0)), 0.99, axis=0)
    limit = np.where(np.isinf(robot.velocity_limit), _ANY_SPEED, robot.velocity_limit)
    stops = robot.position_upper - robot.position_lower  # inf of a joint that may turn on and on
    over = np.flatnonzero((usual > _FAR * limit) | (np.ptp(q, axis=0) > _FAR * stops))
    if len(over):
        k = int(over[0])
        text = f"joint {k + 1} moves over {np.ptp(q[:, k]):.4g} rad at up to {usual[k]:.4g} rad/s: "
        text += "are its positions in degrees?"
        yield Finding("degrees", "", float(usual[k] / limit[k]), text, "angle: deg")


def _speeds(robot: Robot, recorded: Recorded) -> Iterator[Finding]:
    """Recorded speeds against differences of the positions."""
    time, v = recorded.time, recorded.signals["v"]
    slope = np.gradient(recorded.signals["q"], time, axis=0)
    smooth, seen = (_smoothed(x, time) for x in (slope, v))
    ratios = np.full(robot.n, np.nan)
    for k in range(robot.n):
        if np.ptp(smooth[:, k]) < 1e-3 or not np.any(v[:, k]):
            continue
        if np.corrcoef(seen[:, k], smooth[:, k])[0, 1] ** 2 > _ALIKE:
            ratios[k] = seen[:, k] @ smooth[:, k] / (smooth[:, k] @ smooth[:, k])
    known = np.flatnonzero(np.isfinite(ratios)).tolist()
    odd = [k for k in known if abs(ratios[k] - 1) > 0.3]
    clock = float(np.median(ratios[known])) if len(known) else 1.0
    if len(known) > 1 and len(odd) == len(known) and clock > 0:
        whys = [_reason(float(ratios[k]), float(robot.gear_ratio[k])) for k in odd]
        if not any(whys) and np.ptp(ratios[known]) < _SAME * clock:
            text = (
                f"all speeds are {clock:.4g} times the change of their positions: is a second of "
            )
            text += f"the clock {1 / clock:.4g} s?"
            if recorded.time_factor is None:
                write = f"rate: {clock / float(np.median(np.diff(time))):.4g}"
            else:
                write = f"time_factor: {recorded.time_factor / clock:.4g}"
            yield Finding("clock", "time", clock, text, write)
            return
    for k in odd:
        why = _reason(float(ratios[k]), float(robot.gear_ratio[k]))
        text = f"is {ratios[k]:.4g} times the change of q_{k + 1}" + f": {why}" * bool(why)
        yield Finding("speeds", f"v_{k + 1}", float(ratios[k]), text)
    if len(known) and not odd:
        yield from _speeds_late(recorded, smooth, seen, known)


def _reason(ratio: float, gear: float) -> str:
    """Why a speed may be so many times the change of its position."""
    near = {180 / np.pi: "one of them is in degrees", np.pi / 180: "one of them is in degrees"}
    near |= {-1.0: "one of them is counted the other way", gear: "speeds are those of the motor"}
    near |= {gear * 180 / np.pi: "speeds are those of the motor, in degrees"}
    near |= {gear * 30 / np.pi: "speeds are those of the motor, in rpm"}
    fits = [text for value, text in near.items() if abs(ratio / value - 1) < 0.3]
    return fits[0] if fits and abs(ratio - 1) > 0.3 else ""


def _speeds_late(recorded: Recorded, slope: Array, v: Array, known: list[int]) -> Iterator[Finding]:
    """Speeds that lag behind the positions, as those of a filter do."""
    time = recorded.time
    period = float(np.median(np.diff(time)))
    turn = np.gradient(slope, time, axis=0)
    # v(t) = slope(t - late): to first order the part of the difference along -d(slope)/dt.
    late = np.array(
        [-(v[:, k] - slope[:, k]) @ turn[:, k] / (turn[:, k] @ turn[:, k]) for k in known]
    )
    usual = float(np.median(late))
    if usual > max(_LATE * period, 0.002) and np.all(np.abs(late - usual) < 0.5 * usual):
        text = f"speeds are {1e3 * usual:.3g} ms behind the change of the positions, "
        text += f"{1e3 * late.min():.3g} to {1e3 * late.max():.3g} ms by joints: filtered"
        yield Finding("late", "v", usual, text, "v: []")


def _smoothed(values: Array, time: Array) -> Array:
    """Means over about _WINDOW / 2, without delay."""
    half = max(1, round(_WINDOW / 4 / float(np.median(np.diff(time)))))
    sums = np.cumsum(np.pad(values, [(half + 1, half), (0, 0)], mode="edge"), axis=0)
    return np.asarray((sums[2 * half + 1 :] - sums[: -2 * half - 1]) / (2 * half + 1))


# --- limits ----------------------------------------------------------------------------------


def _torque_limits(robot: Robot, tau: Array) -> Iterator[Finding]:
    times = np.abs(tau).max(axis=0) / robot.effort_limit
    over = np.flatnonzero(times > _FAR).tolist()
    if over:
        text = f"at most {times.max():.3g} times what the motors can, joint side: wrong side "
        text += "(--side) or unit?"
        yield Finding("unit", listed([f"tau_{k + 1}" for k in over]), float(times.max()), text)
    for k in range(robot.n):
        share = float(np.mean(np.abs(tau[:, k]) >= _NEAR_LIMIT * robot.effort_limit[k]))
        if k not in over and share > _OFTEN:
            text = f"motor {k + 1} is at its limit for {100 * share:.1f} % of the time"
            yield Finding("limit", "", share, text)
