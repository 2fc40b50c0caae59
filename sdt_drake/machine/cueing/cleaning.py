"""Noise taken out of the sensors of a flight, and rates and force found from its attitude."""

import numpy as np
from scipy.interpolate import CubicSpline, make_smoothing_spline

from sdt_drake.io.arrays import Array
from sdt_drake.pilot.head import GRAVITY

FORCE_NOISE, RATE_NOISE = 0.3, 0.01
"""Standard deviations of white noise that are taken out [m/s², rad/s]."""

_GAUSSIAN = 0.6745 * np.sqrt(6)  # median of |second differences| of white noise over its deviation
_SHARE = 0.01  # of usual values that noise has
_PERIOD = 0.1  # s, of slow recordings after interpolation
_SLOW = 0.2  # s, between their samples


def noise_of(values: Array) -> Array:
    """Return the standard deviation of white noise on each column, by second differences.

    >>> noise_of(np.random.default_rng(0).normal(size=(10000, 1))).round(1)
    array([1.])
    """
    if len(values) < 3:
        return np.zeros(values.shape[1])
    return np.asarray(np.median(np.abs(np.diff(values, 2, axis=0)), axis=0) / _GAUSSIAN)


def without_noise(time: Array, values: Array, least: float) -> tuple[Array, Array]:
    """Return columns without white noise above a level, and the RMS of what was taken out of each.

    A smoothing spline leaves as much as generalised cross-validation finds to be motion.
    """
    noise, size = noise_of(values), float(np.median(np.linalg.norm(values, axis=1)))
    noisy = np.flatnonzero(noise > max(least, _SHARE * size))
    clean = values.copy()
    for k in noisy:
        clean[:, k] = make_smoothing_spline(time, values[:, k])(time)
    return clean, np.sqrt(((values - clean) ** 2).mean(axis=0))


def rates_of(time: Array, attitude: Array) -> Array:
    """Return rates about x forward, y left, z up from bank, pitch and heading [rad], shape (N, 3).

    Bank is positive to the right, pitch up, heading to the right.
    """
    bank, pitch, _ = angles = np.unwrap(attitude, axis=0).T
    d_bank, d_pitch, d_heading = CubicSpline(time, angles.T)(time, 1).T
    p = d_bank - d_heading * np.sin(pitch)
    q = d_pitch * np.cos(bank) + d_heading * np.cos(pitch) * np.sin(bank)
    r = -d_pitch * np.sin(bank) + d_heading * np.cos(pitch) * np.cos(bank)
    return np.stack([p, -q, -r], axis=1)


def forward_force(time: Array, pitch: Array, speed: Array | None) -> Array:
    """Return the force along x, from pitch [rad] and the growth of the speed [m/s]."""
    growth = 0.0 if speed is None else CubicSpline(time, speed)(time, 1)
    return np.asarray(GRAVITY * np.sin(pitch) + growth)


def at_finer_times(time: Array, values: Array) -> tuple[Array, Array]:
    """Return times 0.1 s apart with interpolated values, if the samples are farther apart."""
    if np.median(np.diff(time)) <= _SLOW:
        return time, values
    finer = np.linspace(time[0], time[-1], round(np.ptp(time) / _PERIOD) + 1)
    return finer, np.asarray(CubicSpline(time, values)(finer))
