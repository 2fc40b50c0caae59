"""Tables, figures and report of a study."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import chain
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from sdt_drake.analysis.metrics import family_of, metric_of
from sdt_drake.io.files import write_text
from sdt_drake.io.shown import listed
from sdt_drake.show.documents import REPORT, Report
from sdt_drake.show.figures import fronts as plots_front
from sdt_drake.show.figures import studies as plots
from sdt_drake.show.sections import (
    Block,
    Box,
    Marked,
    Picture,
    Section,
    Table,
    bullets,
    capital,
    code,
    details,
    joined,
    said,
    tiles,
)
from sdt_drake.studies.results import read_study_table
from sdt_drake.studies.summary import (
    PERCENTS,
    Share,
    count_statuses,
    failures,
    percentiles,
    reasons,
    sensitivity,
    usable,
    varied,
    worst_runs,
)
from sdt_drake.studies.table import StudyTable

COST, ERROR = "peak_torque_share", "max_abs_speed_error"
"""The outcomes of the Pareto front."""

FIGURES = ("distributions", "tornado", "scatter", "pareto")
"""Names of all possible figures."""

_HEADLINES = (
    "max_abs_speed_error", "max_abs_position_error", "peak_torque_share", "winding_temperature",
    "felt_share",
)  # fmt: skip
_LOOKS = {"ok": "good", "infeasible": "open"}  # classes of page.css; other statuses are "bad"
_UNKNOWN = Share(np.nan, np.nan)
_MAX_REASONS = 3  # of a status in a table
_MIN_SHARE = 0.05  # of the variance; a smaller share is no finding


def write_study_report(folder: Path, out: Path | None = None) -> tuple[Path, list[Table]]:
    """Write the figures and report.html of a study; each file is replaced whole.

    Args:
        folder: the folder of the study.
        out: the folder of the files; None for that of the study.

    Returns:
        The path of the page, and its tables without those of each joint.

    Raises:
        InputError: if the folder contains no study with a run, or a file cannot be written.
    """
    report, tables = make_study_report(read_study_table(folder), folder)
    place = out or folder
    report.write_parts(place)
    return write_text(place / REPORT, report.page(place)), tables


def make_study_report(table: StudyTable, folder: Path) -> tuple[Report, list[Table]]:
    """Return the report of a study, and its tables without those of each joint.

    Args:
        table: the table of the study.
        folder: the folder of the study, for the command that repeats a run.
    """
    families, figures, status = headlines(table), study_figures(table), status_table(table)
    sections = [Section("Summary", study_summary(table)), Section("Status", [status])]
    if not families:
        return Report(f"Study {table.name}", [], sections), [status]
    percentile_tables = [percentile_table(table, [family]) for family in families]
    worst = [worst_table(table, family) for family in families]
    shares = sensitivity_tables(table, families)
    repeat = said(
        "Repeat a run exactly: {:code}",
        f"sdt-drake study repeat {shlex.quote(str(folder))} --row N",
    )
    sections += [
        Section(
            "Distributions",
            [
                *_pictures(figures, "distributions"),
                "Runs with status ok; joint side, torques as shares of the motor's largest torque.",
                *percentile_tables,
                *_by_joint(table, lambda names: [percentile_table(table, names)]),
            ],
        ),
        Section("Worst runs", [*worst, repeat]),
        Section(
            "What matters",
            [
                *([_EXPLAINED] if shares else []),
                *shares,
                *_pictures(figures, "tornado"),
                *(_by_joint(table, partial(sensitivity_tables, table)) if shares else []),
            ],
        ),
        Section("All runs", _pictures(figures, "scatter")),
        Section("Pareto front", _pictures(figures, "pareto")),
    ]
    tables = [status, *percentile_tables, *worst, *shares]
    return Report(f"Study {table.name}", [], [one for one in sections if one.blocks]), tables


_EXPLAINED = (
    "The share of an outcome's variance that each input explains alone, with its standard error "
    "(first-order index: correlation ratio, corrected for chance; worst joint of each run). The "
    "rest to 100 % comes from inputs acting together, or is too fine for the bins of this number "
    "of runs."
)
_CAPTIONS = {
    "distributions": "Share of the runs at or below a value; markers at 50 %, 95 % and 99 %.",
    "tornado": "Mean over the runs in which an input is in its lowest or highest fifth; for "
    "texts, the levels with the lowest and the highest mean.",
    "scatter": "A point for each run, at most 2000.",
    "pareto": "Designs that complete all runs, with their worst values; grey: another design is "
    "better in one outcome and not worse in the other.",
}


def _pictures(figures: Mapping[str, Figure], *names: str, place: str = "") -> list[Picture]:
    """Return the pictures of existing figures; `place` is the path of their folder."""
    return [
        Picture(f"{place}{name}.png", _CAPTIONS[name], figures[name])
        for name in names
        if name in figures
    ]


def study_chapter(folder: Path) -> Section:
    """Return the section on a study for a report in the folder above.

    Raises:
        InputError: as for `write_study_report`.
    """
    table = read_study_table(folder)
    figures = study_figures(table, ("distributions", "tornado", "pareto"))
    pictures = _pictures(figures, *figures, place=f"{folder.name}/")
    blocks = [*study_summary(table), status_table(table), *pictures]
    return Section(f"Study {table.name}", blocks)


def families_there(table: StudyTable) -> list[str]:
    """Return the families of outcomes that at least one run has."""
    return [family for family in table.families if usable(table, family).any()]


def headlines(table: StudyTable) -> list[str]:
    """Return the most important families of outcomes."""
    there = families_there(table)
    return [family for family in _HEADLINES if family in there] or there[: len(_HEADLINES)]


def study_figures(table: StudyTable, wanted: Sequence[str] = FIGURES) -> dict[str, Figure]:
    """Draw the chosen figures for which there is data, by name."""
    names, count = headlines(table), int(table.ok.sum())
    moved = [family for family in names if plots.influential(table, [family])]
    drawn: dict[str, Callable[[], Figure]] = {}
    if names:
        title = f"{table.name}: share of {count} runs at or below a value"
        drawn["distributions"] = partial(plots.distributions, title, table, names)
    if moved:
        family = ERROR if ERROR in moved else moved[0]
        title = f"{table.name}: effect of the inputs on the {metric_of(family).title}"
        drawn["tornado"] = partial(plots.tornado_figure, title, table, family)
        title = f"{table.name}: outcomes over the most important inputs"
        outcomes = list(dict.fromkeys([*names, *families_there(table)]))[: plots.MAX_PANELS]
        inputs = plots.influential(table, names)
        drawn["scatter"] = partial(plots.scatter_matrix, title, table, inputs, outcomes)
    is_front = table.choices and not table.missing and {COST, ERROR} <= set(table.families)
    if is_front and len(table.designs(COST, ERROR)):
        title = f"{table.name}: {metric_of(ERROR).title} over {metric_of(COST).title}"
        drawn["pareto"] = partial(plots_front.pareto_figure, title, table, COST, ERROR)
    return {name: draw() for name, draw in drawn.items() if name in wanted}


# --- tables ----------------------------------------------------------------------------------


def status_table(table: StudyTable) -> Table:
    """Make the table of runs by status, with the most frequent reasons."""
    rows = []
    for status, runs in count_statuses(table).items():
        rows.append([status, str(runs), f"{100 * runs / len(table):.1f}", "", ""])
        for one in reasons(table, status).head(_MAX_REASONS).itertuples():
            rows.append(["", str(one.runs), "", str(one.row), one.reason])
    return Table(["status", "runs", "%", "first row", "reason"], rows, "Runs by status")


def percentile_table(table: StudyTable, names: Sequence[str]) -> Table:
    """Make the table of percentiles of outcomes, a row for each outcome and group.

    Args:
        table: the table of the study.
        names: outcomes of one family, or the family for its worst joint.
    """
    metric = metric_of(names[0])
    rows = []
    for level, part in table.groups.items():
        for name in names:
            place = ", ".join(filter(None, [level, table.place(name)]))
            rows.append([place, *map(cell, metric.factor * percentiles(part, name))])
    header = [table.by or "", *(f"{percent} %" for percent in PERCENTS[:-1]), "largest"]
    return Table(header, rows, f"Percentiles: {metric.label}")


def outcome_tables(names: Sequence[str], outcomes: Sequence[float]) -> list[Table]:
    """Make tables of a run's outcomes: first those of joints, then those of the whole run.

    Args:
        names: names of `outcomes.outcome_names`.
        outcomes: values by these names.
    """
    rows: dict[bool, dict[str, list[str]]] = {True: {}, False: {}}
    for name, value in zip(names, outcomes, strict=True):
        metric, joint = metric_of(name), family_of(name)[1]
        rows[joint is not None].setdefault(metric.label, [metric.label]).append(metric.text(value))
    by_joint, whole = (list(some.values()) for some in rows.values())
    n = max(map(len, by_joint), default=1) - 1
    tables = [
        Table(["outcome", *(f"joint {k + 1}" for k in range(n))], by_joint),
        Table(["outcome", "of the run"], whole),
    ]
    return [table for table in tables if table.rows]


def worst_table(table: StudyTable, outcome: str, count: int = 3) -> Table:
    """Make the table of the worst runs of an outcome for each group: row, joint, value, inputs.

    Args:
        table: the table of the study.
        outcome: outcome, or a family for each run's worst joint.
        count: number of runs for each group.
    """
    metric, has_joints = metric_of(outcome), bool(table.joints(outcome))
    inputs = sorted(varied(table), key=lambda name: name != table.by)
    rows = []
    for part in table.groups.values():
        runs = worst_runs(part, outcome, count)
        columns: list[Iterable[object]] = [runs.runs.index]
        if has_joints:
            columns.append(runs.worst_joint(outcome))
        columns.append([cell(metric.factor * value) for value in runs.outcome(outcome)])
        columns += [map(cell, runs.runs[name].tolist()) for name in inputs]
        rows += [list(map(str, cells)) for cells in zip(*columns, strict=True)]
    header = ["row", *(["joint"] if has_joints else []), metric.unit or "value", *inputs]
    return Table(header, rows, f"Worst runs: {metric.title}")


def sensitivity_tables(table: StudyTable, names: Sequence[str]) -> list[Table]:
    """Make the tables of the variance that each input explains alone [%], with standard errors.

    There is a table for each group in which more than one input varies.

    Args:
        table: the table of the study.
        names: outcomes, a column each; a family stands for its worst joint.
    """
    tables = []
    for level, part in table.groups.items():
        columns = [_shares(part, name) for name in names]
        by_input = {
            key: [shares.get(key, _UNKNOWN) for shares in columns] for key in chain(*columns)
        }
        if len(by_input) > 1:
            ordered = sorted(by_input.items(), key=lambda item: -np.nan_to_num(_sum(item[1])))
            rows = [[key, *map(_percent, shares)] for key, shares in ordered]
            sums = (_sum(shares.values()) for shares in columns)
            rows.append(["sum", *("–" if np.isnan(x) else f"{100 * x:.0f}" for x in sums)])
            header = ["input", *(_column(table, name, names) for name in names)]
            title = f"Variance explained by each input alone [%], {level}"
            tables.append(Table(header, rows, title))
    return tables


def _shares(table: StudyTable, outcome: str) -> dict[str, Share]:
    """Return the shares of `sensitivity` by input."""
    found = sensitivity(table, outcome)
    return dict(zip(found.index, map(Share._make, found.itertuples(index=False)), strict=True))


def _sum(shares: Iterable[Share]) -> float:
    """Add shares, with negative estimates as 0; NaN without any."""
    known = [max(share.value, 0) for share in shares if np.isfinite(share.value)]
    return sum(known) if known else np.nan


def _column(table: StudyTable, name: str, names: Sequence[str]) -> str:
    """Return the title of an outcome, or its joint if all outcomes have the same title."""
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


# --- in short --------------------------------------------------------------------------------


def study_summary(table: StudyTable) -> list[Block]:
    """Return the failures, findings and counts of a study."""
    blocks: list[Block] = []
    if failed := failures(table):
        blocks.append(Box("div", [f"{capital(failed)}."], ' class="bad"'))
    found = [finding(table, family) for family in headlines(table)]
    if found:
        blocks.append(bullets(text for text, _ in found))
    if any(has_causes for _, has_causes in found):
        blocks.append(
            Marked(
                "> In brackets: share of the variance that the input explains alone, and its "
                "standard error."
            )
        )
    inputs = joined(map(code, varied(table)))
    differ = said("that differ in {}", inputs) if inputs else "with equal inputs"
    time = _time(table.runs["duration"].sum())
    counts = [
        (runs, status.replace("_", " "), _LOOKS.get(status, "bad"))
        for status, runs in count_statuses(table).items()
    ]
    return [
        *blocks, said("{} runs {}; {} of computation.", len(table), differ, time), tiles(counts)
    ]  # fmt: skip


def finding(table: StudyTable, family: str) -> tuple[Marked, bool]:
    """Return the 95th percentile of an outcome and its main causes, and if it has causes.

    Args:
        table: the table of the study.
        family: family of the outcome.
    """
    limits: list[str] = []
    causes: dict[str, list[str]] = {}
    for level, part in table.groups.items():
        (value,) = metric_of(family).factor * percentiles(part, family, (95,))
        if np.isnan(value):
            continue
        where = said(" with {:code}", level) if table.by else ""
        limits.append(said("{:.3g}{}", value, where))
        shares = _shares(part, family)
        name, share = next(iter(shares.items()), ("", Share(0, 0)))
        if len(shares) > 1 and share.value > max(_MIN_SHARE, 2 * share.error):
            causes.setdefault(name, []).append(said("{} %{}", _percent(share), where))
    text = said(
        "**{}:** at most {} in 95 % of {}.",
        capital(", ".join(filter(None, [metric_of(family).label, table.place(family)]))),
        Marked(listed(limits)),
        "the runs" if usable(table, family).all() else "the runs with a value",
    )
    if not causes:
        return text, False
    named = [said("{:code} ({})", name, joined(shares)) for name, shares in causes.items()]
    return joined([text, said("It depends most on {}.", Marked(listed(named)))], " "), True


def _by_joint(table: StudyTable, tables: Callable[[list[str]], list[Table]]) -> list[Block]:
    """Return folded tables of each family, for its worst joint and for each joint."""
    folded = [
        details(
            capital(metric_of(family).title),
            *tables([family, *(f"{family}_{k}" for k in table.joints(family))]),
        )
        for family in families_there(table)
    ]
    return [Marked("### All outcomes by joint"), *folded] if folded else []


def _time(seconds: float) -> str:
    for size, unit in ((3600, "h"), (60, "min")):
        if seconds >= 2 * size:
            return f"{seconds / size:.1f} {unit}"
    return f"{seconds:.1f} s"
