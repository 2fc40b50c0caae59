"""Checks of a recording before a fit.

They find uneven sampling, lost samples, frozen or clipped signals, and wrong units of positions,
speeds and times.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from sdt_drake.io.arrays import Array, Index, Mask
from sdt_drake.io.shown import listed
from sdt_drake.machine.diagnose import constants as c
from sdt_drake.machine.diagnose.angles import beyond, other_meanings
from sdt_drake.machine.diagnose.finding import Finding, finding
from sdt_drake.machine.recordings.recorded import Recorded
from sdt_drake.robot.robot import Robot


def check_recording(robot: Robot, recorded: Recorded) -> list[Finding]:
    """Return what a recording shows by itself, from its signals and the limits of the robot.

    Args:
        robot: The robot with its limits and gear ratios.
        recorded: A recording with q, tau or both.
    """
    found = _checked(robot, recorded)
    return [replace(one, source=recorded.path.name) for one in found]


def _checked(robot: Robot, recorded: Recorded) -> Iterator[Finding]:
    if recorded.by_names:
        orders = [f"{name}: [{', '.join(own)}]" for name, own in recorded.by_names.items()]
        yield finding("order", (), ", ".join(orders), signals=listed([*recorded.by_names]))
    yield from _sampling(recorded)
    signals = recorded.signals
    if "q" in signals:
        yield from _positions(robot, recorded)
        speed = np.abs(np.gradient(signals["q"], recorded.time, axis=0))
        moves = speed > c.MOVING * np.quantile(speed, 0.99, axis=0)
        yield from _repeated(recorded, moves)
        for name in ("q", "tau"):
            if name in signals:
                yield from _all_frozen(recorded, name, moves)
                yield from _frozen(recorded, name, moves)
        if "v" in signals:
            yield from _speeds(robot, recorded)
        if "tau" in signals:
            yield from _clipped(robot, recorded, moves)
    if "tau" in signals:
        yield from _torque_limits(robot, signals["tau"])


# --- times -----------------------------------------------------------------------------------


def _sampling(recorded: Recorded) -> Iterator[Finding]:
    """Check for missing samples, and for uneven times that are not those of the samples.

    Times that are uneven as the samples are need no remedy.
    """
    time, usual = recorded.time, recorded.period
    steps = np.delete(np.diff(time), recorded.gaps) / usual
    lost = np.round(steps).astype(int) - 1
    is_whole = np.abs(steps - 1 - lost) < c.UNEVEN_STEP
    gone = int(lost[(lost > 0) & is_whole].sum())
    if gone > c.CHANCE_SHARE * len(time) and is_whole.mean() > 1 - c.UNEVEN_SHARE:
        share = gone / (len(time) + gone)
        yield finding("missing", samples=gone, share=share, step_s=usual)
        return
    share = float(np.mean(np.abs(steps - 1) > c.UNEVEN_STEP))
    if share < c.UNEVEN_SHARE:
        return
    differ = {"share": share, "step_s": usual, "more": c.UNEVEN_STEP}
    rate = (len(time) - 1) / float(time[-1] - time[0])
    if "q" not in recorded.signals:
        return
    even, q = time[0] + np.arange(len(time)) / rate, recorded.signals["q"]
    smoother = _roughness(time, q) / max(_roughness(even, q), 1e-12)
    if smoother < 1 / c.SMOOTHER:
        return
    if np.abs(time - even).max() < 1 / rate:
        remedy = f"time: '', rate: {rate:.6g}"
        yield finding("rounded", (), remedy, smoother=smoother, rate_Hz=rate, **differ)
    else:  # samples may be missing, too
        yield finding("uneven", smoother=smoother, **differ)


def _roughness(time: Array, values: Array) -> float:
    """Return the RMS distance of samples from the line between neighbours, over the spread [-]."""
    share = ((time[1:-1] - time[:-2]) / (time[2:] - time[:-2]))[:, None]
    off = values[1:-1] - (1 - share) * values[:-2] - share * values[2:]
    return float(np.sqrt(np.mean((off / np.maximum(np.std(values, axis=0), 1e-12)) ** 2)))


# --- repeated, frozen and clipped signals ----------------------------------------------------


def _increments(values: Array) -> Array:
    """Return the smallest change of each column, shape (n,): the increment of an encoder."""
    steps = np.abs(np.diff(values, axis=0))
    least = np.min(np.where(steps > 0, steps, np.inf), axis=0, initial=np.inf)
    return np.where(np.isfinite(least), least, 0.0)


def _repeated(recorded: Recorded, moves: Mask) -> Iterator[Finding]:
    """Check for rows that repeat all positions or torques of the row before, during motion.

    Longer runs of them are left to `_all_frozen`, unless they are usual.
    """
    q, rate = recorded.signals["q"], 1 / recorded.period
    wide = np.abs(q[2:] - q[:-2]) / 2 > c.RESOLVED * _increments(q)  # over two samples
    expected = np.any(wide & moves[1:-1], axis=1)
    if not expected.any():
        return
    still = {
        name: np.all(np.diff(recorded.signals[name], axis=0)[:-1] == 0, axis=1) & expected
        for name in ("q", "tau")
        if name in recorded.signals
    }
    for rows in still.values():
        runs = [np.arange(*run) for run in zip(*_long_runs(rows, recorded), strict=True)]
        if sum(map(len, runs)) < c.HELD_SHARE * expected.sum():
            rows[np.concatenate([*runs, []]).astype(int)] = False
    shares = {name: float(rows.sum() / expected.sum()) for name, rows in still.items()}
    for name, share in shares.items():
        if share <= c.CHANCE_SHARE or still[name].sum() < c.MIN_REPEATED_ROWS:
            continue
        if share > c.HELD_SHARE:
            rows = 1 / (1 - share)
            rates = {"own_Hz": rate / rows, "rate_Hz": rate}
            late = (rows - 1) / 2 / rate
            is_alone = name == "tau" and shares["q"] < share / 2
            remedy = f"torque_delay: {late:.3g}" if is_alone else ""
            yield finding("held", (), remedy, signal=name, share=share, rows=rows, **rates)
        elif name == "q" or shares["q"] <= c.CHANCE_SHARE:
            first = float(recorded.time[1 + int(still[name].argmax())])
            yield finding("repeated", signal=name, share=share, first_s=first)


def _all_frozen(recorded: Recorded, name: str, moves: Mask) -> Iterator[Finding]:
    """Check for all joints' values of a signal that stand together while another signal goes on.

    Torques stand while joints move. After positions stood, one is off by more than the steps
    around tell, unlike at the end of a stop.
    """
    values, others = recorded.signals[name], [x for x in recorded.signals if x != name]
    steps = np.abs(np.diff(values, axis=0))
    if not others:
        return
    goes_on = np.any([np.any(np.diff(recorded.signals[x], axis=0), axis=1) for x in others], axis=0)
    usual = np.quantile(steps, 0.99, axis=0)
    for start, end in zip(
        *_long_runs(np.asarray(np.all(steps == 0, axis=1)), recorded), strict=True
    ):
        if not 0 < start < end < len(steps) or np.mean(goes_on[start:end]) < 0.5:
            continue
        jumps = steps[end] > c.JUMP * np.maximum(usual, c.JUMP * steps[start - 1])
        if jumps.any() or (name == "tau" and np.any(moves[start:end].mean(axis=0) > 0.5)):
            lasts, first = (end - start + 1) * recorded.period, recorded.time[start]
            stands = {"duration_s": float(lasts), "first_s": float(first)}
            yield finding("frozen/all", signal=name, **stands)


def _long_runs(mask: Mask, recorded: Recorded) -> tuple[Index, Index]:
    """Return starts of runs of true of at least FROZEN_TIME, and the places after their ends."""
    starts, ends = _runs(mask)
    is_long = ends - starts >= max(c.MIN_FROZEN_ROWS, round(c.FROZEN_TIME / recorded.period))
    return starts[is_long], ends[is_long]


def _frozen(recorded: Recorded, name: str, moves: Mask) -> Iterator[Finding]:
    """Check for a signal that is constant for FROZEN_TIME while its joint and others move."""
    values, time, period = recorded.signals[name], recorded.time, recorded.period
    increments = _increments(values)
    changes = np.any(np.diff(values, axis=0) != 0, axis=1)
    for k, column in enumerate(values.T):
        usual = len(column) / max(1, int(np.count_nonzero(np.diff(column))))
        for start, end in zip(*_long_runs(np.diff(column) == 0, recorded), strict=True):
            length = end - start
            is_end = name == "tau" and column[start] in (column.min(), column.max())  # clipped
            if length < 5 * usual or is_end or changes[start:end].mean() < 0.5:
                continue
            around = moves[max(0, start - 3), k] and moves[min(len(moves) - 1, end + 3), k]
            after = column[min(len(column) - 1, end + 2)] - column[start]
            is_jump = np.abs(after) > c.RESOLVED * increments[k]
            if is_jump and (around or (name == "tau" and moves[start:end, k].mean() > 0.5)):
                lasts, first, value = (
                    float(x) for x in (length * period, time[start], column[start])
                )
                stands = {"duration_s": lasts, "first_s": first, "value": value}
                yield finding("frozen", (k + 1,), signal=name, **stands)
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
            if abs(end) >= c.AT_LIMIT * robot.effort_limit[k] or size == 0:
                continue
            rows = moves[:, k] & (column == end)
            beside = moves[:, k] & ~rows & (np.abs(column - end) < c.EDGE * size)
            longest = np.subtract(*_runs(column == end)[::-1]).max()
            is_pile = rows.mean() > c.CHANCE_SHARE and rows.sum() > c.PILE * beside.sum()
            if is_pile and longest > c.MIN_CLIPPED_ROWS:
                share = float(rows.mean())
                yield finding("clipped", (k + 1,), end=is_at, torque_N_m=float(end), share=share)


# --- units -----------------------------------------------------------------------------------


def _positions(robot: Robot, recorded: Recorded) -> Iterator[Finding]:
    """Check for positions in another unit or of the motors."""
    q, over = recorded.signals["q"], beyond(robot, recorded, recorded.signals["q"])
    likely = other_meanings(robot, recorded)
    if not (likely or over.any()):
        return
    k = int(over.argmax())
    usual = float(np.quantile(np.abs(np.gradient(q[:, k], recorded.time)), 0.99))
    turns = {"range_rad": float(np.ptp(q[:, k])), "speed_rad_s": usual}
    if not likely:
        yield finding("degrees/beyond", (k + 1,), **turns)
        return
    words = " or ".join(x.words for x in likely)
    remedy = " or ".join(", ".join(f"{x}: {y}" for x, y in one.changes.items()) for one in likely)
    then = float(np.ptp(likely[0].q[:, k]))
    yield finding("degrees", (k + 1,), remedy, meaning=words, then_rad=then, **turns)


def _speeds(robot: Robot, recorded: Recorded) -> Iterator[Finding]:
    """Check recorded speeds by differences of the positions."""
    time, v = recorded.time, recorded.signals["v"]
    slope = np.gradient(recorded.signals["q"], time, axis=0)
    smooth, seen = (_smoothed(x, recorded.period) for x in (slope, v))
    ratios = np.full(robot.n, np.nan)
    for k in range(robot.n):
        if np.ptp(smooth[:, k]) < 1e-3 or not np.any(v[:, k]):
            continue
        if np.corrcoef(seen[:, k], smooth[:, k])[0, 1] ** 2 > c.CORRELATED:
            ratios[k] = seen[:, k] @ smooth[:, k] / (smooth[:, k] @ smooth[:, k])
    known = np.flatnonzero(np.isfinite(ratios)).tolist()
    odd = [k for k in known if abs(ratios[k] - 1) > c.SAME_RATIO]
    clock = float(np.median(ratios[known])) if len(known) else 1.0
    whys = {k: _reason(float(ratios[k]), float(robot.gear_ratio[k])) for k in odd}
    is_same = len(known) > 1 and clock > 0 and np.ptp(ratios[known]) < c.SAME_FACTOR * clock
    if is_same and len(odd) == len(known) and not any(whys.values()):
        remedy = f"rate: {clock / recorded.period:.4g}"
        if recorded.time_factor is not None:
            remedy = f"time_factor: {recorded.time_factor / clock:.4g}"
        yield finding("clock", (), remedy, ratio=clock, second_s=1 / clock)
        return
    for k, why in whys.items():
        yield finding("speeds", (k + 1,), ratio=float(ratios[k]), why=f": {why}" * bool(why))
    if len(known) and not odd:
        yield from _speeds_late(recorded, smooth, seen, known)


def _reason(ratio: float, gear: float) -> str:
    """Return a reason for this ratio of a speed and the derivative of its position, or ""."""
    near = {180 / np.pi: "one of them is in degrees", np.pi / 180: "one of them is in degrees"}
    near |= {-1.0: "one of them has the opposite sign", 30 / np.pi: "speeds are in rpm"}
    if gear != 1:
        near |= {gear: "speeds are those of the motor"}
        near |= {gear * 180 / np.pi: "speeds are those of the motor, in degrees"}
        near |= {gear * 30 / np.pi: "speeds are those of the motor, in rpm"}
    return next((text for x, text in near.items() if abs(ratio / x - 1) < c.SAME_RATIO), "")


def _speeds_late(recorded: Recorded, slope: Array, v: Array, known: list[int]) -> Iterator[Finding]:
    """Check for speeds that lag behind the positions, as after a filter."""
    turn = np.gradient(slope, recorded.time, axis=0)[:, known]
    # v(t) = slope(t - late): to first order the part of the difference along -d(slope)/dt.
    off = slope[:, known] - v[:, known]
    late = np.sum(off * turn, axis=0) / np.sum(turn**2, axis=0)
    usual = float(np.median(late))
    least = max(c.MIN_SPEED_DELAY_SAMPLES * recorded.period, c.MIN_DELAY)
    if usual > least and np.all(np.abs(late - usual) < c.SAME_DELAY * usual):
        delays = {"delay_s": usual, "least_s": float(late.min()), "most_s": float(late.max())}
        yield finding("late speeds", (), "v: []", **delays)


def _smoothed(values: Array, period: float) -> Array:
    """Return means over about SPEED_WINDOW / 2, without delay."""
    half = max(1, round(c.SPEED_WINDOW / 4 / period))
    return np.asarray(uniform_filter1d(values, 2 * half + 1, axis=0, mode="nearest"))


# --- limits ----------------------------------------------------------------------------------


def _torque_limits(robot: Robot, tau: Array) -> Iterator[Finding]:
    """Check for torques beyond or at the limits of the motors."""
    tau = np.abs(robot.gear_torque(tau)) / robot.effort_limit
    times = tau.max(axis=0)
    over = np.flatnonzero(times > c.BEYOND).tolist()
    if over:
        joints, most = [k + 1 for k in over], float(times.max())
        signals = listed([f"tau_{k}" for k in joints])
        yield finding("beyond limit", joints, "side or torque_factor", signals=signals, times=most)
    for k, share in enumerate(np.mean(tau >= c.AT_LIMIT, axis=0).tolist()):
        if k not in over and share > c.OFTEN:
            yield finding("at limit", (k + 1,), share=share)
