"""Evenly sampled, smooth motion and torque from a recording; no filter here shifts time.

Positions pass a Butterworth filter forwards and backwards, and speeds and accelerations are those
of a quintic spline through them: central differences at 95 Hz would lose a tenth of an acceleration
at 8 Hz.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.signal import butter, sosfiltfilt

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.machine.recordings import Recorded
from sdt_drake.motion.trajectory import interpolated

HIGHEST = 0.35
"""Cut-off over the rate of samples, from which on a filter would do nothing but ring."""

_ORDER = 4
_AWAY = 0.01  # of a joint's reach: farther off than that, it has left its place
_REST = 2.0  # s
_SHORTEST, FEWEST = 1.0, 10 * _ORDER  # s and samples, of what is worth filtering
_WORKING_RATE = 200.0  # Hz, of what is computed from positions; machines of this kind move slower
_BEYOND = 2.0  # periods of the cut-off, of what a filter makes up beyond the ends
_WINDOWS, _PERIODS = 20, 50  # of a long recording, at most; of the cut-off in each, at least
ABOVE = 4.0  # cut-off of positions over that of torques; see `Smooth`


@dataclass(frozen=True, eq=False)
class Stretch:
    """A part of a recording without gaps, in even steps, joint side.

    Attributes:
        start: its time in the recording [s].
        period: [s].
        q, tau: [rad, N m], shape (N, n).
        v: recorded speeds [rad/s], shape (N, n); None to take them from positions.
    """

    start: float
    period: float
    q: Array
    tau: Array
    v: Array | None = None

    @property
    def end(self) -> float:
        """Time of the last sample in the recording [s]."""
        return self.start + (len(self.q) - 1) * self.period

    def part(self, rows: slice) -> Stretch:
        """Some of its rows, one after the other."""
        v = None if self.v is None else self.v[rows]
        start = self.start + (rows.start or 0) * self.period
        return Stretch(start, self.period, self.q[rows], self.tau[rows], v)

    def before(self, time: float) -> Stretch:
        """Its rows before a time in the recording [s]."""
        return self.part(slice(int(np.clip((time - self.start) / self.period, 0, len(self.q)))))


@dataclass(frozen=True, eq=False)
class Smooth:
    """Positions of a stretch below a cut-off frequency, with their derivatives.

    The torques that follow from them pass the same filter as the measured ones (parallel filtering;
    Gautier, "Dynamic identification of robots with power model", ICRA 1997). What cuts positions
    off is four times as high, so that it takes nothing from the torques that are compared.

    Attributes:
        time: in the recording [s], shape (N,).
        q, v, vd: [rad, rad/s, rad/s²], shape (N, n).
        tau: measured, not filtered but against aliasing, joint side [N m], shape (N, n).
        period: of these samples [s].
    """

    time: Array
    q: Array
    v: Array
    vd: Array
    tau: Array
    period: float


def stretches(recorded: Recorded) -> tuple[list[Stretch], list[str]]:
    """The parts of a recording between its gaps in even steps, from where the robot begins to move
    to where it has come to rest, and what had to be done, in words.

    Raises:
        InputError: if no part is as long as a second.
    """
    time, notes = recorded.time, []
    steps = np.diff(time)
    usual = float(np.median(steps))
    gaps = recorded.gaps
    if len(gaps):
        notes.append(f"{recorded.gaps_in_words}: taken apart there")
    within = np.delete(steps, gaps)
    jitter = float(np.abs(within - usual).max()) / usual
    if jitter > 1e-3:
        notes.append(
            f"uneven time, steps of {1e3 * within.min():.3g} to {1e3 * within.max():.3g} ms: "
            f"resampled at {1 / usual:.4g} Hz"
        )
    if "tau_mean" in recorded.signals:
        notes.append("torques are the recorded means between samples (tau_mean)")
    elif recorded.of_links:
        notes.append(
            "torques are those at the ends of periods, not what moved the links within them: "
            "simulated again, it has their means (tau_mean)"
        )
    first, last = _moving(time, recorded.signals["q"])
    if last - first < time[-1]:
        notes.append(
            f"left out, as no joint moves: all before {first:.4g} s and after {last:.4g} s"
        )
    parts = []
    for every in np.split(np.arange(len(time)), gaps + 1):
        rows = every[(time[every] >= first) & (time[every] <= last)]
        if len(rows) and time[rows[-1]] - time[rows[0]] >= _SHORTEST and len(rows) > FEWEST:
            of_part = slice(int(rows[0]), int(rows[-1]) + 1)
            parts.append(_even(recorded, of_part, usual, resample=jitter > 1e-3))
    if not parts:
        raise InputError(
            f"{recorded.path}: {last - first:.3g} s at {1 / usual:.3g} Hz, expected at least "
            f"{_SHORTEST:g} s and {FEWEST} samples without a gap"
        )
    return parts, notes


def spread(found: Sequence[Stretch], seconds: float, cutoff: float) -> list[Stretch]:
    """Windows of the stretches of a recording, about `seconds` in all, evenly over it and at its
    end, too; all of it if it is no longer than that.

    Args:
        found: the stretches.
        seconds: how much is wanted [s].
        cutoff: below which torques are compared [Hz]; windows have enough periods of it.
    """
    ends = np.cumsum([stretch.end - stretch.start for stretch in found])
    count = int(np.clip(seconds * cutoff / _PERIODS, 2, _WINDOWS))
    lasts = max(seconds / count, _PERIODS / cutoff)
    if count * lasts >= ends[-1]:
        return list(found)
    windows = []
    for begin in np.linspace(0, ends[-1] - lasts, count):
        for stretch, end in zip(found, ends, strict=True):
            shift = end - (stretch.end - stretch.start)
            first, last = ((t - shift) / stretch.period for t in (begin, begin + lasts))
            rows = slice(max(0, round(first)), max(0, round(last) + 1))
            part = stretch.part(rows)
            if (len(part.q) - 1) * part.period > 2 * _BEYOND / cutoff:  # or nothing is compared
                windows.append(part)
    return windows


def _moving(time: Array, q: Array) -> tuple[float, float]:
    """When the first joint leaves its place, and when the last one has come to its own [s]; a rest
    that filters want is left before and after."""
    reach = np.ptp(q, axis=0)
    is_away = [
        np.any(np.abs(q - there) > np.maximum(_AWAY * reach, _AWAY**2 * reach.max()), axis=1)
        for there in (q[0], q[-1])
    ]
    if not is_away[0].any():
        return 0.0, float(time[-1])
    begins, ends = np.argmax(is_away[0]), len(time) - 1 - np.argmax(is_away[1][::-1])
    first, last = time[begins] - _REST, time[ends] + _REST
    return max(float(first), 0.0), min(float(last), float(time[-1]))


def _even(recorded: Recorded, rows: slice, period: float, *, resample: bool) -> Stretch:
    time, q, tau = recorded.time[rows], recorded.signals["q"][rows], recorded.signals["tau"][rows]
    v = recorded.signals["v"][rows] if "v" in recorded.signals else None
    even = np.arange(time[0], time[-1], period) if resample else time
    if "tau_mean" in recorded.signals:
        tau = _of_means(time, recorded.signals["tau_mean"][rows], even)
    elif resample:
        tau = interpolated(even, time, tau)
    if resample:
        q = make_interp_spline(time, q, k=3)(even)
        v = None if v is None else make_interp_spline(time, v, k=3)(even)
    else:
        period = float(time[-1] - time[0]) / (len(time) - 1)
    return Stretch(float(time[0]), period, q, tau, v)


def _of_means(time: Array, mean: Array, at: Array) -> Array:
    """The smooth signal that has these means between the times; its integral is a spline's."""
    steps = np.diff(time, prepend=time[0])[:, None]  # the first mean is of before
    return np.asarray(
        make_interp_spline(time, np.cumsum(steps * mean, axis=0), k=5).derivative()(at)
    )


