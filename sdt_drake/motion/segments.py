"""Segments of motion profiles: what a joint, or a wanted G, does for a while.

A segment is made of pieces from one speed to another, linear or along half a cosine; so an angle is
the sum of (v_i + v_i+1) / 2 times the time of each piece, whatever its blend. Only a swing is not.
"""

import itertools
import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.fields import (
    NotNegative,
    Number,
    OneOf,
    Positive,
    Problems,
    Some,
    Variant,
    setting,
)
from sdt_drake.motion.spin import SpinGeometry

SpeedStep = tuple[float, float]  # when, since its segment began [s], and the speed then [rad/s]

BLENDS = ("cosine", "linear")
# Largest acceleration of a ramp, over its mean one.
_PEAK_ACCELERATION = {"cosine": np.pi / 2, "linear": 1.0}
# Largest speed of a turn, over its mean one: up and down along cosines, or a trapezoid whose
# thirds take equal times.
_PEAK_SPEED = {"cosine": 2.0, "linear": 1.5}
_MOST_SWINGS = 100_000  # what memory holds
_LOOKS = 16  # at a swing, to see what a period loses of it
_SAME = 1e-6  # of a number that a file gives, as its digits are


@dataclass(kw_only=True)
class Segment(Variant, ABC):
    """What a joint, or a wanted G, does for a while."""

    at: NotNegative | None = setting(
        None, unit="s", description="Start; right after the segment before if not given."
    )

    blend = "linear"  # of the speed

    def start_speed(self, speed: float) -> float:
        """Speed at the start [rad/s], after `speed`."""
        return speed

    @abstractmethod
    def steps(self, speed: float, angle: float, geometry: SpinGeometry | None) -> list[SpeedStep]:
        """Pieces of the speed, by their ends.

        Args:
            speed: at the start [rad/s].
            angle: of the joint at the start [rad], without its share of an alignment.
            geometry: how the joint makes a G, in a track of a resultant.
        """

    def text(self) -> str:
        """What the segment does, in a few words."""
        return type(self).__name__.lower()


@dataclass(kw_only=True)
class Hold(Segment):
    """The speed stays what it is."""

    duration: Positive = setting(unit="s")
    """For how long."""

    def steps(self, speed: float, angle: float, geometry: SpinGeometry | None) -> list[SpeedStep]:
        """One piece."""
        return [(self.duration, speed)]


@dataclass(kw_only=True)
class Ramp(Segment):
    """The speed goes from what it is to another one."""

    to_deg_s: Number | None = setting(None, unit="deg/s", side="joint")
    """Joint speed at the end; in a track of a joint."""
    to_g: Number | None = setting(None, ge=1, unit="G")
    """Resultant of gravity and centripetal acceleration at the end; in a track of the
    resultant. The speed of the spin joint is what goes linearly or along a cosine: d omega / d
    G is infinite at 1 G."""
    duration: Positive | None = setting(None, unit="s")
    """How long it takes; or else acceleration_deg_s2."""
    acceleration_deg_s2: Positive | None = setting(None, unit="deg/s²", side="joint")
    """The largest one; or else duration."""
    blend: Annotated[str, OneOf(BLENDS)] = "cosine"
    """Of the speed, "cosine" or "linear" (whose acceleration jumps)."""

    def problems(self) -> Problems:
        """Of two fields that say the same, one is given."""
        yield from either(self, "to_deg_s", "to_g")
        yield from either(self, "duration", "acceleration_deg_s2")

    def steps(self, speed: float, angle: float, geometry: SpinGeometry | None) -> list[SpeedStep]:
        """One piece."""
        target = math.radians(self.to_deg_s or 0)
        if geometry is not None and self.to_g is not None:
            target = geometry.speed(self.to_g)
        if self.duration is not None:
            return [(self.duration, target)]
        mean = math.radians(self.acceleration_deg_s2 or 0) / _PEAK_ACCELERATION[self.blend]
        return [(abs(target - speed) / mean, target)]

    def text(self) -> str:
        """Where to, and how."""
        target = f"{self.to_deg_s:g} deg/s" if self.to_g is None else f"{self.to_g:g} G"
        return f"to {target}, {self.blend}"


