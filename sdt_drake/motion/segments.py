"""Segments of motion profiles: the speed of a joint, or the commanded G, over an interval.

A segment consists of pieces from one speed to another, linear or along half a cosine. The angle is
the sum of (v_i + v_i+1) / 2 times the duration of each piece for both. Smooth speeds are added.
"""

import itertools
import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.fields import (
    ByTag,
    NonEmpty,
    NotNegative,
    Number,
    Positive,
    Problems,
    Values,
    Variant,
    field,
)
from sdt_drake.motion.spin import SpinGeometry

SpeedStep = tuple[float, float]
"""Time since the start of the segment [s], and the speed then [rad/s]."""

Blend = Literal["cosine", "linear"]
# Largest acceleration of a ramp, over its mean one.
_PEAK_ACCELERATION = {"cosine": np.pi / 2, "linear": 1.0}
# Largest speed of a turn, over its mean one: up and down along cosines, or a trapezoid whose
# thirds take equal times.
_PEAK_SPEED = {"cosine": 2.0, "linear": 1.5}
_MAX_SWINGS = 100_000  # by memory
_SAMPLES_PER_SWING = 16  # to check what an interpolation period loses of it
_DIGITS = 1e-6  # relative round-off of numbers in a file


@dataclass(frozen=True, kw_only=True)
class Segment(Variant, ABC):
    """The speed of a joint, or a commanded G, over an interval."""

    at: NotNegative | None = field(
        None, unit="s", description="Start; the end of the segment before by default."
    )

    blend = "linear"
    """Shape of the speed between two points."""

    def start_speed(self, speed: float) -> float:
        """Return the speed at the start [rad/s], where `speed` is that of the segment before."""
        return speed

    @abstractmethod
    def steps(self, speed: float, angle: float, geometry: SpinGeometry | None) -> list[SpeedStep]:
        """Return the ends of the pieces of the speed.

        Args:
            speed: speed at the start [rad/s].
            angle: angle of the joint at the start, without alignment [rad].
            geometry: geometry of the spin, in a track of a resultant.
        """

    def text(self) -> str:
        """Return a description in a few words."""
        return type(self).__name__.lower()


@dataclass(frozen=True, kw_only=True)
class Hold(Segment):
    """A constant speed."""

    duration: Positive = field(unit="s")
    """Duration of the segment."""

    def steps(self, speed: float, angle: float, geometry: SpinGeometry | None) -> list[SpeedStep]:
        """Return one piece at this speed."""
        return [(self.duration, speed)]


@dataclass(frozen=True, kw_only=True)
class Ramp(Segment):
    """A change from the present speed to another one."""

    to_deg_s: Number | None = field(None, unit="deg/s", side="joint")
    """Joint speed at the end, in a track of a joint."""
    to_g: Number | None = field(None, ge=1, unit="G")
    """Resultant of gravity and centripetal acceleration at the end, in a track of the
    resultant. The blend is that of the spin joint's speed, not of G: d omega / d G is infinite at
    1 G."""
    duration: Positive | None = field(None, unit="s")
    """Duration of the change; alternative to acceleration_deg_s2."""
    acceleration_deg_s2: Positive | None = field(None, unit="deg/s²", side="joint")
    """Largest acceleration; alternative to duration."""
    blend: Blend = "cosine"
    """Shape of the speed: "cosine", or "linear" with jumps of the acceleration."""

    def problems(self) -> Problems:
        """Yield alternative fields unless exactly one is given."""
        yield from either(self, "to_deg_s", "to_g")
        yield from either(self, "duration", "acceleration_deg_s2")

    def steps(self, speed: float, angle: float, geometry: SpinGeometry | None) -> list[SpeedStep]:
        """Return one piece to the target speed."""
        target = math.radians(self.to_deg_s or 0)
        if geometry is not None and self.to_g is not None:
            target = geometry.speed(self.to_g)
        if self.duration is not None:
            return [(self.duration, target)]
        mean = math.radians(self.acceleration_deg_s2 or 0) / _PEAK_ACCELERATION[self.blend]
        return [(abs(target - speed) / mean, target)]

    def text(self) -> str:
        """Return the target and the blend."""
        target = f"{self.to_deg_s:g} deg/s" if self.to_g is None else f"{self.to_g:g} G"
        return f"to {target}, {self.blend}"


