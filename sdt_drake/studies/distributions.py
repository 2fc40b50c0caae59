"""Distributions of the variables of a study.

Random distributions have `quantile`, which maps shares in (0, 1) to values. The others have
`levels`, all of which are run with every draw, and `size`, the number of levels. Too large a study
is refused by these sizes before any levels are made.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Annotated

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.fields import ByTag, NonEmpty, Number, Positive, Problems, Variant, field
from sdt_drake.studies.table import Value

MAX_RUNS = 10_000_000
_FIELD_UNIT = "of the field"


@dataclass(frozen=True)
class Uniform(Variant):
    """A uniform distribution between low and high."""

    low: Number = field(unit=_FIELD_UNIT)
    """Smallest value."""
    high: Number = field(unit=_FIELD_UNIT)
    """Largest value."""

    def problems(self) -> Problems:
        yield from _width_problems(self.low, self.high)

    def quantile(self, share: Array) -> Array:
        from scipy import stats

        return stats.uniform(self.low, self.high - self.low).ppf(share)


@dataclass(frozen=True)
class LogUniform(Variant):
    """A distribution whose logarithm is uniform between those of low and high."""

    low: Positive = field(unit=_FIELD_UNIT)
    """Smallest value."""
    high: Positive = field(unit=_FIELD_UNIT)
    """Largest value."""

    def problems(self) -> Problems:
        yield from _width_problems(self.low, self.high)

    def quantile(self, share: Array) -> Array:
        from scipy import stats

        return stats.loguniform(self.low, self.high).ppf(share)


@dataclass(frozen=True)
class Normal(Variant):
    """A normal distribution, truncated at low and high if they are given."""

    mean: Number = field(unit=_FIELD_UNIT)
    """Mean before truncation."""
    std: Positive = field(unit=_FIELD_UNIT)
    """Standard deviation before truncation."""
    low: Number | None = field(None, unit=_FIELD_UNIT)
    """Smallest value; unlimited by default."""
    high: Number | None = field(None, unit=_FIELD_UNIT)
    """Largest value; unlimited by default."""

    def problems(self) -> Problems:
        low, high = self._range
        yield from _width_problems(low, high)
        normal = NormalDist(self.mean, self.std)
        if not normal.cdf(high) - normal.cdf(low) > 1e-6:
            yield (
                "",
                f"low {low:g}, high {high:g}: less than 1e-6 of the distribution lies between, "
                "expected limits nearer to the mean",
            )

    @property
    def _range(self) -> tuple[float, float]:
        low = -math.inf if self.low is None else self.low
        return low, math.inf if self.high is None else self.high

    def quantile(self, share: Array) -> Array:
        from scipy import stats

        low, high = ((bound - self.mean) / self.std for bound in self._range)
        return stats.truncnorm(low, high, self.mean, self.std).ppf(share)


@dataclass(frozen=True)
class Grid(Variant):
    """Equally spaced values, all of which are run."""

    start: Number = field(unit=_FIELD_UNIT)
    """First value."""
    stop: Number = field(unit=_FIELD_UNIT)
    """Last value."""
    count: int = field(2, ge=2, le=MAX_RUNS, unit="-")
    """Number of values, including the first and the last."""

    def problems(self) -> Problems:
        if self.start == self.stop:
            yield "", f"start and stop are both {self.start:g}, expected different numbers"

    @property
    def size(self) -> int:
        return self.count

    def levels(self) -> list[Value]:
        return np.linspace(self.start, self.stop, self.count).tolist()


class _Listed(Variant):
    values: Sequence[Value]

    def problems(self) -> Problems:
        if len(set(self.values)) < len(self.values):
            yield "values", f"{[*self.values]} has a value twice, expected each once"
        for value in self.values:
            yield from text_problems("values", value)

    @property
    def size(self) -> int:
        return len(self.values)

    def levels(self) -> list[Value]:
        return list(self.values)


@dataclass(frozen=True)
class List(_Listed):
    """A list of numbers, all of which are run."""

    values: NonEmpty[Number] = field(unit=_FIELD_UNIT)
    """Numbers, each listed once."""


@dataclass(frozen=True)
class Choice(_Listed):
    """A list of texts, all of which are run."""

    values: NonEmpty[str]
    """Texts, each listed once: kinds, controller labels, names of motions or motors, true or
    false."""


Random = Uniform | LogUniform | Normal
AnyDistribution = Annotated[Random | Grid | List | Choice, ByTag()]


def _width_problems(low: float, high: float) -> Problems:
    if not low < high:
        yield "", f"low {low:g}, high {high:g}, expected low < high"


def text_problems(field: str, text: Value) -> Problems:
    """Yield a problem of a text that cannot be used in file names, tables and pages."""
    if isinstance(text, str) and (not text.isprintable() or text != text.strip()):
        yield field, f"{text!r}, expected printable characters without a space at either end"
