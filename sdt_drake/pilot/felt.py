"""Whether the pilot could feel the difference between two motions of the head.

Limits of validity. The thresholds are absolute ones, measured on attentive subjects, in silence and
darkness, at 1 G, with nothing else going on; vibration, noise and inattention raise them
considerably (Army Aviation AV0593). That a *difference* is felt at the same level while the head
moves and is heavy is assumed; it takes more in truth (Weber's law), so "could be felt" here is on
the safe side, and "is not felt" is the strong statement. Peaks count in full however short they
are, though the thresholds of force were measured on bells of 3 s; where the acceleration of a
reference jumps, no head can follow, and there are peaks of a few samples. The pilot has no second
motion to compare with: a difference that is felt changes what is felt, it is not known to be an
error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdt_drake.arrays import Array
from sdt_drake.pilot.head import HeadMotion
from sdt_drake.pilot.perception import low_pass

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
    """A difference in multiples of what is just felt.

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
        """The same for each channel [-], shape (6,)."""
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
