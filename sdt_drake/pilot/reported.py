"""Predictions of the observer compared with reports of people, with verdicts from the numbers.

Motions, reports and sources are in reported.yaml.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from sdt_drake.io.resources import shipped
from sdt_drake.io.shown import formatted, listed
from sdt_drake.io.yaml_files import read_yaml
from sdt_drake.pilot.observer import PERCEPTION
from sdt_drake.pilot.orientation import perceive
from sdt_drake.pilot.reported_motions import MOTIONS

LEGEND = (
    "✓: within one standard deviation of the reported mean, or within the reported range. A signed "
    "number: distance from that mean in standard deviations, or from the middle of that range in "
    "half ranges. –: no spread is known. "
    "Plateaus of 5 and 6 min are simulated for 2 min; felt roll then changes by less than 0.7 deg."
)


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
        digits = 2 if self.quantity.endswith("[-]") else 1
        return f"{self.predicted[name]:.{digits}f} {sign}"


def validate(models: Sequence[str] = ()) -> list[Judged]:
    """Predict each motion of reported.yaml with parameter sets, by default all shipped ones."""
    models = models or tuple(shipped(PERCEPTION))
    predicted: dict[str, dict[str, float]] = {}
    for motion, model in product(MOTIONS, models):
        for id_, value in motion(partial(perceive, model=model)):
            predicted.setdefault(id_, {})[model] = value
    return [_judged(text, predicted[text["id"]]) for text in _texts()]


def verdict_of_all(rows: Sequence[Judged]) -> str:
    """Return sentences on how many reports each set passes, and on the groups that it passes."""
    judged = [row for row in rows if not np.isnan(row.spread)]
    passed = {model: sum(row.passes(model) for row in judged) for model in rows[0].predicted}
    best, *others = sorted(passed, key=lambda model: -passed[model])
    beside = f" ({listed([f'{model} {passed[model]}' for model in others])})" if others else ""
    passing = {
        group: [m for m in passed if all(row.passes(m) for row in judged if row.group == group)]
        for group in dict.fromkeys(row.group for row in judged)
    }
    each = "; ".join(f"{group}: {listed(names) or 'none'}" for group, names in passing.items())
    all_of_them = [m for m in passed if all(m in names for names in passing.values())]
    subject = f"{listed(all_of_them)} pass" if all_of_them else "No parameter set passes"
    return (
        f"Of {len(judged)} reports, {best} passes most, {passed[best]}{beside}. "
        f"{subject} all groups of reported motions ({each})."
    )


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
