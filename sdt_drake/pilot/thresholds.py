"""Thresholds of perception, and which difference between two motions of the head can be felt.

The thresholds are absolute ones: attentive subjects, silence and darkness, 1 G, no other motion.
Vibration, noise and inattention raise them considerably (Army Aviation AV0593). The otoliths pass
the specific force unchanged. Two assumptions follow from the use of thresholds for *differences*
between two motions:

- A difference is felt at the same level while the head moves and under G. In truth it takes more
  (Weber's law). So "could be felt" is on the safe side, and "is not felt" is the strong statement.
- Peaks of any duration count in full, although the thresholds of force were measured with bells of
  3 s. Where the acceleration of a reference jumps, no head can follow, and short peaks result.

The pilot has no second motion to compare with. A felt difference changes the sensation; the pilot
cannot recognise it as an error.
"""

from dataclasses import dataclass

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.pilot.canals import low_pass, sensed_rate
from sdt_drake.pilot.head import HeadMotion

UNPERCEIVED_RATE = 2.5
"""Largest rate of a steady rotation that is not perceived [deg/s] (Army Aviation AV0593)."""

_FADING_TIME = 120.0
"""Time at rest after a recording in which sensations fade [s]."""


def false_sensation_after_stop(omega: Array, period: float) -> Array:
    """Return how long each canal still senses a rotation after the head has stopped [s], (3,).

    The head turns while its rate is at least UNPERCEIVED_RATE, and a canal senses a rotation until
    its output first falls below that rate. The second, weaker sensation in the other direction is
    not counted. After the last sample the head stays still.

    Args:
        omega: rate of the head in its axes [rad/s], shape (N, 3).
        period: sample period [s].

    Returns:
        Durations about x, y, z; NaN if the head never turns, or still turns at the end.
    """
    level = np.radians(UNPERCEIVED_RATE)
    turning = np.linalg.norm(omega, axis=1) >= level
    if turning[-1] or not turning.any():
        return np.full(3, np.nan)
    stopped = np.flatnonzero(turning)[-1] + 1
    still = np.zeros((round(_FADING_TIME / period), 3))
    sensed = np.abs(sensed_rate(np.concatenate([omega, still]), period)[stopped:]) >= level
    return (~sensed).argmax(axis=0) * period


AXES = (2.04 / 1.58, 2.07 / 1.58, 1.0)
"""Thresholds of roll, pitch and yaw over that of yaw [-]: Benson, Hutt & Brown 1989, cosine bells
of 3 s (numbers from memory, not from the paper). Both detectors are assumed to scale alike."""


@dataclass(frozen=True)
class Detector:
    """A detector of rotation: it is felt while |y| >= level, with T y' + y = T omega'."""

    name: str
    """Name in tables and figures."""
    time_constant: float
    """Time constant T [s]."""
    level_deg_s: float
    """Threshold of y about the vertical axis of the head [deg/s]."""
    source: str
    """Source of the numbers."""

    def multiples(self, omega: Array, period: float) -> Array:
        """Return |y| / level about roll, pitch and yaw [-], shape (N, 3).

        Args:
            omega: rate in the head's axes [rad/s], linear between samples, shape (N, 3).
            period: sample period [s].
        """
        y_deg_s = np.degrees(omega - low_pass(omega, self.time_constant, period))
        return np.abs(y_deg_s) / (self.level_deg_s * np.array(AXES))


DETECTORS = (
    # A constant acceleration a from rest is felt after t if a >= C / (1 - e^{-t/T}), C = 0.22
    # deg/s² and T = 14.5 s: y / T = a (1 - e^{-t/T}) reaches C. For t << T that is Mulder's
    # product, a t >= C T = 3.2 deg/s.
    Detector("long", 14.5, 0.22 * 14.5, "Rodenburg, Stassen & Maas (yaw, 3-25 s)"),
    # Direction recognition: one period of a sine of acceleration (a bell of speed), 0.05 to 5 Hz.
    # The time constant is that of the published fit. Its level of 0.71 deg/s is valid for a steady
    # sine and would miss the measured bells by up to a factor of 2; a level of 0.30 misses none.
    Detector("short", 0.70, 0.30, "Grabherr et al. 2008 (yaw, time constant of the high-pass fit)"),
)
"""Detectors of rotation. The long one is more sensitive to weak accelerations of many seconds, the
short one to quick changes. They come from different tasks and subjects: 8 deg/s² for 0.25 s, which
AV0593 calls unperceived, stays below the threshold of the long one only."""

LINEAR = (0.063, 0.057, 0.154)
"""Thresholds of a change of specific force along x, y, z [m/s²]: Benson, Spencer & Stott 1986,
cosine bells of 3 s. They are assumed to be valid at all frequencies and under any G."""

CHANNELS = ("roll", "pitch", "yaw", "fore-aft", "lateral", "vertical")
"""Rotations about x, y, z of the head and specific forces along them."""


@dataclass(frozen=True, eq=False)
class FeltDifference:
    """A difference of two head motions, in multiples of the perception thresholds."""

    multiples: Array
    """Difference over threshold, channels in the order of CHANNELS [-], shape (N, 6). Above 1 it
    could be felt."""

    @property
    def share(self) -> float:
        """Share of time in which any channel could be felt [-]; the single figure of merit."""
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
        """Name and multiple of the rotation with the largest multiple."""
        return self._worst(slice(0, 3))

    @property
    def worst_force(self) -> tuple[str, float]:
        """Name and multiple of the specific force with the largest multiple."""
        return self._worst(slice(3, 6))

    def _worst(self, channels: slice) -> tuple[str, float]:
        values = self.largest[channels]
        return CHANNELS[channels][int(np.argmax(values))], float(values.max())


def felt_difference(first: HeadMotion, second: HeadMotion, period: float) -> FeltDifference:
    """Return the felt difference between two head motions over the same time, each in its own axes.

    Rotations: the larger output of the two detectors for the difference of angular rates. Forces:
    the difference of specific forces over the threshold of each axis, at any frequency.

    Args:
        first: one motion, N samples.
        second: the other motion, N samples.
        period: sample period of both [s].
    """
    omega = second.angular_velocity - first.angular_velocity
    force = np.abs(second.specific_force - first.specific_force) / LINEAR
    rotation = np.max([detector.multiples(omega, period) for detector in DETECTORS], axis=0)
    return FeltDifference(np.hstack([rotation, force]))
