"""Distributions of what varies in a study.

Random ones have `quantile`, which takes shares in (0, 1) to values; the others have `levels`, which
are all run, each with the same draws of the random ones, and `size`, how many they are: a study
that is too large is refused before they are made.
"""

# Real annotations, for the check of the fields (sdt_drake.io.fields): they may not be postponed.
import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Optional

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.fields import Problems, setting
from sdt_drake.studies.fields import Value

MOST_RUNS = 10_000_000
_ITS_OWN = "of the field"  # a unit


@dataclass(slots=True)
class Uniform:
    """Evenly between low and high.

    Attributes:
        low: the least value.
        high: the largest value.
    """

    low: float = setting(unit=_ITS_OWN)
    high: float = setting(unit=_ITS_OWN)

    def problems(self) -> Problems:
        yield from _width_problems(self.low, self.high)

    def quantile(self, share: Array) -> Array:
        from scipy import stats

        return stats.uniform(self.low, self.high - self.low).ppf(share)


@dataclass(slots=True)
class LogUniform:
    """Evenly in the logarithm, between low and high.

    Attributes:
        low: the least value.
        high: the largest value.
    """

    low: float = setting(above=0, unit=_ITS_OWN)
    high: float = setting(above=0, unit=_ITS_OWN)

    def problems(self) -> Problems:
        yield from _width_problems(self.low, self.high)

    def quantile(self, share: Array) -> Array:
        from scipy import stats

        return stats.loguniform(self.low, self.high).ppf(share)


@dataclass(slots=True)
class Normal:
    """Gaussian; with low or high, what is beyond is cut off and the rest scaled up.

    Attributes:
        mean: before anything is cut off.
        std: standard deviation, before anything is cut off.
        low: the least value; none by default.
        high: the largest value; none by default.
    """

    mean: float = setting(unit=_ITS_OWN)
    std: float = setting(above=0, unit=_ITS_OWN)
    low: Optional[float] = setting(None, unit=_ITS_OWN)
    high: Optional[float] = setting(None, unit=_ITS_OWN)

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


@dataclass(slots=True)
class Grid:
    """Values that are equal steps apart, all of which are run.

    Attributes:
        start: the first.
        stop: the last, which is one of them.
        count: how many.
    """

    start: float = setting(unit=_ITS_OWN)
    stop: float = setting(unit=_ITS_OWN)
    count: int = setting(2, minimum=2, maximum=MOST_RUNS, unit="-")

    def problems(self) -> Problems:
        if self.start == self.stop:
            yield "", f"start and stop are both {self.start:g}"

    @property
    def size(self) -> int:
        return self.count

    def levels(self) -> list[Value]:
        return np.linspace(self.start, self.stop, self.count).tolist()


class _Listed:
    __slots__ = ()
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


@dataclass(slots=True)
class List(_Listed):
    """These numbers, all of which are run.

    Attributes:
        values: each once.
    """

    values: list[float] = setting(unit=_ITS_OWN)


@dataclass(slots=True)
class Choice(_Listed):
    """These texts, all of which are run.

    Attributes:
        values: kinds, labels of controllers, names of motions or motors, true or false; each once.
    """

    values: list[str] = setting()


Random = Uniform | LogUniform | Normal


def _width_problems(low: float, high: float) -> Problems:
    if not low < high:
        yield "", f"low {low:g}, high {high:g}, expected low < high"


def text_problems(field: str, text: Value) -> Problems:
    """Names and levels go into file names, tables and pages."""
    if isinstance(text, str) and (not text.isprintable() or text != text.strip()):
        yield field, f"{text!r}, expected characters that are seen, no space at an end"
