"""What thousands of runs say together: counts, percentiles, worst runs, and what matters.

Everything takes a StudyTable; for each controller on its own, take its `groups` first. In a
study with paired draws (the same variants for each controller) the results of the parts can then
be compared line by line.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sdt_drake.io.arrays import Array
from sdt_drake.studies.table import ANSWERS, STATUSES, StudyTable, is_text, levels_of

PERCENTS = (5, 25, 50, 75, 95, 99, 100)
"""Of the percentiles; the last is the largest."""

_MOST_BINS = 50
_FEWEST_RUNS = 10
_FIFTH = 0.2
_BLOCKS = 20  # of the jackknife


# --- counts ----------------------------------------------------------------------------------


class Reason(NamedTuple):
    """Why some runs are not ok.

    Attributes:
        text: their reason; where they differ in numbers only, with an ellipsis for each number.
        runs: how many.
        row: number of the first of them.
    """

    text: str
    runs: int
    row: int


class StatusCount(NamedTuple):
    """Runs of one status.

    Attributes:
        status: one of STATUSES.
        runs: how many.
        reasons: the most frequent ones first.
    """

    status: str
    runs: int
    reasons: list[Reason]


def count_statuses(table: StudyTable, most_reasons: int = 3) -> list[StatusCount]:
    """How many runs ended in which way, and why; statuses that no run has are left out."""
    parts = {status: table.select(table.status == status) for status in STATUSES}
    return [
        StatusCount(status, len(part), _reasons(part)[:most_reasons])
        for status, part in parts.items()
        if len(part)
    ]


def failures(table: StudyTable) -> str:
    """How many runs say nothing, and why, in a line; "" if all are done, and ok or infeasible."""
    texts = []
    if table.missing:
        texts.append(f"{table.missing} of {len(table) + table.missing} runs are not done yet")
    for status, runs, reasons in count_statuses(table, most_reasons=1):
        if status not in ANSWERS:
            why = f": {reasons[0].text} (row {reasons[0].row})" if reasons else ""
            texts.append(f"{runs} of {len(table)} runs {status.replace('_', ' ')}{why}")
    return "; ".join(texts)


# Not the joint's: what happens to joint 1 and to joint 2 are two things.
_NUMBER = re.compile(r"(?<!joint )(?<![\w.])([-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?)(?!\w)")


def _reasons(table: StudyTable) -> list[Reason]:
    """Of the runs of a table, the most frequent first; different numbers make no other reason."""
    alike: dict[tuple[str, ...], list[int]] = {}
    pieces = [_NUMBER.split(str(text)) for text in table.reason]  # words, number, words, ...
    for i, words in enumerate(pieces):
        alike.setdefault(tuple(words[::2]), []).append(i)
    reasons = [
        Reason(_common([pieces[i] for i in runs]), len(runs), int(table.row[runs[0]]))
        for words, runs in alike.items()
        if any(words)
    ]
    return sorted(reasons, key=lambda reason: -reason.runs)


def _common(texts: Sequence[Sequence[str]]) -> str:
    """One text for several that are as long: what differs is an ellipsis."""
    return "".join(same[0] if len(set(same)) == 1 else "…" for same in zip(*texts, strict=True))


# --- distributions ---------------------------------------------------------------------------


def percentiles(
    table: StudyTable, outcome: str, percents: Sequence[float] | Array = PERCENTS
) -> Array:
    """Percentiles of an outcome over the runs that are ok and have it, in its unit.

    Each is the least value of a run that so many of the runs do not exceed, however few they are:
    between runs nothing is known, and of ten runs 95 % are below none but the largest.

    Args:
        table: of the study, or a part of it.
        outcome: its name, or that of a family: of each run's worst joint.
        percents: between 0 and 100, shape (K,).

    Returns:
        Shape (K,); NaN without such runs.
    """
    values = values_of(table, outcome)
    if not len(values):
        return np.full(np.shape(percents), np.nan)
    return np.percentile(values, percents, method="inverted_cdf")


def usable(table: StudyTable, *outcomes: str) -> NDArray[np.bool_]:
    """Which runs are ok and have a number for all of these outcomes, shape (N,)."""
    return np.all([table.ok, *(np.isfinite(table.outcome(name)) for name in outcomes)], axis=0)


def values_of(table: StudyTable, outcome: str) -> Array:
    """An outcome of the runs that are ok and have it, in the unit of the table."""
    return table.outcome(outcome)[usable(table, outcome)]


def worst_runs(table: StudyTable, outcome: str, count: int = 5) -> StudyTable:
    """The runs with the largest values of an outcome, the worst first.

    Args:
        table, outcome: as in `percentiles`.
        count: of the runs; fewer if there are not as many.
    """
    runs = table.select(usable(table, outcome))
    # Stable: of equal runs the one that comes first.
    return runs.select(np.argsort(-runs.outcome(outcome), kind="stable")[:count])


# --- what matters ----------------------------------------------------------------------------


def varied(table: StudyTable) -> list[str]:
    """Names of the inputs that differ between the runs."""
    return [name for name, values in table.inputs.items() if _differ(values)]


def _differ(values: NDArray[Any]) -> bool:
    if is_text(values):
        return len(levels_of(values)) > 1
    finite = values[np.isfinite(values)]
    return len(finite) > 0 and np.ptp(finite) > 0


class Share(NamedTuple):
    """A share of variance [-], and its standard error; NaN where nothing can be said."""

    value: float
    error: float


def sensitivity(table: StudyTable, outcome: str) -> dict[str, Share]:
    """How much of the variance of an outcome each input explains alone, the most first.

    See `explained_share`; inputs that do not differ are left out. One that differs alone explains
    all: runs have no chance in them but that of their inputs. What is missing from a sum of 1 comes
    of inputs acting together, and of bins that are too wide.

    Args:
        table, outcome: as in `percentiles`.
    """
    runs = table.select(usable(table, outcome))
    y = runs.outcome(outcome)
    shares = {name: explained_share(runs.inputs[name], y, runs.draw) for name in varied(runs)}
    if len(shares) == 1 and _varies(y):
        return dict.fromkeys(shares, Share(1.0, 0.0))
    return dict(sorted(shares.items(), key=lambda item: -np.nan_to_num(item[1].value, nan=-np.inf)))


def explained_share(x: NDArray[Any], y: Array, draw: NDArray[np.int64] | None = None) -> Share:
    """First-order sensitivity index: Var(E(y | x)) / Var(y), as the correlation ratio.

    The runs are put into groups of equal x: by level for texts and for numbers of few values, in
    about sqrt(N) bins of equal count for others. The groups' means differ by chance alone, too;
    this is taken off (epsilon squared: Kelley, PNAS 21, 1935, p. 554), so that an input without
    influence gives 0 on average, and may give a little less:

        (SS_between - (groups - 1) MS_within) / SS_total

    Runs of one draw, each with other levels of the other inputs, are one sample of an input that is
    drawn, not several: MS_within is that of the means of the draws. With runs instead, each draw
    would make its own values of all inputs look as if they mattered. Where nothing is drawn and
    every level of x is there equally often, as in a full grid, nothing differs by chance: then
    nothing is taken off, and there is no error.

    Its standard error is that of the jackknife, with twenty blocks of draws left out in turn
    (Miller, Biometrika 61, 1974, p. 1).

    Args:
        x: the input, numbers or texts, shape (N,); runs without a finite number are left out.
        y: the outcome, finite, shape (N,).
        draw: number of the draw of each run, shape (N,); of an x that differs within draws, and by
            default, each run is one.

    Returns:
        At most 1; NaN where y does not vary, or each draw has its own group; but for a full grid,
        for fewer than 10 draws.
    """
    if is_text(x):
        x = x.astype(str)
    else:
        finite = np.isfinite(x)
        x, y, draw = x[finite], y[finite], None if draw is None else draw[finite]
    _, first, own = np.unique(np.arange(len(y)) if draw is None else draw, True, True)
    if np.any(x != x[first][own]):
        _, group, runs = np.unique(x, False, True, True)
        if len(first) == 1 and 1 < runs.min() == runs.max() and _varies(y):
            return Share(float(np.var(np.bincount(group, y) / runs) / np.var(y)), 0.0)
        first = own = np.arange(len(y))
    group, count = _groups(x[first])
    if len(first) < _FEWEST_RUNS or count == len(first) or not _varies(y):
        return Share(np.nan, np.nan)
    # Sums of each group, a row, over all draws but those of a block, a column; but none at first.
    block = 1 + np.random.default_rng(0).permutation(len(first)) % _BLOCKS
    y, size = y - y.mean(), (count, 1 + _BLOCKS)
    runs, sums, squares = (np.bincount(own, of) for of in (y**0, y, y**2))
    cell = np.ravel_multi_index((group, block), size)
    parts = [
        np.bincount(cell, of, math.prod(size)).reshape(size)
        for of in (runs**0, runs, sums, squares, sums**2 / runs)
    ]
    whole, *others = _ratio(*(part.sum(axis=1, keepdims=True) - part for part in parts)).tolist()
    return Share(whole, math.sqrt((_BLOCKS - 1) * np.var(others)))


def _ratio(draws: Array, runs: Array, sums: Array, squares: Array, of_means: Array) -> Array:
    """Epsilon squared, of each column of numbers of draws and of runs, sums and sums of squares of
    runs, and those with the mean of its draw for each run, of the groups."""
    n, groups = draws.sum(axis=0), (draws > 0).sum(axis=0)
    means = np.divide(sums, runs, out=np.zeros_like(sums), where=runs > 0)
    of_groups, of_all = (sums * means).sum(axis=0), sums.sum(axis=0) ** 2 / runs.sum(axis=0)
    within, total = of_means.sum(axis=0) - of_groups, squares.sum(axis=0) - of_all
    with np.errstate(divide="ignore", invalid="ignore"):
        return (of_groups - of_all - (groups - 1) * within / (n - groups)) / total


def _varies(y: Array) -> bool:
    """Rounding leaves something of the variance of equal numbers."""
    return len(y) > 0 and bool(np.var(y) > (1e-12 * np.abs(y).max()) ** 2)


def _groups(x: NDArray[Any]) -> tuple[NDArray[np.int64], int]:
    """Number of the group of each run, shape (N,), and how many groups there are."""
    levels, group = np.unique(x, return_inverse=True)
    bins = min(_MOST_BINS, round(np.sqrt(len(x))))
    if not is_text(x) and len(levels) > bins:
        edges = np.quantile(x, np.linspace(0, 1, bins + 1)[1:-1])
        # Equal numbers are in the same bin; some bins then stay empty.
        levels, group = np.unique(np.searchsorted(edges, x, side="right"), return_inverse=True)
    return group, len(levels)


@dataclass(frozen=True)
class TornadoSwing:
    """How far one input moves the mean of an outcome.

    Attributes:
        name: of the input.
        low, high: the mean where the input is in its lowest and in its highest fifth; for texts
            the lowest and the highest mean of a level, in the unit of the outcome.
        low_level, high_level: these levels; "" for numbers.
    """

    name: str
    low: float
    high: float
    low_level: str = ""
    high_level: str = ""

    @property
    def width(self) -> float:
        """How far apart the two means are."""
        return abs(self.high - self.low)


def tornado(table: StudyTable, outcome: str) -> list[TornadoSwing]:
    """How far each input moves the mean of an outcome, the farthest first.

    Args:
        table, outcome: as in `percentiles`.
    """
    runs = table.select(usable(table, outcome))
    y = runs.outcome(outcome)
    swings = [_swing(name, runs.inputs[name], y) for name in varied(runs)]
    return sorted(swings, key=lambda swing: -swing.width)


def _swing(name: str, x: NDArray[Any], y: Array) -> TornadoSwing:
    if is_text(x):
        texts = x.astype(str)
        means = {level: float(y[texts == level].mean()) for level in levels_of(x)}
        low, high = min(means, key=means.__getitem__), max(means, key=means.__getitem__)
        return TornadoSwing(name, means[low], means[high], low, high)
    low, high = np.nanquantile(x, [_FIFTH, 1 - _FIFTH])
    return TornadoSwing(name, float(y[x <= low].mean()), float(y[x >= high].mean()))
