"""The objective sheet of a motion: how it follows the flight, signal by signal, without a model.

The signals are the specific force along and the rotation about each axis of the head. Rotations
have passed the canals' high pass of 5.7 s, as steady ones are not felt.

- gain, phase: H = S_xy / S_xx of flight x and device y (Welch), at the frequencies of ICAO 9625's
  Objective Motion Cueing Test (0.1 to 15.85 rad/s), where the flight has power. A signal below its
  threshold throughout the flight has no response.
- correlation: Pearson's; delay: the lag of the largest one within 2 s.
- NRMSE: RMS error over the range of the flight's signal.
- false cues: a signal beyond its threshold on the device that in flight is below it, or has the
  other sign. Forces count relative to 1 G upright.
- tilt rate: rotation of the head about horizontal axes; 3 deg/s go unnoticed (Groen & Bles 2004).
"""

from typing import Any

import numpy as np
from scipy.signal import coherence, csd, welch

from sdt_drake.io.arrays import Array
from sdt_drake.machine.cueing.candidate import Candidate
from sdt_drake.machine.cueing.problem import RATE
from sdt_drake.pilot.canals import CUPULA, low_pass
from sdt_drake.pilot.head import GRAVITY
from sdt_drake.pilot.thresholds import CHANNELS, LINEAR

FREQUENCIES = 0.1 * 10 ** (0.2 * np.arange(12))
"""Frequencies of the Objective Motion Cueing Test [rad/s]."""

_SEGMENT = 63.0  # longest part of a spectrum [s]: a period of the lowest frequency
_POWER = 1e-3  # of the largest density that a frequency needs
_MAX_DELAY = 2.0  # s
_UNNOTICED = 3.0  # tilt rate [deg/s]
_PERIOD = 0.02  # s


def objective(motion: Candidate) -> dict[str, Any]:
    """Return the objective sheet of a motion beside its flight."""
    every = max(round(_PERIOD / motion.motion.period), 1)
    period = every * motion.motion.period
    inside = slice(motion.within.start, motion.within.stop, every)
    flown = np.hstack(motion.flight.at(motion.time))
    shown = np.hstack([motion.head.specific_force, motion.head.angular_velocity])
    both = []
    for signals in (flown, shown):
        felt = signals[:, 3:] - low_pass(signals[:, 3:], CUPULA, motion.motion.period)
        both.append(np.hstack([felt, signals[:, :3] - [0, 0, GRAVITY]])[inside])
    thresholds = np.concatenate([RATE, LINEAR])
    is_false = _false(both[0], both[1], thresholds)
    pairs = zip(CHANNELS, both[0].T, both[1].T, thresholds, is_false.T, strict=True)
    tilt = np.degrees(_tilt_rate(motion)[inside])
    return {
        "frequencies_rad_s": FREQUENCIES,
        "signals": {
            name: _signal(x, y, period, least) | {"false": wrong.mean()}
            for name, x, y, least, wrong in pairs
        },
        "false_rotation_share": float(is_false[:, :3].any(axis=1).mean()),
        "false_force_share": float(is_false[:, 3:].any(axis=1).mean()),
        "tilt_rate_rms_deg_s": float(np.sqrt(np.mean(tilt**2))),
        "tilt_rate_noticed_share": float((tilt > _UNNOTICED).mean()),
    }


def _false(flown: Array, shown: Array, threshold: Array) -> Array:
    """Return where a signal of the device has no cause in flight, shape (N, 6)."""
    missing = np.abs(flown) < threshold
    return np.asarray((np.abs(shown) > threshold) & (missing | (flown * shown < 0)))


def _tilt_rate(motion: Candidate) -> Array:
    """Return the rate of the head about horizontal axes [rad/s], shape (N + 1,)."""
    up = motion.head.rotation[:, 2]  # the world's z in axes of the head
    return np.asarray(np.linalg.norm(np.cross(motion.head.angular_velocity, up), axis=1))


def _signal(flown: Array, shown: Array, period: float, threshold: float) -> dict[str, Any]:
    """Return gain, phase and errors of one signal; NaN where the flight has none that is felt."""
    count = min(len(flown), round(_SEGMENT / period))
    spectra = {"fs": 1 / period, "nperseg": count}
    f, power = welch(flown, **spectra)
    with np.errstate(invalid="ignore", divide="ignore"):
        H = csd(flown, shown, **spectra)[1] / power
        coherent = coherence(flown, shown, **spectra)[1] if count < len(flown) else np.ones(len(f))
    at = FREQUENCIES / (2 * np.pi)
    has_power = np.interp(at, f, power) > _POWER * max(power.max(), 1e-12)
    is_felt = np.abs(flown).max() > threshold
    has_power &= (at >= 1 / (count * period)) & is_felt
    H = np.where(has_power, np.interp(at, f, H.real) + 1j * np.interp(at, f, H.imag), np.nan)
    correlation, delay = _delayed(flown, shown, period) if is_felt else (np.nan, np.nan)
    error, span = np.sqrt(np.mean((shown - flown) ** 2)), np.ptp(flown)
    return {
        "gain": np.abs(H),
        "phase_deg": np.degrees(np.angle(H)),
        "coherence": np.where(has_power, np.interp(at, f, np.nan_to_num(coherent)), np.nan),
        "correlation": correlation,
        "delay_s": delay,
        "nrmse": float(error / span) if is_felt else np.nan,
    }


def _delayed(flown: Array, shown: Array, period: float) -> tuple[float, float]:
    """Return the correlation [-], and the lag of the device with the largest one [s]."""
    x, y = (signal - signal.mean() for signal in (flown, shown))
    size = np.linalg.norm(x) * np.linalg.norm(y)
    if size < 1e-12:
        return np.nan, np.nan
    most = min(round(_MAX_DELAY / period), len(x) // 2)
    shifts = range(-most, most + 1)
    values = [
        float(x[max(-k, 0) : len(x) - max(k, 0)] @ y[max(k, 0) : len(y) + min(k, 0)]) / size
        for k in shifts
    ]
    best = int(np.argmax(values))
    return float(values[most]), shifts[best] * period
