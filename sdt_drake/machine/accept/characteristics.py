"""The characteristics of a test from its cycles, with intervals from their differences."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.stats import t as student

from sdt_drake.io.arrays import Array, Complex

_LEVEL = 0.95  # of intervals
_REACHED = 0.63  # of a step


class Estimate(NamedTuple):
    """A number with its interval of 95 %."""

    value: float
    low: float
    high: float


def estimate(statistic: Callable[..., float], *cycles: Array | Complex) -> Estimate:
    """Estimate a statistic of N cycles by the jackknife: Student's t of its N pseudo-values.

    For a mean the pseudo-values are the samples. An infinite statistic has no width.

        >>> estimate(np.mean, np.array([1.0, 2.0, 3.0]))
        Estimate(value=2.0, low=-0.484..., high=4.484...)

    Args:
        statistic: function of all `cycles`.
        cycles: arrays whose first axis is the cycle, N each.
    """
    n, value = len(cycles[0]), float(statistic(*cycles))
    without = np.array([statistic(*(np.delete(x, i, axis=0) for x in cycles)) for i in range(n)])
    if not np.isfinite([value, *without]).all():
        return Estimate(value, value, value)
    width = student.ppf((1 + _LEVEL) / 2, n - 1) * np.std((n - 1) * without, ddof=1) / np.sqrt(n)
    return Estimate(value, value - float(width), value + float(width))


def band_limited(x: Array, period: float, band: float, order: int) -> Array:
    """Return the derivative of an order of samples, low-passed without delay (Gauss).

    A straight line from the first to the last sample is left out, so that no jump remains.

    Args:
        x: samples, shape (N, n).
        period: their period [s].
        band: frequency at which the filter's gain is -3 dB [Hz].
        order: order of the derivative, 0 or more.
    """
    way = np.linspace(0, 1, len(x))[:, None]
    line = x[:1] + way * (x[-1:] - x[:1])
    f = np.fft.rfftfreq(len(x), period)
    gain = np.exp(-np.log(2) / 2 * (f / band) ** 2) * (2j * np.pi * f) ** order
    found = np.fft.irfft(np.fft.rfft(x - line, axis=0) * gain[:, None], len(x), axis=0)
    if order == 0:
        return found + line
    slope = (x[-1] - x[0]) / ((len(x) - 1) * period)
    return np.asarray(found + slope * (order == 1))


# --- sines ---------------------------------------------------------------------------------------


def first(x: Array) -> Complex:
    """Return the fundamental of each cycle, shape (N, M): its amplitude and phase."""
    return np.fft.rfft(x, axis=1)[:, 1] * 2 / x.shape[1]


def without_drift(x: Array) -> Array:
    """Return cycles, shape (N, M), less the straight line through their means."""
    slope, middle = np.polyfit(np.arange(len(x)), x.mean(axis=1), 1)
    m = x.shape[1]
    since = np.arange(x.size).reshape(x.shape) / m - (m - 1) / (2 * m)  # cycles since a mean
    return np.asarray(x - middle - slope * since)


def describing(u: Array, y: Array) -> dict[str, Estimate]:
    """Estimate gain [dB] and phase [rad] of the fundamental of output cycles over input cycles.

    Args:
        u: input, shape (N, M).
        y: output, shape (N, M).
    """
    into, out = first(without_drift(u)), first(without_drift(y))

    def ratio(u: Complex, y: Complex) -> complex:
        return complex(y.mean() / u.mean())

    turned = ratio(into, out)  # the phases of parts of the cycles are near this one
    return {
        "gain": estimate(lambda u, y: 20 * np.log10(abs(ratio(u, y))), into, out),
        "phase": estimate(
            lambda u, y: np.angle(turned) + np.angle(ratio(u, y) / turned), into, out
        ),
    }  # fmt: skip


def noises(u: Array, y: Array) -> dict[str, Estimate]:
    """Estimate the parts of an output that are no fundamental, over the fundamental [-].

    What the input has beside its own fundamental is subtracted. Low and high non-linearity are RMS
    of the mean cycle: harmonics 2 and 3, and all higher ones. Noise is the RMS of everything. The
    peak is relative to the amplitude; the others to the RMS of the fundamental.

    Args:
        u: commanded acceleration, shape (N, M).
        y: acceleration, shape (N, M).
    """
    e = np.fft.rfft(y - u, axis=1)
    e[:, :2] = 0
    rest = np.fft.irfft(e, y.shape[1], axis=1)
    amplitude = first(y)

    def harmonics(which: slice) -> Callable[[Complex, Complex], float]:
        def part(e: Complex, a: Complex) -> float:
            power = np.sum(np.abs(e.mean(axis=0)[which] * 2 / y.shape[1]) ** 2)
            return float(np.sqrt(power) / abs(a.mean()))

        return part

    return {
        "low_nonlinearity": estimate(harmonics(slice(2, 4)), e, amplitude),
        "high_nonlinearity": estimate(harmonics(slice(4, None)), e, amplitude),
        "noise": estimate(
            lambda r, a: np.sqrt(2 * np.mean(r**2)) / abs(a.mean()), rest, amplitude
        ),
        "peak_noise": estimate(
            lambda r, a: np.abs(r).max(axis=1).mean() / abs(a.mean()), rest, amplitude
        ),
    }  # fmt: skip


# --- other tests ---------------------------------------------------------------------------------


def loop_widths(off: Array) -> Array:
    """Return the width of the loop of each cycle of a triangle, shape (N,).

    It is the mean of output less input over the middle half of the leg down, less that of the leg
    up; a drift cancels.

    Args:
        off: output less input over cycles that begin in the middle of the leg up, shape (N, M).
    """
    eighth = off.shape[1] // 8
    up = np.concatenate([off[:, :eighth], off[:, -eighth:]], axis=1).mean(axis=1)
    return np.asarray(off[:, 3 * eighth : 5 * eighth].mean(axis=1) - up)


def hysteresis(fast: Array, slow: Array) -> dict[str, Estimate]:
    """Estimate the width of a loop at standstill from those at a speed and at half of it.

    A lag of T adds 2 v T to the width, so twice the slow width less the fast one is without it.

    Args:
        fast: output less input at a speed, shape (N, M).
        slow: the same at half the speed, shape (N, M').
    """
    return {"hysteresis": estimate(np.mean, 2 * loop_widths(slow) - loop_widths(fast))}


def threshold(u: Array, y: Array, size: float, period: float) -> dict[str, Estimate]:
    """Estimate the time from a commanded acceleration step until 63 % of it are reached.

    Steps up and down are averaged. Infinite if they are never reached.

    Args:
        u: commanded acceleration, shape (N, M), each cycle with a rest, a step up, one down, and
            the same again the other way.
        y: acceleration, shape (N, M).
        size: size of the step.
        period: time between the columns [s].
    """
    half = u.shape[1] // 2
    third = half * 2 // 3  # rest and step; after it the acceleration has the other sign

    def reached(x: Array) -> float:
        mean = (x[:, :third] - x[:, half : half + third]).mean(axis=0) / 2 / size
        mean[: third // 4] = 0.0  # the part before may still decay
        i = int(np.argmax(mean >= _REACHED))
        if mean[i] < _REACHED:
            return np.inf
        return i - float((mean[i] - _REACHED) / (mean[i] - mean[i - 1]))

    return {"threshold": estimate(lambda u, y: period * (reached(y) - reached(u)), u, y)}


def extremes(q: Array, v: Array, vd: Array) -> dict[str, Estimate]:
    """Estimate the lowest and highest value of q, and the largest |v| and |vd|, of cycles."""
    return {
        "lowest": estimate(np.mean, q.min(axis=1)),
        "highest": estimate(np.mean, q.max(axis=1)),
        "speed": estimate(np.mean, np.abs(v).max(axis=1)),
        "acceleration": estimate(np.mean, np.abs(vd).max(axis=1)),
    }


# --- poses and paths -----------------------------------------------------------------------------


def spread(p: Array) -> Array:
    """Return mean and three standard deviations of the distance from the mean of visits.

    Args:
        p: positions of N visits, shape (N, ..., 3).
    """
    away = np.linalg.norm(p - p.mean(axis=0), axis=-1)
    return np.asarray(away.mean(axis=0) + 3 * away.std(axis=0, ddof=1))


def poses(off: Array) -> dict[str, Estimate]:
    """Estimate accuracy and repeatability of the worst pose, in the manner of ISO 9283 [m].

    Args:
        off: position less command of N visits of m poses, shape (N, m, 3).
    """
    return {
        "pose_accuracy": estimate(_farthest, off),
        "pose_repeatability": estimate(lambda off: spread(off).max(), off),
    }


def path(off: Array, along: Array) -> dict[str, Estimate]:
    """Estimate accuracy and repeatability of a path, in the manner of ISO 9283 [m].

    Distances count across the path alone, so lag along it does not. Nothing without a path.

    Args:
        off: position less command of N cycles at M places, shape (N, M, 3).
        along: commanded velocity there, shape (M, 3).
    """
    speed = np.linalg.norm(along, axis=1)
    moves = speed > 0.05 * speed.max()
    if not moves.any():
        return {}
    ahead = along[moves] / speed[moves, None]
    off = off[:, moves]
    off = off - np.sum(off * ahead, axis=-1, keepdims=True) * ahead
    return {
        "path_accuracy": estimate(_farthest, off),
        "path_repeatability": estimate(lambda off: spread(off).max(), off),
    }


def _farthest(off: Array) -> float:
    return float(np.linalg.norm(off.mean(axis=0), axis=-1).max())
