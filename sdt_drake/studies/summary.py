"""Statistics over the runs of a study: counts, percentiles, worst runs, sensitivities.

All functions accept a whole StudyTable or one of its `groups`, such as the runs of one controller.
Each draw is run with every controller, so results of these groups can be compared in pairs.
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
"""Percentages of the percentiles in tables; 100 is the largest value."""

_MAX_BINS = 50
_MIN_DRAWS = 10  # minimum number of draws for a sensitivity
_TAIL = 0.2  # share of the lowest and of the highest inputs in a tornado
_BLOCKS = 20  # number of blocks in the jackknife


# --- counts ----------------------------------------------------------------------------------


class Reason(NamedTuple):
    """A reason for which runs are not ok."""

    text: str
    """Text of the reason, with an ellipsis for each number that differs between the runs."""
    runs: int
    """Number of runs."""
    row: int
    """Number of the first of these rows."""


class StatusCount(NamedTuple):
    """The runs of one status."""

    status: str
    """One of STATUSES."""
    runs: int
    """Number of runs."""
    reasons: list[Reason]
    """Reasons of the status, the most frequent first."""


def count_statuses(table: StudyTable, most_reasons: int = 3) -> list[StatusCount]:
    """Count the runs and the reasons of each status; statuses without runs are left out."""
    parts = {status: table.select(table.status == status) for status in STATUSES}
    return [
        StatusCount(status, len(part), _reasons(part)[:most_reasons])
        for status, part in parts.items()
        if len(part)
    ]


def failures(table: StudyTable) -> str:
    """Return one line on the runs without a result and the cause; "" if there are none."""
    texts = []
    if table.missing:
        texts.append(f"{table.missing} of {len(table) + table.missing} runs are not finished")
    for status, runs, reasons in count_statuses(table, most_reasons=1):
        if status not in ANSWERS:
            why = f": {reasons[0].text} (row {reasons[0].row})" if reasons else ""
            texts.append(f"{runs} of {len(table)} runs {status.replace('_', ' ')}{why}")
    return "; ".join(texts)


# Numbers of joints are not matched: the same event at joint 1 and at joint 2 is two reasons.
_NUMBER = re.compile(r"(?<!joint )(?<![\w.])([-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?)(?!\w)")


def _reasons(table: StudyTable) -> list[Reason]:
    """Return the reasons of the runs, most frequent first. Numbers in them may differ."""
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
    """Merge texts of equal length into one, with an ellipsis for each part that differs."""
    return "".join(same[0] if len(set(same)) == 1 else "…" for same in zip(*texts, strict=True))


# --- distributions ---------------------------------------------------------------------------


def percentiles(
    table: StudyTable, outcome: str, percents: Sequence[float] | Array = PERCENTS
) -> Array:
    """Return percentiles of an outcome over the runs that are ok and have it, in its unit.

    A percentile is the smallest value of a run that this share of the runs does not exceed. It is
    not interpolated between runs: of ten runs, the 95th percentile is the largest value.

    Args:
        table: the study, or a group of its runs.
        outcome: name of an outcome, or of a family for the worst joint of each run.
        percents: between 0 and 100, shape (K,).

    Returns:
        Percentiles, shape (K,); NaN if no run has the outcome.
    """
    values = values_of(table, outcome)
    if not len(values):
        return np.full(np.shape(percents), np.nan)
    return np.percentile(values, percents, method="inverted_cdf")


def usable(table: StudyTable, *outcomes: str) -> NDArray[np.bool_]:
    """Return the mask of runs that are ok and have a number for all outcomes, shape (N,)."""
    return np.all([table.ok, *(np.isfinite(table.outcome(name)) for name in outcomes)], axis=0)


def values_of(table: StudyTable, outcome: str) -> Array:
    """Return an outcome of the runs that are ok and have it, in its unit."""
    return table.outcome(outcome)[usable(table, outcome)]


def worst_runs(table: StudyTable, outcome: str, count: int = 5) -> StudyTable:
    """Return the `count` runs with the largest values of an outcome, the worst first.

    Equal runs stay in their order. Arguments are those of `percentiles`.
    """
    runs = table.select(usable(table, outcome))
    return runs.select(np.argsort(-runs.outcome(outcome), kind="stable")[:count])


# --- sensitivities ---------------------------------------------------------------------------


def varied(table: StudyTable) -> list[str]:
    """Return the names of the inputs that differ between runs."""
    return [name for name, values in table.inputs.items() if _differ(values)]


def _differ(values: NDArray[Any]) -> bool:
    if is_text(values):
        return len(levels_of(values)) > 1
    finite = values[np.isfinite(values)]
    return len(finite) > 0 and np.ptp(finite) > 0


class Share(NamedTuple):
    """A share of variance with its standard error; NaN if it cannot be estimated."""

    value: float
    """Share of variance [-], at most 1."""
    error: float
    """Standard error [-]."""


def sensitivity(table: StudyTable, outcome: str) -> dict[str, Share]:
    """Return the share of an outcome's variance that each input explains alone, largest first.

    See `explained_share`. Constant inputs are left out. A single varied input explains everything,
    since runs are deterministic. The difference between the sum and 1 comes from interactions of
    inputs and from the width of bins. Arguments are those of `percentiles`.
    """
    runs = table.select(usable(table, outcome))
    y = runs.outcome(outcome)
    shares = {name: explained_share(runs.inputs[name], y, runs.draw) for name in varied(runs)}
    if len(shares) == 1 and _varies(y):
        return dict.fromkeys(shares, Share(1.0, 0.0))
    return dict(sorted(shares.items(), key=lambda item: -np.nan_to_num(item[1].value, nan=-np.inf)))


def explained_share(x: NDArray[Any], y: Array, draw: NDArray[np.int64] | None = None) -> Share:
    """Return the first-order sensitivity index Var(E(y | x)) / Var(y), as the correlation ratio.

    Runs are grouped by x: by level for texts and for numbers with few values, otherwise in about
    sqrt(N) bins of equal count. Group means also differ by chance. That part is subtracted
    (epsilon squared: Kelley, PNAS 21, 1935, p. 554), so that an input without influence gives 0 on
    average; a single estimate may be slightly negative:

        (SS_between - (groups - 1) MS_within) / SS_total

    Several runs of one draw, with other levels of the other inputs, are one sample of a drawn
    input. So MS_within is computed from the means of the draws. A full grid, without draws and with
    every level of x equally often, has no chance: nothing is subtracted, and the error is 0.

    The standard error comes from a jackknife over twenty blocks of draws (Miller, Biometrika 61,
    1974, p. 1).

    Args:
        x: the input, numbers or texts, shape (N,); runs with NaN or infinity are left out.
        y: the outcome, finite, shape (N,).
        draw: number of the draw of each run, shape (N,). By default, and if x differs within a
            draw, every run is a draw of its own.

    Returns:
        The share; NaN if y is constant, every draw has its own group, or there are fewer than 10
        draws (except in a full grid).

    >>> explained_share(np.array([0, 0, 1, 1]), np.array([0.0, 2.0, 6.0, 8.0]), np.zeros(4, int))
    Share(value=0.9, error=0.0)
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
    if len(first) < _MIN_DRAWS or count == len(first) or not _varies(y):
        return Share(np.nan, np.nan)
    # Sums by group (row) and block of draws (column); column 0, for all draws, has no block.
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
    """Return epsilon squared of each column, from sums over the runs of each group (row).

    Args:
        draws: number of draws.
        runs: number of runs.
        sums: sum of y.
        squares: sum of y².
        of_means: sum of squares with the mean of its draw in place of each y.
    """
    n, groups = draws.sum(axis=0), (draws > 0).sum(axis=0)
    means = np.divide(sums, runs, out=np.zeros_like(sums), where=runs > 0)
    of_groups, of_all = (sums * means).sum(axis=0), sums.sum(axis=0) ** 2 / runs.sum(axis=0)
    within, total = of_means.sum(axis=0) - of_groups, squares.sum(axis=0) - of_all
    with np.errstate(divide="ignore", invalid="ignore"):
        return (of_groups - of_all - (groups - 1) * within / (n - groups)) / total


