"""Segments of motion profiles: the speed of a joint, or the commanded G, over an interval.

A segment consists of pieces from one speed to another, linear or along half a cosine. The angle is
the sum of (v_i + v_i+1) / 2 times the duration of each piece for both. Smooth speeds are added.
"""

import itertools
import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from sdt_drake.io.fields import (
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
        yield from not_pairs("knots", "speed rad/s", self.knots)

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


def not_pairs(name: str, value: str, pairs: Sequence[Sequence[float]]) -> Problems:
    """Yield what keeps a field from being pairs of time, growing from 0, and value."""
    if len(pairs) < 2 or any(len(pair) != 2 for pair in pairs):
        yield name, f"expected at least two pairs [time s, {value}]"
        return
    times = [time for time, _ in pairs]
    if times[0] != 0:
        yield name, f"start at {times[0]:.9g} s, expected 0 s"
    for earlier, later in itertools.pairwise(times):
        if later <= earlier:
            yield name, f"time {later:g} s after {earlier:g} s, expected growing times"


def either(thing: object, one: str, other: str) -> Problems:
    """Yield a problem unless exactly one of two fields is given."""
    given = [name for name in (one, other) if getattr(thing, name) is not None]
    if len(given) != 1:
        yield "", f"{' and '.join(given) or 'neither'}, expected either {one} or {other}"
