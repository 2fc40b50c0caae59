"""What the pilot perceives of the motion of the head: canals, otoliths, thresholds.

Canals and otoliths are first-order models from the literature, linear and without the brain behind
them: no velocity storage (which makes felt rotation last 15-20 s instead of the cupula's 5.7 s), no
vision, no expectation; `sdt_drake.analysis.orientation` has those. The otoliths tell the specific
force as it is (unity).

Limits of validity of the thresholds. They are absolute ones, measured on attentive subjects, in
silence and darkness, at 1 G, with nothing else going on; vibration, noise and inattention raise
them considerably (Army Aviation AV0593). That a *difference* is felt at the same level while the
head moves and is heavy is assumed; it takes more in truth (Weber's law), so "could be felt" here is
on the safe side, and "is not felt" is the strong statement. Peaks count in full however short they
are, though the thresholds of force were measured on bells of 3 s; where the acceleration of a
reference jumps, no head can follow, and there are peaks of a few samples. The pilot has no second
motion to compare with: a difference that is felt changes what is felt, it is not known to be an
error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.robot.head import HeadMotion

CANAL = 5.7
"""tau: the cupula swings back [s] (Rader, Oman & Merfeld 2009, Table T4)."""

ADAPTATION = 80.0
"""tau_a: the nerve gets used to it [s] (same source)."""

UNPERCEIVED_RATE = 2.5
"""Steady rotation slower than this is not perceived [deg/s] (Army Aviation AV0593)."""

_ON = 120.0  # how long a head is held still after a recording to see sensations fade [s]


def low_pass(u: Array, time_constant: float, period: float) -> Array:
    """y of T y' + y = u, u straight between samples (first-order hold), at rest before the start.

    y_{i+1} = phi y_i + (b - phi) u_i + (1 - b) u_{i+1}, phi = e^{-h/T}, b = (1 - phi) T / h.

    Args:
        u: shape (N, ...).
        time_constant: T [s].
        period: h [s].
    """
    ratio = period / time_constant
    phi = math.exp(-ratio)
    b = -math.expm1(-ratio) / ratio
    w = np.concatenate([u[:1], (b - phi) * u[:-1] + (1 - b) * u[1:]])
    # y_i = sum over j of phi^j w_{i-j}: sums of 2, 4, 8, ... terms, each from two of half as many.
    y, shift = w, 1
    while shift < len(y):
        y[shift:] += phi**shift * y[:-shift]
        shift *= 2
    return y


def canals(omega: Array, period: float) -> Array:
    """Angular velocity that the canals tell [rad/s]; the shape of `omega`.

        omega_sensed / omega = tau tau_a s² / ((tau s + 1) (tau_a s + 1))

    in partial fractions, each a low pass that is exact for speeds that are straight between
    samples. A head that turns already at the first sample is taken to have done so for long: its
    canals tell nothing.

    Args:
        omega: of the head, in its axes [rad/s], shape (N, ...).
        period: [s].
    """
    apart = ADAPTATION - CANAL
    return (
        omega
        - ADAPTATION / apart * low_pass(omega, CANAL, period)
        + CANAL / apart * low_pass(omega, ADAPTATION, period)
    )


def false_sensation_after_stop(omega: Array, period: float) -> Array:
    """How long the canals tell of a rotation about each axis after the head has stopped [s], (3,).

    Both by the rate that is not perceived when it stays: the head turns while it is faster, and
    the canals tell of a rotation until they first show less; the second, weaker sensation the other
    way, which comes with adaptation, is not counted. After the last sample the head is held still.
    NaN if it never turns, or still turns at the end.

    Args:
        omega: of the head, in its axes [rad/s], shape (N, 3).
        period: [s].
    """
    level = np.radians(UNPERCEIVED_RATE)
    turning = np.linalg.norm(omega, axis=1) >= level
    if turning[-1] or not turning.any():
        return np.full(3, np.nan)
    stopped = np.flatnonzero(turning)[-1] + 1
    still = np.zeros((round(_ON / period), 3))
    told = np.abs(canals(np.concatenate([omega, still]), period)[stopped:]) >= level
    return (~told).argmax(axis=0) * period


AXES = (2.04 / 1.58, 2.07 / 1.58, 1.0)
"""Thresholds of roll, pitch and yaw over that of yaw [-], by Benson, Hutt & Brown 1989 (cosine
bells of 3 s; their numbers from memory, not from the paper). That other detectors scale alike is
assumed."""


@dataclass(frozen=True)
class Detector:
    """A rotation is felt while |y| >= level, with T y' + y = T omega'.

    Attributes:
        name: for tables and figures.
        time_constant: T [s].
        level_deg_s: of y about the vertical axis of the head [deg/s].
        source: where the numbers come from.
    """

    name: str
    time_constant: float
    level_deg_s: float
    source: str

    def multiples(self, omega: Array, period: float) -> Array:
        """|y| / level about roll, pitch and yaw [-], shape (N, 3).

        Args:
            omega: in the head's axes [rad/s], shape (N, 3), straight between samples.
            period: [s].
        """
        y_deg_s = np.degrees(omega - low_pass(omega, self.time_constant, period))
        return np.abs(y_deg_s) / (self.level_deg_s * np.array(AXES))


DETECTORS = (
    # A constant acceleration a from rest is felt after t if a >= C / (1 - e^{-t/T}), C = 0.22
    # deg/s² and T = 14.5 s: y / T = a (1 - e^{-t/T}) reaches C. For t << T that is Mulder's
    # product, a t >= C T = 3.2 deg/s.
    Detector("long", 14.5, 0.22 * 14.5, "Rodenburg, Stassen & Maas (yaw, 3-25 s)"),
    # Which way does it turn: one period of a sine of acceleration, a bell of speed, 0.05 to 5 Hz.
    # The time constant is that of the published fit. Its level, 0.71 deg/s, holds for a steady sine
    # and would miss the bells that were measured, by up to a factor 2; at 0.30 none is missed.
    Detector("short", 0.70, 0.30, "Grabherr et al. 2008 (yaw, time constant of the high-pass fit)"),
)
"""The long one is the more sensitive to weak accelerations of many seconds, the short one to all
that is quick; they also differ by what was asked and by whom: 8 deg/s² for 0.25 s, which AV0593
calls unperceived, is so for the long one only."""

LINEAR = (0.063, 0.057, 0.154)
"""Change of specific force along x, y, z that is just felt [m/s²]: Benson, Spencer & Stott 1986
(cosine bells of 3 s). One value for all frequencies and under any G: assumed."""

CHANNELS = ("roll", "pitch", "yaw", "fore-aft", "lateral", "vertical")
"""Rotations about x, y, z of the head and specific forces along them."""


@dataclass(frozen=True, eq=False)
class FeltDifference:
    """A difference of head motions, in multiples of what is just felt.

    Attributes:
        multiples: by channel, in the order of CHANNELS [-], shape (N, 6); above 1 it could be felt.
    """

    multiples: Array

    @property
    def share(self) -> float:
        """Share of time in which any channel could be felt [-]: the one figure of merit."""
        return float(np.mean((self.multiples > 1).any(axis=1)))

    @property
    def channel_share(self) -> Array:
        """Share of time in which each channel could be felt [-], shape (6,)."""
        return np.mean(self.multiples > 1, axis=0)

    @property
    def largest(self) -> Array:
        """Largest multiple of each channel [-], shape (6,)."""
        return self.multiples.max(axis=0)

    @property
    def worst_rotation(self) -> tuple[str, float]:
        """The rotation with the largest multiple, and that."""
        return self._worst(slice(0, 3))

    @property
    def worst_force(self) -> tuple[str, float]:
        """The direction of specific force with the largest multiple, and that."""
        return self._worst(slice(3, 6))

    def _worst(self, channels: slice) -> tuple[str, float]:
        values = self.largest[channels]
        return CHANNELS[channels][int(np.argmax(values))], float(values.max())


def felt_difference(first: HeadMotion, second: HeadMotion, period: float) -> FeltDifference:
    """The difference between two motions of the head over the same time, each in its own axes.

    Rotations: the larger of what the detectors show of the difference of angular velocities; its
    derivative in the head's axes is that of the angular accelerations. Forces: the difference of
    specific forces over the threshold of each axis, at any frequency.

    Args:
        first, second: N samples each.
        period: [s].
    """
    omega = second.angular_velocity - first.angular_velocity
    force = np.abs(second.specific_force - first.specific_force) / LINEAR
    rotation = np.max([detector.multiples(omega, period) for detector in DETECTORS], axis=0)
    return FeltDifference(np.hstack([rotation, force]))