def _varies(y: Array) -> bool:
    """Return whether y varies by more than round-off."""
    return len(y) > 0 and bool(np.var(y) > (1e-12 * np.abs(y).max()) ** 2)


def _groups(x: NDArray[Any]) -> tuple[NDArray[np.int64], int]:
    """Return the number of each run's group, shape (N,), and the number of groups."""
    levels, group = np.unique(x, return_inverse=True)
    bins = min(_MAX_BINS, round(np.sqrt(len(x))))
    if not is_text(x) and len(levels) > bins:
        edges = np.quantile(x, np.linspace(0, 1, bins + 1)[1:-1])
        # Equal numbers get into the same bin, so that some bins may be empty.
        levels, group = np.unique(np.searchsorted(edges, x, side="right"), return_inverse=True)
    return group, len(levels)


@dataclass(frozen=True)
class TornadoSwing:
    """The change of an outcome's mean over the range of one input."""

    name: str
    """Name of the input."""
    low: float
    """Mean in the lowest fifth of a numeric input, or the lowest mean of a level of texts."""
    high: float
    """Mean in the highest fifth of a numeric input, or the highest mean of a level of texts."""
    low_level: str = ""
    """Level with the lowest mean; "" for numbers."""
    high_level: str = ""
    """Level with the highest mean; "" for numbers."""

    @property
    def width(self) -> float:
        """Distance between the two means, in the unit of the outcome."""
        return abs(self.high - self.low)


def tornado(table: StudyTable, outcome: str) -> list[TornadoSwing]:
    """Return the swing of each input, the widest first. Arguments are those of `percentiles`."""
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
    low, high = np.nanquantile(x, [_TAIL, 1 - _TAIL])
    return TornadoSwing(name, float(y[x <= low].mean()), float(y[x >= high].mean()))
