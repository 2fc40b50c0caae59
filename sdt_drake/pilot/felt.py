"""Whether the pilot could feel the difference between two motions of the head.

Limits of validity. The thresholds are absolute ones: of attentive subjects, in silence and dark, at
1 G. That a *difference* is felt at the same level while the head moves and is heavy is assumed; it
takes more in truth (Weber's law), so "could be felt" here is on the safe side, and "is not felt" is
the strong statement. Peaks count in full however short they are, though the thresholds of force
were measured on bells of 3 s; where the acceleration of a reference jumps, no head can follow, and
there are peaks of a few samples. The pilot has no second motion to compare with: a difference that
is felt changes what is felt, it is not known to be an error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sdt_drake.errors import InputError
from sdt_drake.pilot.head import HeadMotion
from sdt_drake.pilot.thresholds import DETECTORS, LINEAR

Array = NDArray[np.float64]

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

    Raises:
        InputError: if the numbers of samples differ.
    """
    omega, force = (
        (first.angular_velocity, second.angular_velocity),
        (first.specific_force, second.specific_force),
    )
    if omega[0].shape != omega[1].shape:
        raise InputError(
            f"felt_difference: {len(omega[0])} and {len(omega[1])} samples, expected the same"
        )
    by_detector = [d.multiples(omega[1] - omega[0], period) for d in DETECTORS]
    rotation = np.max(by_detector, axis=0)
    return FeltDifference(np.hstack([rotation, np.abs(force[1] - force[0]) / LINEAR]))
