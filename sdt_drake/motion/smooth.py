"""Smooth segments of motion profiles: series, swings, and angles through points, rest to rest."""

import math
from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.fields import NonEmpty, Number, Positive, Problems, Values, field
from sdt_drake.motion.segments import Segment, SpeedStep, not_pairs
from sdt_drake.motion.spin import SpinGeometry

_MAX_SWINGS = 100_000  # by memory
_SAMPLES_PER_SWING = 16  # to check what an interpolation period loses of it
_DIGITS = 1e-6  # relative round-off of numbers in a file


class SmoothSpeed(Segment):
    """A smooth speed from rest to rest, added to that of the pieces."""

    end: float
    """End of the smooth speed since the start of the segment [s]."""

    @abstractmethod
    def speed(self, time: Array) -> Array:
        """Return the joint speed [rad/s] at `time` [s] since the start, shape (N,); 0 outside."""

    @abstractmethod
    def corners(self) -> Array:
        """Return growing times since the start [s], between which the speed is monotonic."""

    @abstractmethod
    def angle(self) -> float:
        """Return the change of the joint angle [rad]."""

    def steps(self, speed: float, angle: float, geometry: SpinGeometry | None) -> list[SpeedStep]:
        """Return a piece of rest; the smooth speed is added to it."""
        return [(self.end, 0.0)]


@dataclass(frozen=True, kw_only=True)
class Oscillation(SmoothSpeed):
    """The speed of a sinusoidal angle A sin(2 pi t / T), faded in and out.

    v(t) = A (2 pi / T) cos(2 pi t / T) clip(t / fade, 0, 1) clip((end - t) / fade, 0, 1),
    with t since the start of the segment.
    """

    amplitude: Number = field(unit="rad", side="joint")
    """A, amplitude of the angle."""
    period: Positive = field(unit="s")
    """T, period of the swing."""
    fade: Positive = field(unit="s")
    """Duration of fading in, and of fading out."""
    end: Positive = field(unit="s")
    """End of the swing at rest, since the start of the segment."""

    def problems(self) -> Problems:
        """Yield a period that is too short for the number of swings."""
        yield from _too_many(self.period, self.end)

    def speed(self, time: Array) -> Array:
        """Return the joint speed [rad/s] at `time` [s] since the start."""
        omega = 2 * np.pi / self.period
        fade_in = np.clip(time / self.fade, 0, 1)
        fade_out = np.clip((self.end - time) / self.fade, 0, 1)
        return self.amplitude * omega * np.cos(omega * time) * fade_in * fade_out

    def corners(self) -> Array:
        """Return 16 times per period and the corners of fading, since the start [s], growing."""
        turns = np.arange(0, self.end, self.period / _SAMPLES_PER_SWING)
        fading = np.array([self.fade, self.end - self.fade, self.end])
        return np.unique(np.concatenate([turns, np.clip(fading, 0, self.end)]))

    def angle(self) -> float:
        """Return the change of the joint angle [rad]."""
        nodes, weights = np.polynomial.legendre.leggauss(8)
        corners = self.corners()
        half, middle = np.diff(corners) / 2, (corners[1:] + corners[:-1]) / 2
        return float(half @ self.speed(middle[:, None] + half[:, None] * nodes) @ weights)


