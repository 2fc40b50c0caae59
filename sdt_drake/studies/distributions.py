"""Distributions of what varies in a study.

Random ones have `quantile`, which takes shares in (0, 1) to values; the others have `levels`, which
are all run, each with the same draws of the random ones, and `size`, how many they are: a study
that is too large is refused before they are made.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.fields import Number, Positive, Problems, Some, Variant, setting
from sdt_drake.studies.fields import Value

MOST_RUNS = 10_000_000
_ITS_OWN = "of the field"  # a unit


@dataclass
class Uniform(Variant):
    """Evenly between low and high."""

    low: Number = setting(unit=_ITS_OWN)
    """The least value."""
    high: Number = setting(unit=_ITS_OWN)
    """The largest value."""

    def problems(self) -> Problems:
        yield from _width_problems(self.low, self.high)

    def quantile(self, share: Array) -> Array:
        from scipy import stats

        return stats.uniform(self.low, self.high - self.low).ppf(share)


@dataclass
class LogUniform(Variant):
    """Evenly in the logarithm, between low and high."""

    low: Positive = setting(unit=_ITS_OWN)
    """The least value."""
    high: Positive = setting(unit=_ITS_OWN)
    """The largest value."""

    def problems(self) -> Problems:
        yield from _width_problems(self.low, self.high)

    def quantile(self, share: Array) -> Array:
        from scipy import stats

        return stats.loguniform(self.low, self.high).ppf(share)


@dataclass
class Normal(Variant):
    """Gaussian; with low or high, what is beyond is cut off and the rest scaled up."""

    mean: Number = setting(unit=_ITS_OWN)
    """Before anything is cut off."""
    std: Positive = setting(unit=_ITS_OWN)
    """Standard deviation, before anything is cut off."""
    low: Number | None = setting(None, unit=_ITS_OWN)
    """The least value; none by default."""
    high: Number | None = setting(None, unit=_ITS_OWN)
    """The largest value; none by default."""

    def problems(self) -> Problems:
        low, high = self._range
        yield from _width_problems(low, high)
        normal = NormalDist(self.mean, self.std)
        if not normal.cdf(high) - normal.cdf(low) > 1e-6:
            yield "", "nothing of it is between low and high"

    @property
    def _range(self) -> tuple[float, float]:
        low = -math.inf if self.low is None else self.low
        return low, math.inf if self.high is None else self.high

    def quantile(self, share: Array) -> Array:
        from scipy import stats

        low, high = ((bound - self.mean) / self.std for bound in self._range)
        return stats.truncnorm(low, high, self.mean, self.std).ppf(share)


@dataclass
class Grid(Variant):
    """Values that are equal steps apart, all of which are run."""

    start: Number = setting(unit=_ITS_OWN)
    """The first."""
    stop: Number = setting(unit=_ITS_OWN)
    """The last, which is one of them."""
    count: int = setting(2, ge=2, le=MOST_RUNS, unit="-")
    """How many."""

    def problems(self) -> Problems:
        if self.start == self.stop:
            yield "", f"start and stop are both {self.start:g}"

    @property
    def size(self) -> int:
        return self.count

    def levels(self) -> list[Value]:
        return np.linspace(self.start, self.stop, self.count).tolist()


class _Listed(Variant):
    values: Sequence[Value]

    def problems(self) -> Problems:
        if len(set(self.values)) < len(self.values):
            yield "values", f"{self.values} has a value twice"
        for value in self.values:
            yield from text_problems("values", value)

    @property
    def size(self) -> int:
        return len(self.values)

    def levels(self) -> list[Value]:
        return list(self.values)


@dataclass
class List(_Listed):
    """These numbers, all of which are run."""

    values: Some[Number] = setting(unit=_ITS_OWN)
    """Each once."""


@dataclass
class Choice(_Listed):
    """These texts, all of which are run."""

    values: Some[str]
    """Kinds, labels of controllers, names of motions or motors, true or false; each once."""


Random = Uniform | LogUniform | Normal


def _width_problems(low: float, high: float) -> Problems:
    if not low < high:
        yield "", f"low {low:g}, high {high:g}, expected low < high"


def text_problems(field: str, text: Value) -> Problems:
    """Names and levels go into file names, tables and pages."""
    if isinstance(text, str) and (not text.isprintable() or text != text.strip()):
        yield field, f"{text!r}, expected characters that are seen, no space at an end"
