"""The results of a study as tables of text, and as figures."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from sdt_drake.analysis.plots import save
from sdt_drake.studies import plots
from sdt_drake.studies.quantities import quantity_of
from sdt_drake.studies.summary import (
    PERCENTS,
    count_statuses,
    percentiles,
    sensitivity,
    usable,
    varied,
    worst_runs,
)
from sdt_drake.studies.table import StudyTable, levels_of

COST, ERROR = "peak_torque_share", "max_abs_speed_error"
"""Of the Pareto front."""

_HEADLINES = (
    "max_abs_speed_error", "max_abs_position_error", "peak_torque_share", "winding_temperature",
    "felt_share",
)  # fmt: skip

_MOST_LEVELS = 8  # of a text input whose levels are told apart: as many as there are colours


class TextTable(NamedTuple):
    """Cells as texts; the first of each row names it."""

    title: str
    header: list[str]
    rows: list[list[str]]


def summary_tables(table: StudyTable, by: str | None = None) -> list[TextTable]:
    """What `sdt-drake study show` prints: statuses, percentiles, worst runs, and what matters.

    Args:
        table: of the study.
        by: text input whose levels are told apart; see `grouping` for a choice.

    Raises:
        InputError: for an unknown input, or one of numbers.
    """
    families = headlines(table)
    return [
        status_table(table),
        *(percentile_table(table, [family], by) for family in families),
        *(worst_table(table, family, by) for family in families),
        *sensitivity_tables(table, families, by),
    ]


def grouping(table: StudyTable) -> str | None:
    """The text input whose levels are best told apart: the controller, or the first of few levels.

    None if there is no such input.
    """
    names = [
        name for name in table.text_inputs if 1 < len(levels_of(table.inputs[name])) <= _MOST_LEVELS
    ]
    return min(names, key=lambda name: not name.startswith("controller"), default=None)


def families_there(table: StudyTable) -> list[str]:
    """The families of outcomes that some run has."""
    return [family for family in table.families if usable(table, family).any()]


def headlines(table: StudyTable) -> list[str]:
    """Of these the ones to look at first."""
    there = families_there(table)
    return [family for family in _HEADLINES if family in there] or there[: len(_HEADLINES)]


# --- tables ----------------------------------------------------------------------------------


def status_table(table: StudyTable) -> TextTable:
    """How many runs ended in which way; below each, the most frequent reasons."""
    rows = []
    for status, runs, reasons in count_statuses(table):
        rows.append([status, str(runs), f"{100 * runs / len(table):.1f}", "", ""])
        rows += [["", str(n), "", str(row), text] for text, n, row in reasons]
    return TextTable("Runs by status", ["status", "runs", "%", "first row", "reason"], rows)


def percentile_table(table: StudyTable, names: Sequence[str], by: str | None = None) -> TextTable:
    """Percentiles of outcomes: a row for each, and for each level of `by`.

    Args:
        table: of the study.
        names: of outcomes of one family, or of the family for the worst joint of it.
        by: text input.

    Raises:
        InputError: for an unknown outcome or input.
    """
    quantity = quantity_of(names[0])
    rows = []
    for level, part in table.split(by).items():
        for name in names:
            place = f", {table.place(name)}" if table.place(name) else ""
            values = quantity.factor * percentiles(part, name)
            rows.append([level + place, *map(number, values)])
    header = [by or "", *(f"{percent} %" for percent in PERCENTS[:-1]), "largest"]
    return TextTable(f"Percentiles: {quantity.label}", header, rows)


def worst_table(
    table: StudyTable, outcome: str, by: str | None = None, count: int = 3
) -> TextTable:
    """The worst runs of an outcome, for each level of `by`: row, value, joint, inputs.

    Args:
        table: of the study.
        outcome: its name, or that of a family: of each run's worst joint.
        by: text input.
        count: of the runs for each level.

    Raises:
        InputError: for an unknown outcome or input, or a count that is no whole number >= 1.
    """
    quantity, has_joints = quantity_of(outcome), bool(table.joints(outcome))
    inputs = sorted(varied(table), key=lambda name: name != by)
    rows = []
    for part in table.split(by).values():
        runs = worst_runs(part, outcome, count)
        columns = [runs.row, runs.worst_joint(outcome)] if has_joints else [runs.row]
        columns.append([number(quantity.factor * value) for value in runs.outcome(outcome)])
        columns += [map(_cell, runs.inputs[name].tolist()) for name in inputs]
        rows += [list(map(str, cells)) for cells in zip(*columns, strict=True)]
    header = ["row", *(["joint"] if has_joints else []), quantity.unit or "value", *inputs]
    return TextTable(f"Worst runs: {quantity.title}", header, rows)


def sensitivity_tables(
    table: StudyTable, names: Sequence[str], by: str | None = None
) -> list[TextTable]:
    """Share of the variance that each input explains alone [%]; a table for each level of `by`.

    Args:
        table: of the study.
        names: of outcomes, a column each; a family for the worst joint of it.
        by: text input.

    Raises:
        InputError: for an unknown outcome or input.
    """
    tables = []
    for level, part in table.split(by).items():
        columns = [sensitivity(part, name) for name in names]
        whole = {
            key: _sum(shares.get(key) for shares in columns) for shares in columns for key in shares
        }
        rows = [
            [key, *(_percent(shares.get(key, np.nan)) for shares in columns)]
            for key in sorted(whole, key=lambda key: -np.nan_to_num(whole[key]))
        ]
        if rows:
            rows.append(["sum", *(_percent(_sum(shares.values())) for shares in columns)])
            header = ["input", *(_column(table, name, names) for name in names)]
            title = "Variance explained by each input alone [%]"
            tables.append(TextTable(f"{title}, {level}", header, rows))
    return tables


def _sum(shares: Iterable[float | None]) -> float:
    """As the table shows them: what is below 0 is chance; NaN if there are none."""
    known = [max(share, 0) for share in shares if share is not None and np.isfinite(share)]
    return sum(known) if known else np.nan


def _column(table: StudyTable, name: str, names: Sequence[str]) -> str:
    """What tells the outcome from the others: its title, or its joint if all have one title."""
    titles = {quantity_of(other).title for other in names}
    return quantity_of(name).title if len(titles) == len(names) else table.place(name)


def _percent(share: float) -> str:
    return "–" if np.isnan(share) else f"{100 * max(share, 0):.1f}"


def number(value: float) -> str:
    """With four digits; a dash for none."""
    return "–" if np.isnan(value) else f"{value:.4g}"


def _cell(value: float | str) -> str:
    return number(value) if isinstance(value, int | float) else str(value)


# --- figures ---------------------------------------------------------------------------------


def figures(table: StudyTable, by: str | None = None) -> Iterator[tuple[str, Figure]]:
    """Name and figure, one after the other; only those that there is something to draw for.

    Args:
        table: of the study.
        by: text input whose levels are told apart.

    Raises:
        InputError: for an unknown input, or one of numbers.
    """
    names, count = headlines(table), int(table.ok.sum())
    moved = [family for family in names if plots.influential(table, [family], by)]
    if names:
        title = f"{table.name}: {count} runs, and what share of them stays below"
        yield "distributions", plots.distributions(title, table, names, by)
    if moved:
        family = ERROR if ERROR in moved else moved[0]
        title = f"{table.name}: what moves the {quantity_of(family).title}"
        yield "tornado", plots.tornado_figure(title, table, family, by)
        title = f"{table.name}: outcomes over the inputs that explain most"
        outcomes = list(dict.fromkeys([*names, *families_there(table)]))[: plots.MOST_PANELS]
        inputs = plots.influential(table, names, by)
        yield "scatter", plots.scatter_matrix(title, table, inputs, outcomes, by)
    if {COST, ERROR} <= set(table.families) and usable(table, COST, ERROR).any():
        title = f"{table.name}: {quantity_of(ERROR).title} over {quantity_of(COST).title}"
        yield "pareto", plots.pareto_figure(title, table, COST, ERROR, by)


def write_figures(table: StudyTable, folder: Path, by: str | None = None) -> dict[str, Path]:
    """Write each figure of `figures` as .svg and .png; the .svg by name.

    Args:
        table, by: as in `figures`.
        folder: of the study; made if it is not there.

    Raises:
        InputError: as `figures`, and if a file cannot be written.
    """
    written = {}
    for name, figure in figures(table, by):
        save(figure, folder / f"{name}.png")
        written[name] = save(figure, folder / f"{name}.svg")
    return written