@dataclass(frozen=True, kw_only=True)
class Fourier(SmoothSpeed):
    """A sum of harmonics over whole periods.

    q(t) - q(0) = sum over l of sine_l sin(2 pi l t / T) + cosine_l (cos(2 pi l t / T) - 1),
    with t since the start of the segment.
    """

    period: Positive = field(unit="s")
    """T, period of the first harmonic."""
    sine: NonEmpty[Number] = field(unit="rad", side="joint")
    """Sine amplitudes of the angle. The sum of l sine_l is 0: the motion starts at rest."""
    cosine: NonEmpty[Number] = field(unit="rad", side="joint")
    """Cosine amplitudes of the angle, as many as sine."""
    end: Positive = field(unit="s")
    """End of the motion at rest, since the start of the segment: a multiple of the period."""

    def problems(self) -> Problems:
        """Yield amplitudes and times without rest at both ends, and too many swings."""
        if len(self.sine) != len(self.cosine):
            yield "cosine", f"{len(self.cosine)} value(s), expected {len(self.sine)} as in sine"
            return
        if too_many := list(_too_many(self.period, self.end * len(self.sine))):
            yield from too_many
        elif abs(self.end / self.period - round(self.end / self.period)) > _DIGITS:
            yield "end", f"{self.end:g} s, expected a multiple of the period, {self.period:g} s"
        start = float(self.speed(np.zeros(1))[0])
        if abs(start) > _DIGITS * (1 + float(np.abs(self._omega @ np.abs(self.sine)))):
            yield "sine", f"starts at {start:.3g} rad/s, expected rest: sum of l sine_l = 0"

    @property
    def _omega(self) -> Array:
        """Frequencies of the harmonics [rad/s]."""
        return 2 * np.pi / self.period * np.arange(1.0, len(self.sine) + 1)

    def speed(self, time: Array) -> Array:
        """Return the joint speed [rad/s] at `time` [s] since the start, shape (N,); 0 outside."""
        phase, omega = np.multiply.outer(time, self._omega), self._omega
        v = np.cos(phase) @ (omega * self.sine) - np.sin(phase) @ (omega * self.cosine)
        v[(time < 0) | (time > self.end)] = 0.0
        return np.asarray(v, dtype=np.float64)

    def corners(self) -> Array:
        """Return 16 times per period of the highest harmonic, since the start [s], growing."""
        count = round(self.end / self.period) * _SAMPLES_PER_SWING * len(self.sine)
        return np.linspace(0.0, self.end, count + 1)

    def angle(self) -> float:
        """Return 0: a whole period ends at its start angle."""
        return 0.0


@dataclass(frozen=True, kw_only=True)
class Spline(SmoothSpeed):
    """A smooth angle through points, without a stop between the first and the last.

    The speed and the acceleration are continuous between them; both ends are at rest.
    """

    points: NonEmpty[Values[Number]] = field(unit="s, deg", side="joint")
    """Pairs of time since the start of the segment, from 0, and angle, without alignment. The first
    angle is that of the joint there. The retiming planner slows down where the times are too short,
    and keeps the path."""

    def problems(self) -> Problems:
        """Yield points that are not pairs with growing times from 0."""
        yield from not_pairs("points", "angle deg", self.points)

    @cached_property
    def _angle(self) -> Any:
        from scipy.interpolate import CubicSpline  # it takes a third of a second

        time, angle = np.transpose(self.points)
        return CubicSpline(time, np.radians(angle), bc_type="clamped")

    @property
    def end(self) -> float:  # type: ignore[override]
        """End of the segment at rest, since its start [s]."""
        return self.points[-1][0]

    def speed(self, time: Array) -> Array:
        """Return the joint speed [rad/s] at `time` [s] since the start; 0 outside."""
        inside = (time > 0) & (time < self.end)  # exactly at rest at both ends
        return np.where(inside, self._angle(np.clip(time, 0, self.end), 1), 0.0)

    def corners(self) -> Array:
        """Return the times of the points and of turns of the speed, since the start [s]."""
        turns = self._angle.derivative(2).roots(extrapolate=False)
        return np.unique([*self._angle.x, *turns[np.isfinite(turns)]])

    def angle(self) -> float:
        """Return the change of the joint angle [rad]."""
        return math.radians(self.points[-1][1] - self.points[0][1])

    def text(self) -> str:
        """Return the number of points."""
        return f"through {len(self.points)} points"


def _too_many(period: float, end: float) -> Problems:
    """Yield a problem if there are more than `_MAX_SWINGS` until the end."""
    least = end / _MAX_SWINGS
    if period < least:
        text = f"{period:g} s, expected at least {least:g} s, for {_MAX_SWINGS} swings"
        yield "period", text