@dataclass(frozen=True, kw_only=True)
class Turn(Segment):
    """A turn of the joint from rest to rest."""

    by_deg: Number | None = field(None, unit="deg", side="joint")
    """Change of the angle; alternative to to_deg."""
    to_deg: Number | None = field(None, unit="deg", side="joint")
    """Angle at the end, without alignment; alternative to by_deg."""
    duration: Positive | None = field(None, unit="s")
    """Duration of the turn; alternative to speed_deg_s."""
    speed_deg_s: Positive | None = field(None, unit="deg/s", side="joint")
    """Largest speed; alternative to duration."""
    blend: Blend = "cosine"
    """Shape of the speed: "cosine" is (1 - cos) / 2, whose mean is half the largest speed; "linear"
    is a trapezoid of three equal times, whose mean is two thirds."""

    def problems(self) -> Problems:
        """Yield alternative fields unless exactly one is given."""
        yield from either(self, "by_deg", "to_deg")
        yield from either(self, "duration", "speed_deg_s")

    def steps(self, speed: float, angle: float, geometry: SpinGeometry | None) -> list[SpeedStep]:
        """Return two cosine pieces or three linear ones."""
        by = math.radians(self.by_deg or 0)
        if self.to_deg is not None:
            by = math.radians(self.to_deg) - angle
        factor = _PEAK_SPEED[self.blend]
        duration = self.duration
        if duration is None:
            duration = factor * abs(by) / math.radians(self.speed_deg_s or 0)
        peak = factor * by / duration if duration > 0 else 0.0
        speeds = (peak, 0.0) if self.blend == "cosine" else (peak, peak, 0.0)
        return [((i + 1) * duration / len(speeds), v) for i, v in enumerate(speeds)]

    def text(self) -> str:
        """Return the turn and the blend."""
        turn = f"by {self.by_deg:g} deg" if self.to_deg is None else f"to {self.to_deg:g} deg"
        return f"turn {turn}, {self.blend}"


class PiecewiseLinearSpeed(Segment):
    """A speed that is linear between points."""

    @abstractmethod
    def points(self) -> list[SpeedStep]:
        """Return times since the start of the segment, from 0, and speeds."""

    def start_speed(self, speed: float) -> float:
        """Return the speed of the first point [rad/s]."""
        return self.points()[0][1]

    def steps(self, speed: float, angle: float, geometry: SpinGeometry | None) -> list[SpeedStep]:
        """Return a piece for each point after the first."""
        return self.points()[1:]


@dataclass(frozen=True, kw_only=True)
class Knots(PiecewiseLinearSpeed):
    """A piecewise-linear speed."""

    knots: NonEmpty[Values[Number]] = field(unit="s, rad/s", side="joint")
    """Pairs of time since the start of the segment, from 0, and speed."""

    def problems(self) -> Problems:
        """Yield knots that are not pairs with growing times from 0."""
        if len(self.knots) < 2 or any(len(knot) != 2 for knot in self.knots):
            yield "knots", "expected at least two pairs [time s, speed rad/s]"
            return
        times = [time for time, _ in self.knots]
        if times[0] != 0:
            yield "knots", f"start at {times[0]:.9g} s, expected 0 s"
        for earlier, later in itertools.pairwise(times):
            if later <= earlier:
                yield "knots", f"time {later:g} s after {earlier:g} s, expected growing times"

    def points(self) -> list[SpeedStep]:
        """Return the knots."""
        return [(time, v) for time, v in self.knots]


@dataclass(frozen=True, kw_only=True)
class Sampled(PiecewiseLinearSpeed):
    """A speed sampled at equal periods, linear between the samples."""

    period: Positive = field(unit="s")
    """Sample period."""
    speeds: NonEmpty[Number] = field(unit="rad/s", side="joint")
    """Joint speeds at 0, period, 2 period, ... since the start of the segment."""

    def problems(self) -> Problems:
        """Yield speeds with fewer than two samples."""
        if len(self.speeds) < 2:
            yield "speeds", f"{len(self.speeds)} value(s), expected at least two"

    def points(self) -> list[SpeedStep]:
        """Return the samples."""
        return [(i * self.period, v) for i, v in enumerate(self.speeds)]


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


_Whole = Knots | Sampled | Oscillation | Fourier
JointSegment = Annotated[_Whole, ByTag()]
"""A segment that may be the whole motion of a joint."""
AnySegment = Annotated[Ramp | Hold | Turn | _Whole, ByTag()]
"""A segment of a track."""


def _too_many(period: float, end: float) -> Problems:
    """Yield a problem if there are more than `_MAX_SWINGS` until the end."""
    least = end / _MAX_SWINGS
    if period < least:
        text = f"{period:g} s, expected at least {least:g} s, for {_MAX_SWINGS} swings"
        yield "period", text


def either(thing: object, one: str, other: str) -> Problems:
    """Yield a problem unless exactly one of two fields is given."""
    given = [name for name in (one, other) if getattr(thing, name) is not None]
    if len(given) != 1:
        yield "", f"{' and '.join(given) or 'neither'}, expected either {one} or {other}"
