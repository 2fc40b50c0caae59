"""Statistics over the runs of a study: counts, percentiles, worst runs, sensitivities.

All functions accept a whole StudyTable or one of its `groups`, such as the runs of one controller.
Each draw is run with every controller, so results of these groups can be compared in pairs.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sdt_drake.io.arrays import Array, Mask
from sdt_drake.studies.table import ANSWERS, STATUSES, StudyTable, is_text, pandas

if TYPE_CHECKING:
    import pandas as pd

PERCENTS = (5, 25, 50, 75, 95, 99, 100)
"""Percentages of the percentiles in tables; 100 is the largest value."""

_MAX_BINS = 50
_MIN_DRAWS = 10  # minimum number of draws for a sensitivity
_TAIL = 0.2  # share of the lowest and of the highest inputs in a tornado
_BLOCKS = 20  # number of blocks in the jackknife


# --- counts ----------------------------------------------------------------------------------


def count_statuses(table: StudyTable) -> pd.Series:
    """Return the number of runs by status, in the order of STATUSES; none without runs."""
    counts = table.status.value_counts()
    return counts.reindex([status for status in STATUSES if status in counts])


# Numbers of joints are not matched: the same event at joint 1 and at joint 2 is two reasons.
_NUMBER = re.compile(r"(?<!joint )(?<![\w.])([-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?)(?!\w)")


def reasons(table: StudyTable, status: str) -> pd.DataFrame:
    """Return the reasons of a status, the most frequent first.

    Returns:
        A reason in each row. Columns: `reason`, the text with an ellipsis for each number that
        differs between its runs; `runs`, their number; `row`, the number of the first.
    """
    texts = table.runs["reason"][table.status == status].rename("reason")
    alike = texts[texts != ""].groupby(texts.str.replace(_NUMBER, "…", regex=True), sort=False)
    found = alike.agg([("reason", _common), ("runs", "size"), ("row", lambda own: own.index[0])])
    return found.sort_values("runs", ascending=False, kind="stable", ignore_index=True)


def _common(texts: Iterable[str]) -> str:
    """Merge texts that differ in numbers into one, with an ellipsis for each such number."""
    pieces = zip(*map(_NUMBER.split, texts), strict=True)  # words, number, words, ...
    return "".join(same[0] if len(set(same)) == 1 else "…" for same in pieces)


def failures(table: StudyTable) -> str:
    """Return one line on the runs without a result and the cause; "" if there are none."""
    texts = []
    if table.missing:
        texts.append(f"{table.missing} of {len(table) + table.missing} runs are not finished")
    for status, runs in count_statuses(table).drop([*ANSWERS], errors="ignore").items():
        first = reasons(table, status).head(1).itertuples()
        why = "".join(f": {one.reason} (row {one.row})" for one in first)
        texts.append(f"{runs} of {len(table)} runs {status.replace('_', ' ')}{why}")
    return "; ".join(texts)


# --- distributions ---------------------------------------------------------------------------


def percentiles(
    table: StudyTable, outcome: str, percents: Sequence[float] | Array = PERCENTS
) -> pd.Series:
    """Return percentiles of an outcome over the runs that are ok and have it, in its unit.

    A percentile is the smallest value of a run that this share of the runs does not exceed. It is
    not interpolated between runs: of ten runs, the 95th percentile is the largest value.

    Args:
        table: the study, or a group of its runs.
        outcome: name of an outcome, or of a family for the worst joint of each run.
        percents: between 0 and 100, shape (K,).

    Returns:
        Percentiles by percentage; NaN if no run has the outcome.
    """
    values = values_of(table, outcome)
    found = np.percentile(values, percents, method="inverted_cdf") if len(values) else np.nan
    return pandas().Series(found, percents, dtype=float)


def usable(table: StudyTable, *outcomes: str) -> Mask:
    """Return the mask of runs that are ok and have a number for all outcomes, shape (N,)."""
    return np.logical_and.reduce([table.ok, *(table.outcome(name).notna() for name in outcomes)])


def values_of(table: StudyTable, outcome: str) -> pd.Series:
    """Return an outcome of the runs that are ok and have it, in its unit."""
    return table.outcome(outcome)[table.ok].dropna()


def worst_runs(table: StudyTable, outcome: str, count: int = 5) -> StudyTable:
    """Return the `count` runs with the largest values of an outcome, the worst first.

    Equal runs stay in their order. Arguments are those of `percentiles`.
    """
    return table.select(values_of(table, outcome).nlargest(count).index)


# --- sensitivities ---------------------------------------------------------------------------


def varied(table: StudyTable) -> list[str]:
    """Return the names of the inputs that differ between runs."""
    return [name for name, values in table.inputs.items() if values.nunique() > 1]


class Share(NamedTuple):
    """A share of variance with its standard error; NaN if it cannot be estimated."""

    value: float
    """Share of variance [-], at most 1."""
    error: float
    """Standard error [-]."""


def sensitivity(table: StudyTable, outcome: str) -> pd.DataFrame:
    """Return the share of an outcome's variance that each input explains alone, largest first.

    See `explained_share`. Constant inputs are left out. A single varied input explains everything,
    since runs are deterministic. The difference between the sum and 1 comes from interactions of
    inputs and from the width of bins. Arguments are those of `percentiles`.

    Returns:
        An input in each row, its name as index. Columns: `value` and `error`, those of `Share` [-].
    """
    runs = table.select(usable(table, outcome))
    y, draw = runs.outcome(outcome).to_numpy(), runs.runs.index.to_numpy() // runs.per_draw
    inputs = runs.inputs[varied(runs)]
    shares = {x: explained_share(values.to_numpy(), y, draw) for x, values in inputs.items()}
    if len(shares) == 1 and _varies(y):
        shares = dict.fromkeys(shares, Share(1.0, 0.0))
    found = pandas().DataFrame(shares.values(), shares, Share._fields, dtype=float)
    return found.sort_values("value", ascending=False, kind="stable")


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
    if x.dtype.kind in "iuf":
        finite = np.isfinite(x)
        x, y, draw = x[finite], y[finite], None if draw is None else draw[finite]
    else:
        x = x.astype(str)
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
    if x.dtype.kind in "iuf" and len(levels) > bins:
        edges = np.quantile(x, np.linspace(0, 1, bins + 1)[1:-1])
        # Equal numbers get into the same bin, so that some bins may be empty.
        levels, group = np.unique(np.searchsorted(edges, x, side="right"), return_inverse=True)
    return group, len(levels)


def tornado(table: StudyTable, outcome: str) -> pd.DataFrame:
    """Return how much each input changes the mean of an outcome, the widest change first.

    Arguments are those of `percentiles`.

    Returns:
        An input in each row, its name as index. Columns, in the unit of the outcome: `low` and
        `high`, the means in the lowest and the highest fifth of numbers, or the lowest and the
        highest mean of a level of texts; `width`, their distance. `low_level` and `high_level` are
        these levels, "" for numbers.
    """
    runs = table.select(usable(table, outcome))
    y = runs.outcome(outcome)
    swings = {name: _swing(runs.runs[name], y) for name in varied(runs)}
    columns = ["low", "high", "low_level", "high_level"]
    found = pandas().DataFrame(swings.values(), swings, columns)
    found["width"] = (found["high"] - found["low"]).abs()
    return found.sort_values("width", ascending=False, kind="stable")


def _swing(x: pd.Series, y: pd.Series) -> tuple[float, float, str, str]:
    if is_text(x):
        means = y.groupby(x.astype(str), sort=False).mean()
        return means.min(), means.max(), means.idxmin(), means.idxmax()
    low, high = x.quantile([_TAIL, 1 - _TAIL])
    return y[x <= low].mean(), y[x >= high].mean(), "", ""
