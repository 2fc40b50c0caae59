"""Predictions of the observer compared with reports of people, with verdicts from the numbers.

Motions, reports and sources are in reported.yaml.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.resources import shipped
from sdt_drake.io.shown import formatted, listed
from sdt_drake.io.yaml_files import read_yaml
from sdt_drake.pilot.head import GRAVITY
from sdt_drake.pilot.observer import PERCEPTION
from sdt_drake.pilot.orientation import Percept, perceive
from sdt_drake.run.threads import threads

GROUPS = ("yaw decay", "gondola turns")
"""Groups of motions; a parameter set should pass both."""

LEGEND = (
    "✓: within one standard deviation of the reported mean, or within the reported range. A signed "
    "number: distance from that mean in standard deviations, or from the middle of that range in "
    "half ranges. –: no spread is known."
)

_PERIOD = 0.02
"""Sample period of the motions [s]."""

_ARM = 7.25
"""Arm length of the centrifuge in the reports of gondola turns [m]."""

Head = tuple[Array, Array, Array]
"""A motion of the head: time [s] (N,), specific force [m/s²] and angular rate [rad/s] (N, 3)."""

Feel = Callable[[Array, Array, Array], Percept]
Numbers = Iterator[tuple[str, float]]
"""Ids of reported.yaml with the predictions of a parameter set for one motion."""


@dataclass(frozen=True)
class Judged:
    """A reported perception of a motion, and its predictions by parameter set."""

    id: str
    """Short name."""
    stimulus: str
    """The motion."""
    quantity: str
    """The reported quantity, with its unit."""
    mean: float
    """Mean of the reports, or middle of their range; NaN if there is no number."""
    spread: float
    """Standard deviation of the reports, or half of their range; NaN if unknown."""
    is_range: bool
    """True if the reports are given as a range."""
    source: str
    """Source of the reports, and their subjects."""
    group: str
    """Group of motions that a parameter set passes or fails as a whole."""
    predicted: Mapping[str, float]
    """Predictions by parameter set."""

    @property
    def reported(self) -> str:
        """Reported value as text: "20 ± 13.5" or "13 to 20"."""
        if self.is_range:
            return f"{self.mean - self.spread:g} to {self.mean + self.spread:g}"
        spread = "" if np.isnan(self.spread) else f" ± {self.spread:g}"
        return f"{formatted(self.mean, 'g')}{spread}"

    def deviations(self, name: str) -> float:
        """Return a set's prediction less the mean, in spreads [-]; NaN if none is known."""
        return (self.predicted[name] - self.mean) / self.spread

    def passes(self, name: str) -> bool:
        """Return whether a set's prediction lies within one standard deviation, or in the range."""
        return abs(self.deviations(name)) <= 1

    def cell(self, name: str) -> str:
        """Return a set's prediction with its verdict as a sign; see LEGEND."""
        deviations = self.deviations(name)
        sign = "–" if np.isnan(deviations) else "✓" if self.passes(name) else f"{deviations:+.1f}"
        return f"{self.predicted[name]:.1f} {sign}"


def validate(models: Sequence[str] = ()) -> list[Judged]:
    """Predict each motion of reported.yaml with parameter sets, by default all shipped ones."""
    models = models or tuple(shipped(PERCEPTION))
    pairs = [(motion, model) for motion in _MOTIONS for model in models]
    predicted: dict[str, dict[str, float]] = {}
    with threads(2) as pool:  # Drake steps without the interpreter lock
        results = pool.map(lambda pair: list(pair[0](partial(perceive, model=pair[1]))), pairs)
        for (_, model), numbers in zip(pairs, results, strict=True):
            for id_, value in numbers:
                predicted.setdefault(id_, {})[model] = value
    return [_judged(text, predicted[text["id"]]) for text in _texts()]


def verdict_of_all(rows: Sequence[Judged]) -> str:
    """Return a sentence with the sets that pass all motions of each of GROUPS."""
    models = list(rows[0].predicted)
    passing = {
        group: [m for m in models if all(row.passes(m) for row in rows if row.group == group)]
        for group in GROUPS
    }
    both = [m for m in models if all(m in passing[group] for group in GROUPS)]
    each = "; ".join(f"{group}: {listed(names) or 'none'}" for group, names in passing.items())
    subject = f"{listed(both)} pass" if both else "No parameter set passes"
    return f"{subject} both groups of reported motions ({each})."