@dataclass(kw_only=True)
class Turn(Segment):
    """The joint turns from rest to rest."""

    by_deg: Number | None = setting(None, unit="deg", side="joint")
    """Change of the angle; or else to_deg."""
    to_deg: Number | None = setting(None, unit="deg", side="joint")
    """Angle at the end, of the joint without its share of an alignment; or else by_deg."""
    duration: Positive | None = setting(None, unit="s")
    """How long it takes; or else speed_deg_s."""
    speed_deg_s: Positive | None = setting(None, unit="deg/s", side="joint")
    """The largest speed; or else duration."""
    blend: Annotated[str, OneOf(BLENDS)] = "cosine"
    """Of the speed: "cosine", (1 - cos) / 2 with a mean of half the largest, or "linear", a
    trapezoid of three equal times with a mean of two thirds."""

    def problems(self) -> Problems:
        """Of two fields that say the same, one is given."""
        yield from either(self, "by_deg", "to_deg")
        yield from either(self, "duration", "speed_deg_s")

    def steps(self, speed: float, angle: float, geometry: SpinGeometry | None) -> list[SpeedStep]:
        """Two pieces along cosines, or three linear ones."""
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
        """Where to, and how."""
        turn = f"by {self.by_deg:g} deg" if self.to_deg is None else f"to {self.to_deg:g} deg"
        return f"turn {turn}, {self.blend}"


class Given(Segment):
    """A speed that is given point by point, linear between them."""

    @abstractmethod
    def points(self) -> list[SpeedStep]:
        """Speeds and their times since the start of the segment, from 0 on."""

    def start_speed(self, speed: float) -> float:
        """Speed of the first point [rad/s]."""
        return self.points()[0][1]

    def steps(self, speed: float, angle: float, geometry: SpinGeometry | None) -> list[SpeedStep]:
        """A piece for each point but the first."""
        return self.points()[1:]


@dataclass(kw_only=True)
class Knots(Given):
    """Piecewise-linear speed."""

    knots: Some[list[Number]] = setting(unit="s, rad/s", side="joint")
    """Pairs of time since the start of the segment, from 0 on, and speed."""

    def problems(self) -> Problems:
        """There are pairs in growing time from 0 on."""
        if len(self.knots) < 2 or any(len(knot) != 2 for knot in self.knots):
            yield "knots", "expected at least two pairs [time s, speed rad/s]"
            return
        times = [time for time, _ in self.knots]
        if times[0] != 0:
            yield "knots", f"from {times[0]:.9g} s on, expected from 0 s on"
        for earlier, later in itertools.pairwise(times):
            if later <= earlier:
                yield "knots", f"time {later:g} s after {earlier:g} s, expected growing times"

    def points(self) -> list[SpeedStep]:
        """The knots."""
        return [(time, v) for time, v in self.knots]


@dataclass(kw_only=True)
class Sampled(Given):
    """Speed given at equal steps, linear between them."""

    period: Positive = setting(unit="s")
    """Time between samples."""
    speeds: Some[Number] = setting(unit="rad/s", side="joint")
    """Joint speed at 0, period, 2 period, ... since the start of the segment."""

    def problems(self) -> Problems:
        """There are samples to go between."""
        if len(self.speeds) < 2:
            yield "speeds", f"{len(self.speeds)} value(s), expected two or more"

    def points(self) -> list[SpeedStep]:
        """The samples."""
        return [(i * self.period, v) for i, v in enumerate(self.speeds)]


class Swing(Segment):
    """A speed beside that of the pieces, from rest to rest."""

    end: float

    @abstractmethod
    def speed(self, time: Array) -> Array:
        """Joint speed [rad/s] at `time` [s] since the start, shape (N,); 0 outside."""

    @abstractmethod
    def corners(self) -> Array:
        """Times since the start between which the speed goes one way [s], growing."""

    @abstractmethod
    def angle(self) -> float:
        """By how much it changes the angle of the joint [rad]."""

    def steps(self, speed: float, angle: float, geometry: SpinGeometry | None) -> list[SpeedStep]:
        """A rest, to which the swing is added."""
        return [(self.end, 0.0)]


