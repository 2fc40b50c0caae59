"""What a pilot can just feel: detectors of rotation, and thresholds of specific force.

Measured on attentive subjects, in silence and darkness, with nothing else going on; vibration,
noise and inattention raise them considerably (Army Aviation AV0593). Axes are those of the head.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sdt_drake.pilot.filters import high_pass

Array = NDArray[np.float64]

UNPERCEIVED_RATE = 2.5
"""Steady rotation slower than this is not perceived [deg/s] (Army Aviation AV0593)."""

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
        y_deg_s = np.degrees(high_pass(omega, self.time_constant, period))
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