def _judged(text: Mapping[str, Any], predicted: Mapping[str, float]) -> Judged:
    """Return an entry of reported.yaml with its predictions."""
    low, high = text.get("range", (np.nan, np.nan))
    return Judged(
        **{name: text[name] for name in ("id", "stimulus", "quantity", "source", "group")},
        mean=text.get("mean", (low + high) / 2),
        spread=text.get("deviation", (high - low) / 2),
        is_range="range" in text,
        predicted=predicted,
    )


@cache
def _texts() -> Any:
    """Return the entries of reported.yaml."""
    return read_yaml(Path(__file__).with_name("reported.yaml"))


# --- the motions, and the quantities predicted of them ---------------------------------------


def _yaw(feel: Feel) -> Numbers:
    time, force, rate = _samples(242)
    rate[:, 2] = np.radians(np.interp(time, [0, 1, 121, 122], [0, 60, 60, 0]))
    felt = feel(time, force, rate)
    yield "yaw_start", _fading(time, felt.rate[:, 2], 1, 121)
    yield "yaw_stop", _fading(time, felt.rate[:, 2], 122)


def _forward(feel: Feel) -> Numbers:
    time, force, rate = _samples(60)
    force[1:, 0] = 0.3 * GRAVITY
    yield "forward", float(np.degrees(feel(time, force, rate).pitch[-1]))


def _turn_156(feel: Feel) -> Numbers:
    felt = feel(*_gondola(50, rise=7, hold=300))
    inwards = -np.degrees(felt.roll)
    yield "turn_1.56_start", float(np.interp(7, felt.time, inwards))
    yield "turn_1.56_fading", _fading(felt.time, inwards, 7)
    yield "turn_1.56_end", float(inwards[-1])


def _turn_2(feel: Feel) -> Numbers:
    inwards = -float(np.degrees(feel(*_gondola(60, rise=10, hold=0)).roll[-1]))
    yield "turn_2_start", inwards
    yield "turn_2_start_pilots", inwards
    time, force, rate = _gondola(60, rise=10, hold=0)
    half_turn = [-1, -1, 1]
    felt = feel(time, force * half_turn, rate * half_turn)
    yield "turn_2_backward", float(np.degrees(felt.roll[-1]))


def _coriolis(feel: Feel) -> Numbers:
    time, force, rate = _samples(69.5)
    spin = np.radians(np.interp(time, [0, 9], [0, 90]))
    roll = np.radians(np.interp(time, [68, 69.5], [0, 30]))
    rate[:, 0] = np.where(time > 68, np.radians(30 / 1.5), 0)
    rate[:, 1], rate[:, 2] = spin * np.sin(roll), spin * np.cos(roll)
    force[:, 1], force[:, 2] = GRAVITY * np.sin(roll), GRAVITY * np.cos(roll)
    yield "coriolis", float(abs(np.degrees(feel(time, force, rate).rate[-1, 1])))


_MOTIONS = (_yaw, _forward, _turn_156, _turn_2, _coriolis)


def _samples(duration: float) -> Head:
    """Return time, specific force and angular rate of a head that is upright and at rest."""
    time = _PERIOD * np.arange(round(duration / _PERIOD) + 1, dtype=float)
    force, rate = np.zeros((2, len(time), 3))
    force[:, 2] = GRAVITY
    return time, force, rate


def _gondola(angle_deg: float, rise: float, hold: float) -> Head:
    """Return the head motion of a left turn in a gondola on an arm, facing forward.

    The gondola rolls along the resultant of gravity and centripetal force, to `angle_deg`; the
    tangential force stays along x. The arm accelerates uniformly for `rise` [s], then turns
    uniformly for `hold` [s].
    """
    time, force, rate = _samples(rise + hold)
    largest = np.sqrt(GRAVITY * np.tan(np.radians(angle_deg)) / _ARM)
    rising, omega = time < rise, largest * np.minimum(time / rise, 1)
    tangent = omega**2 * _ARM / GRAVITY
    angle, rate_of_tangent = np.arctan(tangent), 2 * omega * largest / rise * _ARM / GRAVITY
    rate[:, 0] = np.where(rising, -rate_of_tangent / (1 + tangent**2), 0)
    rate[:, 1], rate[:, 2] = -omega * np.sin(angle), omega * np.cos(angle)
    force[:, 0] = np.where(rising, largest / rise * _ARM, 0)
    force[:, 2] = GRAVITY / np.cos(angle)
    return time, force, rate


def _fading(time: Array, values: Array, start: float, end: float = np.inf) -> float:
    """Return the time from `start` until values first fall to 37 % [s]; NaN if they do not."""
    since = (time >= start - 1e-9) & (time <= end)
    below = np.abs(values[since]) <= 0.37 * abs(values[since][0])
    return float(time[since][below.argmax()] - start) if below.any() else np.nan