@dataclass(kw_only=True)
class Oscillation(Swing):
    """Speed of a swing A sin(2 pi t / T) that is faded in and out.

    v(t) = A (2 pi / T) cos(2 pi t / T) clip(t / fade, 0, 1) clip((end - t) / fade, 0, 1),
    t since the start of the segment.
    """

    amplitude: Number = setting(unit="rad", side="joint")
    """A, of the angle."""
    period: Positive = setting(unit="s")
    """T, of a swing."""
    fade: Positive = setting(unit="s")
    """Time to full swing, and to rest."""
    end: Positive = setting(unit="s")
    """When it is at rest again, since the start of the segment."""

    def problems(self) -> Problems:
        """The swings can be counted."""
        yield from _too_many(self.period, self.end)

    def speed(self, time: Array) -> Array:
        """Joint speed [rad/s] at `time` [s] since the start."""
        omega = 2 * np.pi / self.period
        fade_in = np.clip(time / self.fade, 0, 1)
        fade_out = np.clip((self.end - time) / self.fade, 0, 1)
        return self.amplitude * omega * np.cos(omega * time) * fade_in * fade_out

    def corners(self) -> Array:
        """Times since the start, denser than it turns, and where it fades [s], growing."""
        turns = np.arange(0, self.end, self.period / _LOOKS)
        fading = np.array([self.fade, self.end - self.fade, self.end])
        return np.unique(np.concatenate([turns, np.clip(fading, 0, self.end)]))

    def angle(self) -> float:
        """By how much it changes the angle of the joint [rad]."""
        nodes, weights = np.polynomial.legendre.leggauss(8)
        corners = self.corners()
        half, middle = np.diff(corners) / 2, (corners[1:] + corners[:-1]) / 2
        return float(half @ self.speed(middle[:, None] + half[:, None] * nodes) @ weights)


@dataclass(kw_only=True)
class Fourier(Swing):
    """A periodic motion: a sum of harmonics, over whole periods.

    q(t) - q(0) = sum over l of sine_l sin(2 pi l t / T) + cosine_l (cos(2 pi l t / T) - 1),
    t since the start of the segment.
    """

    period: Positive = setting(unit="s")
    """T, of the first harmonic."""
    sine: Some[Number] = setting(unit="rad", side="joint")
    """Amplitudes of the angle; l times sine_l add up to 0, so that it starts at rest."""
    cosine: Some[Number] = setting(unit="rad", side="joint")
    """Likewise, as many; any."""
    end: Positive = setting(unit="s")
    """When it is at rest again, since the start of the segment: a multiple of the period."""

    def problems(self) -> Problems:
        """It starts and ends at rest, and its swings can be counted."""
        if len(self.sine) != len(self.cosine):
            yield "cosine", f"{len(self.cosine)} value(s), expected {len(self.sine)} as in sine"
            return
        if too_many := list(_too_many(self.period, self.end * len(self.sine))):
            yield from too_many
        elif abs(self.end / self.period - round(self.end / self.period)) > _SAME:
            yield "end", f"{self.end:g} s, expected a multiple of the period, {self.period:g} s"
        start = float(self.speed(np.zeros(1))[0])
        if abs(start) > _SAME * (1 + float(np.abs(self._omega @ np.abs(self.sine)))):
            yield "sine", f"starts at {start:.3g} rad/s, expected rest: l sine_l add up to 0"

    @property
    def _omega(self) -> Array:
        """Of the harmonics [rad/s]."""
        return 2 * np.pi / self.period * np.arange(1.0, len(self.sine) + 1)

    def speed(self, time: Array) -> Array:
        """Joint speed [rad/s] at `time` [s] since the start, shape (N,); 0 outside."""
        phase, omega = np.multiply.outer(time, self._omega), self._omega
        v = np.cos(phase) @ (omega * self.sine) - np.sin(phase) @ (omega * self.cosine)
        v[(time < 0) | (time > self.end)] = 0.0
        return np.asarray(v, dtype=np.float64)

    def corners(self) -> Array:
        """Times since the start, denser than it turns [s], growing."""
        count = round(self.end / self.period) * _LOOKS * len(self.sine)
        return np.linspace(0.0, self.end, count + 1)

    def angle(self) -> float:
        """It ends where it starts."""
        return 0.0


def _too_many(period: float, end: float) -> Problems:
    """A problem where there are more swings until the end than memory holds."""
    least = end / _MOST_SWINGS
    if period < least:
        text = f"{period:g} s, expected at least {least:g} s, for {_MOST_SWINGS} swings"
        yield "period", text


def either(thing: object, one: str, other: str) -> Problems:
    """A problem unless exactly one of two fields is given."""
    given = [name for name in (one, other) if getattr(thing, name) is not None]
    if len(given) != 1:
        yield "", f"{' and '.join(given) or 'neither'}, expected either {one} or {other}"
