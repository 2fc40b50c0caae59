"""Evenly sampled, smooth motion and torque from a recording, by filters without delay.

Positions pass a Butterworth filter forwards and backwards. Speeds and accelerations are those of a
quintic spline through the result. Central differences at 95 Hz would lose a tenth of an
acceleration at 8 Hz.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.signal import butter, sosfiltfilt

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.machine.recordings.recorded import Recorded
from sdt_drake.motion.trajectory import interpolated

MAX_CUTOFF_SHARE = 0.35
"""Largest cut-off of a filter over the sample rate [-]; signals pass unfiltered above it."""

HELD_OUT = 1 / 3
"""Share at the end of each recording that is held out, without recordings to hold out [-]."""

_ORDER = 4
_MOVED = 0.01  # distance from the first or last position over the joint's range
_REST_TIME = 2.0  # rest that stays before and after the motion [s]
_MIN_DURATION, MIN_SAMPLES = 1.0, 10 * _ORDER  # of a stretch [s] and [-]
_WORKING_RATE = 200.0  # sample rate of the equations [Hz]; robots have no faster motion
_PADDING = 2.0  # extrapolation of a signal for the filter, in periods of the cut-off
_MAX_WINDOWS, _MIN_PERIODS = 20, 50  # windows of a long recording; periods of the cut-off in each
ABOVE = 4.0  # cut-off of positions over that of torques; see `Smooth`


@dataclass(frozen=True, eq=False)
class Stretch:
    """A part of a recording without gaps, evenly sampled, joint side."""

    start: float
    """Time of the first sample in the recording [s]."""
    period: float
    """Sample period [s]."""
    q: Array
    """Positions [rad], shape (N, n)."""
    tau: Array
    """Torques [N m], shape (N, n)."""
    v: Array | None = None
    """Recorded speeds [rad/s], shape (N, n); None to differentiate positions."""

    @property
    def end(self) -> float:
        """Time of the last sample in the recording [s]."""
        return self.start + (len(self.q) - 1) * self.period

    def part(self, rows: slice) -> Stretch:
        """Return consecutive rows of the stretch."""
        v = None if self.v is None else self.v[rows]
        start = self.start + (rows.start or 0) * self.period
        return Stretch(start, self.period, self.q[rows], self.tau[rows], v)

    def before(self, time: float) -> Stretch:
        """Return the rows before a time in the recording [s]."""
        return self.part(slice(int(np.clip((time - self.start) / self.period, 0, len(self.q)))))


@dataclass(frozen=True, eq=False)
class Smooth:
    """Low-passed positions of a stretch with their derivatives.

    Torques computed from them pass the same filter as the measured ones (parallel filtering;
    Gautier, "Dynamic identification of robots with power model", ICRA 1997). The cut-off of
    positions is four times as high, so it has no effect on the compared torques.
    """

    time: Array
    """Time in the recording [s], shape (N,)."""
    q: Array
    v: Array
    vd: Array
    """`q`, `v`, `vd`: position, speed, acceleration [rad, rad/s, rad/s²], shape (N, n)."""
    tau: Array
    """Measured torque, filtered only against aliasing, joint side [N m], shape (N, n)."""
    period: float
    """Sample period [s]."""


def stretches(recorded: Recorded) -> tuple[list[Stretch], list[str]]:
    """Return the parts of a recording between gaps, evenly sampled, without rest at both ends.

    Returns:
        The stretches, and the changes as sentences.

    Raises:
        InputError: No stretch lasts 1 s.
    """
    time, notes = recorded.time, []
    steps = np.diff(time)
    usual = float(np.median(steps))
    gaps = recorded.gaps
    if len(gaps):
        notes.append(f"{recorded.gaps_in_words}: split there")
    within = np.delete(steps, gaps)
    jitter = float(np.abs(within - usual).max()) / usual
    if jitter > 1e-3:
        notes.append(
            f"uneven time, steps of {1e3 * within.min():.3g} to {1e3 * within.max():.3g} ms: "
            f"resampled at {1 / usual:.4g} Hz"
        )
    if "tau_mean" in recorded.signals:
        notes.append("torques are the recorded means over sample periods (tau_mean)")
    elif recorded.of_links:
        notes.append(
            "torques are values at the ends of sample periods, not means over them; simulate "
            "again to record the means (tau_mean)"
        )
    first, last = _moving(time, recorded.signals["q"])
    if last - first < time[-1]:
        notes.append(f"no joint moves before {first:.4g} s and after {last:.4g} s: not used")
    parts = []
    for every in np.split(np.arange(len(time)), gaps + 1):
        rows = every[(time[every] >= first) & (time[every] <= last)]
        if len(rows) > MIN_SAMPLES and time[rows[-1]] - time[rows[0]] >= _MIN_DURATION:
            of_part = slice(int(rows[0]), int(rows[-1]) + 1)
            parts.append(_even(recorded, of_part, usual, resample=jitter > 1e-3))
    if not parts:
        raise InputError(
            f"{recorded.path}: {last - first:.3g} s at {1 / usual:.3g} Hz, expected at least "
            f"{_MIN_DURATION:g} s and {MIN_SAMPLES} samples without a gap"
        )
    return parts, notes


def spread(found: Sequence[Stretch], seconds: float, cutoff: float) -> list[Stretch]:
    """Return windows that are evenly spread over the stretches of a recording.

    They last about `seconds` in all. A shorter recording is returned whole.

    Args:
        found: The stretches.
        seconds: Total duration of the windows [s].
        cutoff: Cut-off frequency of the compared torques [Hz]; windows have enough periods of it.
    """
    ends = np.cumsum([stretch.end - stretch.start for stretch in found])
    count = int(np.clip(seconds * cutoff / _MIN_PERIODS, 2, _MAX_WINDOWS))
    lasts = max(seconds / count, _MIN_PERIODS / cutoff)
    if count * lasts >= ends[-1]:
        return list(found)
    windows = []
    for begin in np.linspace(0, ends[-1] - lasts, count):
        for stretch, end in zip(found, ends, strict=True):
            shift = end - (stretch.end - stretch.start)
            first, last = ((t - shift) / stretch.period for t in (begin, begin + lasts))
            rows = slice(max(0, round(first)), max(0, round(last) + 1))
            part = stretch.part(rows)
            if (len(part.q) - 1) * part.period > 2 * _PADDING / cutoff:  # see `compared`
                windows.append(part)
    return windows


def _moving(time: Array, q: Array) -> tuple[float, float]:
    """Return the times between which joints move [s], with a rest for the filters at both ends."""
    reach = np.ptp(q, axis=0)
    is_away = [
        np.any(np.abs(q - end) > np.maximum(_MOVED * reach, _MOVED**2 * reach.max()), axis=1)
        for end in (q[0], q[-1])
    ]
    if not is_away[0].any():
        return 0.0, float(time[-1])
    begins, ends = np.argmax(is_away[0]), len(time) - 1 - np.argmax(is_away[1][::-1])
    first, last = time[begins] - _REST_TIME, time[ends] + _REST_TIME
    return max(float(first), 0.0), min(float(last), float(time[-1]))


def _even(recorded: Recorded, rows: slice, period: float, *, resample: bool) -> Stretch:
    """Return rows of a recording as a stretch, resampled at `period` [s] on demand."""
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
    """Return the smooth signal with these means between the times: the derivative of a spline."""
    steps = np.diff(time, prepend=time[0])[:, None]  # the first mean is over the time before
    sums = make_interp_spline(time, np.cumsum(steps * mean, axis=0), k=5)
    return np.asarray(sums.derivative()(at))


def zero_phase_low_pass(x: Array, cutoff: float, period: float) -> Array:
    """Filter x, shape (N, ...), below `cutoff` [Hz] without delay; half an amplitude is left there.

    The filter is a Butterworth filter of fourth order, forwards and backwards. Signals sampled at
    `period` [s] stay unfiltered for a cut-off above MAX_CUTOFF_SHARE.
    """
    if cutoff >= MAX_CUTOFF_SHARE / period:
        return x
    sos = butter(_ORDER, 2 * cutoff * period, output="sos")
    padding = min(len(x) - 1, int(_PADDING / (cutoff * period)))
    return np.asarray(sosfiltfilt(sos, x, axis=0, padlen=padding))


def amplitude_left(frequency: Array, cutoff: float) -> Array:
    """Return the gain of `zero_phase_low_pass` at frequencies [Hz], from 0 to 1."""
    return np.asarray(1 / (1 + (frequency / cutoff) ** (2 * _ORDER)))


def smooth(stretch: Stretch, cutoff: float) -> Smooth:
    """Return motion and torque of a stretch, for torques compared below `cutoff` [Hz]."""
    every = max(1, int(1 / (stretch.period * max(_WORKING_RATE, 3 * ABOVE * cutoff))))
    time: Array = stretch.start + stretch.period * np.arange(len(stretch.q), dtype=float)
    spline = _spline(time, stretch.q, stretch, cutoff)
    speed = spline.derivative() if stretch.v is None else _spline(time, stretch.v, stretch, cutoff)
    tau, time, period = stretch.tau, time[::every], every * stretch.period
    if every > 1:
        tau = zero_phase_low_pass(tau, 0.4 / period, stretch.period)[::every]
    q, v = np.asarray(spline(time)), np.asarray(speed(time))
    return Smooth(time, q, v, speed.derivative()(time), tau, period)


def _spline(time: Array, x: Array, stretch: Stretch, cutoff: float) -> BSpline:
    return make_interp_spline(time, zero_phase_low_pass(x, ABOVE * cutoff, stretch.period), k=5)


def compared(count: int, cutoff: float, period: float) -> slice:
    """Return the samples to compare below `cutoff` [Hz], of `count` samples at `period` [s].

    There are about four in a period of the cut-off. Both ends, which the padding of the filter
    affects, are left out.
    """
    every = max(1, int(1 / (4 * cutoff * period)))
    end = int(_PADDING / (cutoff * period))
    return slice(end, count - end, every)
