"""The results of a study: tables and figures, on one page and on the command line."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np

from sdt_drake.analysis import document as doc
from sdt_drake.analysis.metrics import metric_of
from sdt_drake.analysis.report import REPORT
from sdt_drake.analysis.style import PALETTE, save_both
from sdt_drake.shown import listed
from sdt_drake.studies import plots, plots_front
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
from sdt_drake.studies.table import StudyTable, levels_of

COST, ERROR = "peak_torque_share", "max_abs_speed_error"
"""Of the Pareto front."""

CAPTIONS = {
    "distributions": "Share of the runs that stay below a value; marked: half of them, 95 % and "
    "99 %.",
    "tornado": "Mean over the runs in which an input is in its lowest or in its highest fifth; of "
    "texts, the level with the lowest and the one with the highest mean.",
    "scatter": "A point for each run, at most 2000 of them.",
    "pareto": "Designs that can do all runs, by the worst of them; in grey: another beats it.",
}
"""Of the figures."""

_HEADLINES = (
    "max_abs_speed_error", "max_abs_position_error", "peak_torque_share", "winding_temperature",
    "felt_share",
)  # fmt: skip
_LOOKS = {"ok": "good", "infeasible": "open"}  # of statuses; others are bad
_NEAR_NOTHING = 0.05  # of the variance: not worth a sentence
_BRACKETS = "In brackets: share of the variance that the input explains alone, and standard error."


def write_study_report(folder: Path) -> tuple[Path, doc.Document]:
    """Write the figures and report.html into the folder of a study; each file replaced whole.

    Returns:
        The path of the page, and what it shows.

    Raises:
        InputError: if the folder holds no study with a run, or a file cannot be written.
    """
    table = read_study_table(folder)
    document = make_study_report(table, folder)
    return doc.write_text(folder / REPORT, document.html()), document


def study_chapter(folder: Path) -> doc.Section:
    """What matters most of a study, for a larger report; its figures are written.

    Raises:
        InputError: as `write_study_report`.
    """
    table = read_study_table(folder)
    figures = _figures(table, folder, grouping(table))
    blocks = [*_summary(table, grouping(table)), status_table(table)]
    shown = (figures[name] for name in ("distributions", "tornado", "pareto") if name in figures)
    return doc.Section(f"Study {table.name}", [*blocks, *shown])


def make_study_report(table: StudyTable, folder: Path) -> doc.Document:
    """The report on a study; its figures are written into the folder.

    Args:
        table: of the study.
        folder: it is in; named in the command that repeats a run.
    """
    by, families = grouping(table), headlines(table)
    figures = _figures(table, folder, by)

    def figure(name: str) -> list[doc.Block]:
        return [figures[name]] if name in figures else []

    distributions = [*figure("distributions"), *_percentiles(table, families, by)]
    scatter, pareto = figure("scatter"), figure("pareto")
    sections = [
        doc.Section("Summary", _summary(table, by)),
        doc.Section("Status", [status_table(table)]),
        doc.Section("Distributions", distributions if families else []),
        doc.Section("Worst runs", _worst(table, families, by, folder)),
        doc.Section("What matters", _matters(table, families, by, figure("tornado"))),
        doc.Section("All runs", scatter),
        doc.Section("Pareto front", pareto),
    ]
    return doc.Document(f"Study {table.name}", sections=sections)


def grouping(table: StudyTable) -> str | None:
    """The text input whose levels are best told apart: the controller, or the first of few levels.

    None if there is no such input.
    """
    names = [
        name for name in table.text_inputs if 1 < len(levels_of(table.inputs[name])) <= len(PALETTE)
    ]
    return min(names, key=lambda name: not name.startswith("controller"), default=None)


def families_there(table: StudyTable) -> list[str]:
    """The families of outcomes that some run has."""
    return [family for family in table.families if usable(table, family).any()]


def headlines(table: StudyTable) -> list[str]:
    """Of these the ones to look at first."""
    there = families_there(table)
    return [family for family in _HEADLINES if family in there] or there[: len(_HEADLINES)]


def _figures(table: StudyTable, folder: Path, by: str | None) -> dict[str, doc.Figure]:
    """Those that there is something to draw for, written into the folder."""
    names, count = headlines(table), int(table.ok.sum())
    moved = [family for family in names if plots.influential(table, [family], by)]
    drawn = {}
    if names:
        title = f"{table.name}: {count} runs, and what share of them stays below"
        drawn["distributions"] = plots.distributions(title, table, names, by)
    if moved:
        family = ERROR if ERROR in moved else moved[0]
        title = f"{table.name}: what moves the {metric_of(family).title}"
        drawn["tornado"] = plots.tornado_figure(title, table, family, by)
        title = f"{table.name}: outcomes over the inputs that explain most"
        outcomes = list(dict.fromkeys([*names, *families_there(table)]))[: plots.MOST_PANELS]
        inputs = plots.influential(table, names, by)
        drawn["scatter"] = plots.scatter_matrix(title, table, inputs, outcomes, by)
    if (
        {COST, ERROR} <= set(table.families)
        and table.choices
        and len(table.designs(COST, ERROR)[0])
    ):
        title = f"{table.name}: {metric_of(ERROR).title} over {metric_of(COST).title}"
        drawn["pareto"] = plots_front.pareto_figure(title, table, COST, ERROR, by)
    return {
        name: doc.Figure(
            CAPTIONS[name],
            save_both(figure, folder / name),
            folder,
            "" if name == "pareto" else "wide",  # of one panel, or of many
        )
        for name, figure in drawn.items()
    }


# --- tables ----------------------------------------------------------------------------------


def status_table(table: StudyTable) -> doc.Table:
    """How many runs ended in which way; below each, the most frequent reasons."""
    rows = []
    for status, runs, reasons in count_statuses(table):
        rows.append([status, str(runs), f"{100 * runs / len(table):.1f}", "", ""])
        rows += [["", str(n), "", str(row), text] for text, n, row in reasons]
    return doc.Table(["status", "runs", "%", "first row", "reason"], rows, "Runs by status")


def percentile_table(table: StudyTable, names: Sequence[str], by: str | None = None) -> doc.Table:
    """Percentiles of outcomes: a row for each, and for each level of `by`.

    Args:
        table: of the study.
        names: of outcomes of one family, or of the family for the worst joint of it.
        by: text input.
    """
    metric = metric_of(names[0])
    rows = []
    for level, part in table.split(by).items():
        for name in names:
            place = ", ".join(filter(None, [level, table.place(name)]))
            rows.append([place, *map(_number, metric.factor * percentiles(part, name))])
    header = [by or "", *(f"{percent} %" for percent in PERCENTS[:-1]), "largest"]
    return doc.Table(header, rows, f"Percentiles: {metric.label}")


def worst_table(
    table: StudyTable, outcome: str, by: str | None = None, count: int = 3
) -> doc.Table:
    """The worst runs of an outcome, for each level of `by`: row, value, joint, inputs.

    Args:
        table: of the study.
        outcome: its name, or that of a family: of each run's worst joint.
        by: text input.
        count: of the runs for each level.
    """
    metric, has_joints = metric_of(outcome), bool(table.joints(outcome))
    inputs = sorted(varied(table), key=lambda name: name != by)
    rows = []
    for part in table.split(by).values():
        runs = worst_runs(part, outcome, count)
        columns: list[Iterable[object]] = [runs.row]
        if has_joints:
            columns.append(runs.worst_joint(outcome))
        columns.append([_number(metric.factor * value) for value in runs.outcome(outcome)])
        columns += [map(_cell, runs.inputs[name].tolist()) for name in inputs]
        rows += [list(map(str, cells)) for cells in zip(*columns, strict=True)]
    header = ["row", *(["joint"] if has_joints else []), metric.unit or "value", *inputs]
    return doc.Table(header, rows, f"Worst runs: {metric.title}")


def sensitivity_tables(
    table: StudyTable, names: Sequence[str], by: str | None = None
) -> list[doc.Table]:
    """Share of the variance that each input explains alone [%], with its standard error; a table
    for each level of `by` in which more than one input varies.

    Args:
        table: of the study.
        names: of outcomes, a column each; a family for the worst joint of it.
        by: text input.
    """
    tables = []
    for level, part in table.split(by).items():
        columns = [sensitivity(part, name) for name in names]
        inputs = dict.fromkeys(key for shares in columns for key in shares)
        whole = {key: _sum(shares.get(key) for shares in columns) for key in inputs}
        rows = [
            [key, *(_percent(shares.get(key)) for shares in columns)]
            for key in sorted(whole, key=lambda key: -np.nan_to_num(whole[key]))
        ]
        if len(rows) > 1:
            sums = (_sum(shares.values()) for shares in columns)
            rows.append(["sum", *("–" if np.isnan(x) else f"{100 * x:.0f}" for x in sums)])
            header = ["input", *(_column(table, name, names) for name in names)]
            tables.append(
                doc.Table(header, rows, f"Variance explained by each input alone [%], {level}")
            )
    return tables


def _sum(shares: Iterable[Share | None]) -> float:
    """As the table shows them: what is below 0 is chance; NaN if there are none."""
    known = [max(share.value, 0) for share in shares if share and np.isfinite(share.value)]
    return sum(known) if known else np.nan


def _column(table: StudyTable, name: str, names: Sequence[str]) -> str:
    """What tells the outcome from the others: its title, or its joint if all have one title."""
    titles = {metric_of(other).title for other in names}
    return metric_of(name).title if len(titles) == len(names) else table.place(name)


def _percent(share: Share | None) -> str:
    if share is None or np.isnan(share.value):
        return "–"
    return f"{100 * max(share.value, 0):.0f} ± {100 * share.error:.0f}"


def _number(value: float) -> str:
    return "–" if np.isnan(value) else f"{value:.4g}"


def _cell(value: float | str) -> str:
    return _number(value) if isinstance(value, int | float) else str(value)


# --- sections --------------------------------------------------------------------------------


def _summary(table: StudyTable, by: str | None) -> list[doc.Block]:
    failed = failures(table)
    names = ", ".join(f"`{name}`" for name in varied(table))
    own = names or "inputs, which are all the same"
    seconds = float(np.nansum(table.duration))
    tiles = [
        (runs, status.replace("_", " "), _LOOKS.get(status, "bad"))
        for status, runs, _ in count_statuses(table)
    ]
    blocks: list[doc.Block] = [
        *([doc.Text(f"{_capital(failed)}.", "bad")] if failed else []),
        doc.Text(
            f"{len(table)} runs, each with its own {own}; {_time(seconds)} of computation in all."
        ),
        doc.Tiles(tiles),
    ]
    if found := [finding(table, family, by) for family in headlines(table)]:
        blocks += [
            doc.Heading("What we found"),
            doc.Bullets(found),
            *([doc.Text(_BRACKETS, "soft")] if any(" ± " in text for text in found) else []),
        ]
    return blocks


def finding(table: StudyTable, family: str, by: str | None = None) -> str:
    """How large an outcome gets, and what it comes of, in words.

    Args:
        table: of the study.
        family: of the outcome.
        by: text input whose levels are told apart.
    """
    label = ", ".join(filter(None, [metric_of(family).label, table.place(family)]))
    limits: list[str] = []
    causes: dict[str, list[str]] = {}
    for level, part in table.split(by).items():
        (value,) = metric_of(family).factor * percentiles(part, family, (95,))
        if np.isnan(value):
            continue
        where = f" with `{level}`" if by else ""
        limits.append(f"{value:.3g}{where}")
        shares = sensitivity(part, family)
        name, share = next(iter(shares.items()), ("", Share(0, 0)))
        if len(shares) > 1 and share.value > max(_NEAR_NOTHING, 2 * share.error):
            causes.setdefault(name, []).append(f"{_percent(share)} %{where}")
    text = f"**{_capital(label)}:** 95 % of the runs stay below {listed(limits)}."
    if not causes:
        return text
    most = [f"`{name}` ({', '.join(shares)})" for name, shares in causes.items()]
    return f"{text} It varies most with {listed(most)}."


def _percentiles(table: StudyTable, families: Sequence[str], by: str | None) -> list[doc.Block]:
    about = "Over the runs that are ok; joint side, torques as shares of the motor's largest."
    return [
        doc.Text(about),
        *(percentile_table(table, [family], by) for family in families),
        *_by_joint(table, lambda names: [percentile_table(table, names, by)]),
    ]


def _worst(
    table: StudyTable, families: Sequence[str], by: str | None, folder: Path
) -> list[doc.Block]:
    if not families:
        return []
    command = f"sdt-drake study repeat {shlex.quote(str(folder))} --row N"
    return [
        *(worst_table(table, family, by) for family in families),
        doc.Text(f"A run once more, exactly: `{command}`"),
    ]


def _matters(
    table: StudyTable, families: Sequence[str], by: str | None, figure: list[doc.Block]
) -> list[doc.Block]:
    overview = sensitivity_tables(table, families, by)
    if not overview:
        return figure
    about = (
        "Share of the variance of an outcome that each input explains alone (first-order index, as "
        "the correlation ratio less what chance gives; worst joint of each run), and its standard "
        "error. What a sum lacks to 100 %, beyond these errors, comes of inputs acting together, "
        "or is too fine for the bins of so many runs."
    )
    by_joint = _by_joint(table, lambda names: sensitivity_tables(table, names, by))
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
