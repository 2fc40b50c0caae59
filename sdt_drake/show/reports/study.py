"""The results of a study: tables and figures, on one page and on the command line."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Collection, Iterable, Sequence
from functools import partial
from itertools import chain
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from sdt_drake.analysis.metrics import family_of, metric_of
from sdt_drake.io.files import write_text
from sdt_drake.io.shown import listed
from sdt_drake.show import documents as doc
from sdt_drake.show.figures import fronts as plots_front
from sdt_drake.show.figures import studies as plots
from sdt_drake.show.style import save_both
from sdt_drake.studies.results import read_study_table
from sdt_drake.studies.summary import (
    PERCENTS,
    Share,
    count_statuses,
    failures,
    percentiles,
    sensitivity,
    usable,
    varied,
    worst_runs,
)
from sdt_drake.studies.table import StudyTable

COST, ERROR = "peak_torque_share", "max_abs_speed_error"
"""Of the Pareto front."""

CAPTIONS = {
    "distributions": "Share of the runs that do not exceed a value; marked: half of them, 95 % and "
    "99 %.",
    "tornado": "Mean over the runs in which an input is in its lowest or in its highest fifth; of "
    "texts, the level with the lowest and the one with the highest mean.",
    "scatter": "A point for each run, at most 2000 of them.",
    "pareto": "Designs that can do all runs, by the worst of them; in grey: another beats it, with "
    "no more of either, and less of one.",
}
"""Of the figures."""

_HEADLINES = (
    "max_abs_speed_error", "max_abs_position_error", "peak_torque_share", "winding_temperature",
    "felt_share",
)  # fmt: skip
_LOOKS = {"ok": "good", "infeasible": "open"}  # of statuses; others are bad
_NOTHING = Share(np.nan, np.nan)
_NEAR_NOTHING = 0.05  # of the variance: not worth a sentence
_BRACKETS = "In brackets: share of the variance that the input explains alone, and standard error."


def write_study_report(folder: Path, out: Path | None = None) -> tuple[Path, doc.Document]:
    """Write the figures and report.html of a study; each file replaced whole.

    Args:
        folder: of the study.
        out: folder for the files; that of the study if None.

    Returns:
        The path of the page, and what it shows.

    Raises:
        InputError: if the folder holds no study with a run, or a file cannot be written.
    """
    document = make_study_report(read_study_table(folder), folder, out)
    return write_text((out or folder) / doc.REPORT, document.html()), document


def study_chapter(folder: Path) -> doc.Section:
    """What matters most of a study, for a larger report; its figures are written.

    Raises:
        InputError: as `write_study_report`.
    """
    table = read_study_table(folder)
    figures = _figures(table, folder, ("distributions", "tornado", "pareto"))
    blocks = [*_summary(table), status_table(table), *chain(*figures.values())]
    return doc.Section(f"Study {table.name}", blocks)


def make_study_report(table: StudyTable, folder: Path, out: Path | None = None) -> doc.Document:
    """The report on a study; its figures are written.

    Args:
        table: of the study.
        folder: it is in; named in the command that repeats a run.
        out: folder for the figures; that of the study if None.
    """
    figures = _figures(table, out or folder)
    sections = [
        doc.Section("Summary", _summary(table)),
        doc.Section("Status", [status_table(table)]),
    ]
    if headlines(table):
        sections += [
            doc.Section("Distributions", [*figures["distributions"], *_percentiles(table)]),
            doc.Section("Worst runs", _worst(table, folder)),
            doc.Section("What matters", _matters(table, figures.get("tornado", []))),
            doc.Section("All runs", figures.get("scatter", [])),
            doc.Section("Pareto front", figures.get("pareto", [])),
        ]
    return doc.Document(f"Study {table.name}", sections=sections)


def families_there(table: StudyTable) -> list[str]:
    """The families of outcomes that some run has."""
    return [family for family in table.families if usable(table, family).any()]


def headlines(table: StudyTable) -> list[str]:
    """The families of outcomes to look at first."""
    there = families_there(table)
    return [family for family in _HEADLINES if family in there] or there[: len(_HEADLINES)]


def _figures(
    table: StudyTable, folder: Path, wanted: Collection[str] = CAPTIONS
) -> dict[str, list[doc.Block]]:
    """Those wanted that there is something to draw for, by name, written into the folder."""
    names, count = headlines(table), int(table.ok.sum())
    moved = [family for family in names if plots.influential(table, [family])]
    drawn: dict[str, Callable[[], Figure]] = {}
    if names:
        title = f"{table.name}: {count} runs, and what share of them is at or below a value"
        drawn["distributions"] = partial(plots.distributions, title, table, names)
    if moved:
        family = ERROR if ERROR in moved else moved[0]
        title = f"{table.name}: what moves the {metric_of(family).title}"
        drawn["tornado"] = partial(plots.tornado_figure, title, table, family)
        title = f"{table.name}: outcomes over the inputs that explain most"
        outcomes = list(dict.fromkeys([*names, *families_there(table)]))[: plots.MOST_PANELS]
        inputs = plots.influential(table, names)
        drawn["scatter"] = partial(plots.scatter_matrix, title, table, inputs, outcomes)
    is_front = table.choices and not table.missing and {COST, ERROR} <= set(table.families)
    if is_front and len(table.designs(COST, ERROR)[0]):
        title = f"{table.name}: {metric_of(ERROR).title} over {metric_of(COST).title}"
        drawn["pareto"] = partial(plots_front.pareto_figure, title, table, COST, ERROR)
    files = {name: save_both(drawn[name](), folder / name) for name in drawn if name in wanted}
    looks = {"pareto": ""}  # it has one panel, the others have many
    return {
        name: [doc.Figure(CAPTIONS[name], file, folder, looks.get(name, "wide"))]
        for name, file in files.items()
    }


# --- tables ----------------------------------------------------------------------------------


def status_table(table: StudyTable) -> doc.Table:
    """How many runs ended in which way; below each, the most frequent reasons."""
    rows = []
    for status, runs, reasons in count_statuses(table):
        rows.append([status, str(runs), f"{100 * runs / len(table):.1f}", "", ""])
        rows += [["", str(n), "", str(row), text] for text, n, row in reasons]
    return doc.Table(["status", "runs", "%", "first row", "reason"], rows, "Runs by status")


def percentile_table(table: StudyTable, names: Sequence[str]) -> doc.Table:
    """Percentiles of outcomes: a row for each, and for each group.

    Args:
        table: of the study.
        names: of outcomes of one family, or of the family for the worst joint of it.
    """
    metric = metric_of(names[0])
    rows = []
    for level, part in table.groups.items():
        for name in names:
            place = ", ".join(filter(None, [level, table.place(name)]))
            rows.append([place, *map(cell, metric.factor * percentiles(part, name))])
    header = [table.by or "", *(f"{percent} %" for percent in PERCENTS[:-1]), "largest"]
    return doc.Table(header, rows, f"Percentiles: {metric.label}")


def outcome_tables(names: Sequence[str], outcomes: Sequence[float]) -> list[doc.Table]:
    """Make tables of a run's outcomes: those of joints, a row for each family, then the others.

    Args:
        names: as `outcomes.outcome_names` has them.
        outcomes: of the run, by these names.
    """
    rows: dict[bool, dict[str, list[str]]] = {True: {}, False: {}}
    for name, value in zip(names, outcomes, strict=True):
        metric, joint = metric_of(name), family_of(name)[1]
        rows[joint is not None].setdefault(metric.label, [metric.label]).append(metric.text(value))
    by_joint, whole = (list(some.values()) for some in rows.values())
    n = max(map(len, by_joint), default=1) - 1
    tables = [
        doc.Table(["outcome", *(f"joint {k + 1}" for k in range(n))], by_joint),
        doc.Table(["outcome", "of the run"], whole),
    ]
    return [table for table in tables if table.rows]


def worst_table(table: StudyTable, outcome: str, count: int = 3) -> doc.Table:
    """The worst runs of an outcome, for each group: row, value, joint, inputs.

    Args:
        table: of the study.
        outcome: its name, or that of a family: of each run's worst joint.
        count: of the runs for each level.
    """
    metric, has_joints = metric_of(outcome), bool(table.joints(outcome))
    inputs = sorted(varied(table), key=lambda name: name != table.by)
    rows = []
    for part in table.groups.values():
        runs = worst_runs(part, outcome, count)
        columns: list[Iterable[object]] = [runs.row]
        if has_joints:
            columns.append(runs.worst_joint(outcome))
        columns.append([cell(metric.factor * value) for value in runs.outcome(outcome)])
        columns += [map(cell, runs.inputs[name].tolist()) for name in inputs]
        rows += [list(map(str, cells)) for cells in zip(*columns, strict=True)]
    header = ["row", *(["joint"] if has_joints else []), metric.unit or "value", *inputs]
    return doc.Table(header, rows, f"Worst runs: {metric.title}")


def sensitivity_tables(table: StudyTable, names: Sequence[str]) -> list[doc.Table]:
    """Share of the variance that each input explains alone [%], with its standard error; a table
    for each group in which more than one input varies.

    Args:
        table: of the study.
        names: of outcomes, a column each; a family for the worst joint of it.
    """
    tables = []
    for level, part in table.groups.items():
        columns = [sensitivity(part, name) for name in names]
        by_input = {
            key: [shares.get(key, _NOTHING) for shares in columns] for key in chain(*columns)
        }
        if len(by_input) > 1:
            ordered = sorted(by_input.items(), key=lambda item: -np.nan_to_num(_sum(item[1])))
            rows = [[key, *map(_percent, shares)] for key, shares in ordered]
            sums = (_sum(shares.values()) for shares in columns)
            rows.append(["sum", *("–" if np.isnan(x) else f"{100 * x:.0f}" for x in sums)])
            header = ["input", *(_column(table, name, names) for name in names)]
            title = f"Variance explained by each input alone [%], {level}"
            tables.append(doc.Table(header, rows, title))
    return tables


def _sum(shares: Iterable[Share]) -> float:
    """As the table shows them: what is below 0 is chance; NaN if there are none."""
    known = [max(share.value, 0) for share in shares if np.isfinite(share.value)]
    return sum(known) if known else np.nan


def _column(table: StudyTable, name: str, names: Sequence[str]) -> str:
    """What tells the outcome from the others: its title, or its joint if all have one title."""
    titles = {metric_of(other).title for other in names}
    return metric_of(name).title if len(titles) == len(names) else table.place(name)


def _percent(share: Share) -> str:
    if np.isnan(share.value):
        return "–"
    return f"{100 * max(share.value, 0):.0f} ± {100 * share.error:.0f}"


def cell(value: float | str) -> str:
    """Format a number or a text as tables show it; a dash for NaN."""
    if isinstance(value, int | float):
        return "–" if np.isnan(value) else f"{value:.4g}"
    return str(value)


# --- sections --------------------------------------------------------------------------------


def _summary(table: StudyTable) -> list[doc.Block]:
    failed = failures(table)
    names = ", ".join(f"`{name}`" for name in varied(table))
    what = f"which differ in {names}" if names else "whose inputs are all the same"
    seconds = float(np.nansum(table.duration))
    tiles = [
        (runs, status.replace("_", " "), _LOOKS.get(status, "bad"))
        for status, runs, _ in count_statuses(table)
    ]
    blocks: list[doc.Block] = [
        *([doc.Text(f"{_capital(failed)}.", "bad")] if failed else []),
        doc.Text(f"{len(table)} runs, {what}; {_time(seconds)} of computation in all."),
        doc.Tiles(tiles),
    ]
    if found := [finding(table, family) for family in headlines(table)]:
        blocks += [
            doc.Heading("What we found"),
            doc.Bullets(found),
            *([doc.Text(_BRACKETS, "soft")] if any(" ± " in text for text in found) else []),
        ]
    return blocks


def finding(table: StudyTable, family: str) -> str:
    """How large an outcome gets, and what it comes of, in words.

    Args:
        table: of the study.
        family: of the outcome.
    """
    label = ", ".join(filter(None, [metric_of(family).label, table.place(family)]))
    limits: list[str] = []
    causes: dict[str, list[str]] = {}
    for level, part in table.groups.items():
        (value,) = metric_of(family).factor * percentiles(part, family, (95,))
        if np.isnan(value):
            continue
        where = f" with `{level}`" if table.by else ""
        limits.append(f"{value:.3g}{where}")
        shares = sensitivity(part, family)
        name, share = next(iter(shares.items()), ("", Share(0, 0)))
        if len(shares) > 1 and share.value > max(_NEAR_NOTHING, 2 * share.error):
            causes.setdefault(name, []).append(f"{_percent(share)} %{where}")
    runs = "the runs" if usable(table, family).all() else "the runs that have a number"
    text = f"**{_capital(label)}:** 95 % of {runs} stay at or below {listed(limits)}."
    if not causes:
        return text
    most = [f"`{name}` ({', '.join(shares)})" for name, shares in causes.items()]
    return f"{text} It varies most with {listed(most)}."


def _percentiles(table: StudyTable) -> list[doc.Block]:
    about = "Over the runs that are ok; joint side, torques as shares of the motor's largest."
    return [
        doc.Text(about),
        *(percentile_table(table, [family]) for family in headlines(table)),
        *_by_joint(table, lambda names: [percentile_table(table, names)]),
    ]


def _worst(table: StudyTable, folder: Path) -> list[doc.Block]:
    command = f"sdt-drake study repeat {shlex.quote(str(folder))} --row N"
    return [
        *(worst_table(table, family) for family in headlines(table)),
        doc.Text(f"A run once more, exactly: `{command}`"),
    ]


def _matters(table: StudyTable, figure: list[doc.Block]) -> list[doc.Block]:
    overview = sensitivity_tables(table, headlines(table))
    if not overview:
        return figure
    about = (
        "Share of the variance of an outcome that each input explains alone (first-order index, as "
        "the correlation ratio less what chance gives; worst joint of each run), and its standard "
        "error. What a sum lacks to 100 %, beyond these errors, comes of inputs acting together, "
        "or is too fine for the bins of so many runs."
    )
    by_joint = _by_joint(table, lambda names: sensitivity_tables(table, names))
    return [doc.Text(about), *overview, *figure, *by_joint]


def _by_joint(
    table: StudyTable, tables: Callable[[list[str]], Sequence[doc.Table]]
) -> list[doc.Block]:
    """Each family with the tables of its worst joint and of each joint, to unfold."""
    details: list[doc.Block] = [
        doc.Details(
            _capital(metric_of(family).title),
            tables([family, *(f"{family}_{k}" for k in table.joints(family))]),
        )
        for family in families_there(table)
    ]
    return [doc.Heading("Everything, by joint"), *details] if details else []


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _time(seconds: float) -> str:
    for size, unit in ((3600, "h"), (60, "min")):
        if seconds >= 2 * size:
            return f"{seconds / size:.1f} {unit}"
    return f"{seconds:.1f} s"