def zero_phase_low_pass(x: Array, cutoff: float, period: float) -> Array:
    """x of shape (N, ...) below `cutoff` [Hz] without delay: half of an amplitude is left there.

    A Butterworth filter of fourth order, forwards and backwards. Where samples at `period` [s]
    could hardly tell more than that, they stay; see HIGHEST.
    """
    if cutoff >= HIGHEST / period:
        return x
    sos = butter(_ORDER, 2 * cutoff * period, output="sos")
    return np.asarray(
        sosfiltfilt(sos, x, axis=0, padlen=min(len(x) - 1, int(_BEYOND / (cutoff * period))))
    )


def amplitude_left(frequency: Array, cutoff: float) -> Array:
    """What `zero_phase_low_pass` leaves of an amplitude at a frequency [Hz], from 0 to 1."""
    return np.asarray(1 / (1 + (frequency / cutoff) ** (2 * _ORDER)))


def smooth(stretch: Stretch, cutoff: float) -> Smooth:
    """Motion and torque of a stretch, for torques that are compared below `cutoff` [Hz]."""
    every = max(1, int(1 / (stretch.period * max(_WORKING_RATE, 3 * ABOVE * cutoff))))
    time: Array = stretch.start + stretch.period * np.arange(len(stretch.q), dtype=float)
    spline = _spline(time, stretch.q, stretch, cutoff)
    speed = spline.derivative() if stretch.v is None else _spline(time, stretch.v, stretch, cutoff)
    tau = (
        zero_phase_low_pass(stretch.tau, 0.4 / (every * stretch.period), stretch.period)
        if every > 1
        else stretch.tau
    )
    time = time[::every]
    return Smooth(
        time,
        np.asarray(spline(time)),
        np.asarray(speed(time)),
        speed.derivative()(time),
        tau[::every],
        every * stretch.period,
    )


def _spline(time: Array, x: Array, stretch: Stretch, cutoff: float) -> BSpline:
    return make_interp_spline(time, zero_phase_low_pass(x, ABOVE * cutoff, stretch.period), k=5)


def compared(count: int, cutoff: float, period: float) -> slice:
    """Which of `count` samples to compare below `cutoff` [Hz]: as few as tell it, without the ends,
    which the filter knows less of: as much as it has to make up beyond them."""
    every = max(1, int(1 / (4 * cutoff * period)))
    end = int(_BEYOND / (cutoff * period))
    return slice(end, count - end, every)
