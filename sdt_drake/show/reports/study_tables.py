"""Tables of a study."""

from collections.abc import Iterable, Sequence

import numpy as np

from sdt_drake.analysis.metrics import family_of, metric_of
from sdt_drake.io.shown import formatted
from sdt_drake.run.options import in_print
from sdt_drake.show.sections import Table
from sdt_drake.studies import summary
from sdt_drake.studies.table import StudyTable, pandas

_MAX_REASONS = 3  # of a status in a table


def status_table(table: StudyTable) -> Table:
    """Make the table of runs by status, with the most frequent reasons."""
    rows = []
    for status, runs in summary.count_statuses(table).items():
        rows.append([status, str(runs), f"{100 * runs / len(table):.1f}", "", ""])
        for one in summary.reasons(table, status).head(_MAX_REASONS).itertuples():
            rows.append(["", str(one.runs), "", str(one.row), one.reason])
    return Table(["status", "runs", "%", "first row", "reason"], rows, "Runs by status")


def limits_table(table: StudyTable, families: Sequence[str]) -> Table:
    """Make the table of the 95th percentiles, a row for each group and a column for each outcome.

    Args:
        table: the table of the study.
        families: families of outcomes, each for the worst joint of a run.
    """
    rows = [
        [in_print(level), *(
            cell(metric_of(x).factor * summary.percentiles(part, x, (95,)).iloc[0])
            for x in families
        )]
        for level, part in table.groups.items()
    ]  # fmt: skip
    header = [table.by or "", *(metric_of(family).label for family in families)]
    some = "" if summary.usable(table, *families).all() else " with a value"
    return Table(header, rows, f"95 % of the runs{some} have at most, at their worst joint")


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
            place = ", ".join(filter(None, [in_print(level), table.place(name)]))
            rows.append([place, *map(cell, metric.factor * summary.percentiles(part, name))])
    header = [table.by or "", *(f"{percent} %" for percent in summary.PERCENTS[:-1]), "largest"]
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
    inputs = sorted(summary.varied(table), key=lambda name: name != table.by)
    rows = []
    for part in table.groups.values():
        runs = summary.worst_runs(part, outcome, count)
        columns: list[Iterable[object]] = [runs.runs.index]
        if has_joints:
            columns.append(runs.worst_joint(outcome))
        columns.append([cell(metric.factor * value) for value in runs.outcome(outcome)])
        columns += [
            map(in_print if name == table.by else cell, runs.runs[name].tolist()) for name in inputs
        ]
        rows += [list(map(str, cells)) for cells in zip(*columns, strict=True)]
    labels = map(table.input_label, inputs)
    header = ["row", *(["joint"] if has_joints else []), metric.unit or "value", *labels]
    return Table(header, rows, f"Worst runs: {metric.title}")


def sensitivity_tables(table: StudyTable, names: Sequence[str]) -> list[Table]:
    """Make the tables of the variance that each input explains alone [%], with standard errors.

    There is a table for each group in which more than one input varies. Shares within their
    standard error have a dash; inputs without any other share are left out.

    Args:
        table: the table of the study.
        names: outcomes, a column each; a family stands for its worst joint.
    """
    tables = []
    for level, part in table.groups.items() if names else ():
        found = pandas().concat({x: summary.sensitivity(part, x) for x in names}, axis=1)
        if len(found) > 1:
            shares = found.xs("value", axis=1, level=1).clip(lower=0)  # estimates may be negative
            order = shares.sum(axis=1).sort_values(ascending=False, kind="stable").index
            rows = [[key, *(percent_of(*found.loc[key, x]) for x in names)] for key in order]
            rows = [row for row in rows if {*row[1:]} != {"–"}]
            sums = shares.sum(min_count=1)
            rows.append(["sum", *(formatted(100 * x, ".0f") for x in sums)])
            header = ["input", *(_column(table, name, names) for name in names)]
            title = f"Variance explained by each input alone [%], {in_print(level)}"
            tables.append(Table(header, rows, title))
    return tables


def _column(table: StudyTable, name: str, names: Sequence[str]) -> str:
    """Return the title of an outcome, or its joint if all outcomes have the same title."""
    titles = {metric_of(other).title for other in names}
    return metric_of(name).title if len(titles) == len(names) else table.place(name)


def percent_of(share: float, error: float) -> str:
    """Format a share of the variance and its standard error [%].

    A share that is unknown, or within its standard error, is a dash.
    """
    is_seen = share > error  # not for NaN
    return f"{100 * share:.0f} ± {100 * error:.0f}" if is_seen else "–"


def cell(value: float | str) -> str:
    """Format a number or a text as tables show it; a dash for NaN."""
    if isinstance(value, int | float):
        return "–" if np.isnan(value) else f"{float(f'{value:.4g}'):g}"
    return str(value)
