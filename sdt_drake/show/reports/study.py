"""Tables, figures and report of a study."""

import shlex
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from sdt_drake.analysis.metrics import metric_of
from sdt_drake.io.files import write_text
from sdt_drake.io.shown import listed
from sdt_drake.run.options import in_print
from sdt_drake.show import sections as doc
from sdt_drake.show.documents import REPORT, Report, written
from sdt_drake.show.figures import fronts as plots_front
from sdt_drake.show.figures import studies as plots
from sdt_drake.show.reports import study_tables
from sdt_drake.studies import summary
from sdt_drake.studies.results import read_study_table
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
_MIN_SHARE = 0.05  # of the variance; a smaller share is no finding


def write_study_report(folder: Path, out: Path | None = None) -> tuple[Path, list[doc.Table]]:
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


def make_study_report(table: StudyTable, folder: Path) -> tuple[Report, list[doc.Table]]:
    """Return the report of a study, and its tables without those of each joint.

    Args:
        table: the table of the study.
        folder: the folder of the study, for the command that repeats a run.
    """
    families, status = headlines(table), study_tables.status_table(table)
    figures = study_figures(table)
    percentile_tables = [study_tables.percentile_table(table, [family]) for family in families]
    worst = [study_tables.worst_table(table, family) for family in families]
    shares = study_tables.sensitivity_tables(table, families)
    failed = summary.failures(table)
    found = [text for family in families if (text := cause(table, family))]
    inputs = doc.joined(map(doc.code, summary.varied(table)))
    counts = [
        (runs, status.replace("_", " "), _LOOKS.get(status, "bad"))
        for status, runs in summary.count_statuses(table).items()
    ]
    again = f"sdt-drake study repeat {shlex.quote(str(folder))} --row N"
    report = written("study", {
        **{f"{name}.png": figures.get(name) for name in FIGURES},
        "name": table.name, "status": None if table.ok.all() else status,
        "failed": failed and doc.Box("div", [f"{doc.capital(failed)}."], ' class="bad"'),
        "limits": study_tables.limits_table(table, families) if families else None,
        "findings": doc.bullets(found), "the_input": "the input" if found else None,
        "runs": len(table), "time": _time(table.runs["duration"].sum()),
        "differ": doc.said("that differ in {}", inputs) if inputs else "with equal inputs",
        "counts": doc.tiles(counts) if len(counts) > 1 else None,
        "all_ok": ", all ok," if table.ok.all() else "",
        "ok": "ok" if families else None, "percentiles": percentile_tables,
        "by_joint": _by_joint(table, lambda names: [study_tables.percentile_table(table, names)]),
        "worst": worst, "repeat": again if families else None,
        "each": "each input" if shares else None, "shares": shares,
        "shares_by_joint": shares and _by_joint(
            table, partial(study_tables.sensitivity_tables, table)
        ),
    })  # fmt: skip
    return report, [status, *percentile_tables, *worst, *shares]


def study_chapter(folder: Path) -> doc.Section:
    """Return the section on a study for a report in the folder above.

    Raises:
        InputError: as for `write_study_report`.
    """
    report, _ = make_study_report(read_study_table(folder), folder)
    sections = {section.title: section for section in report.sections}
    figures = [
        replace(block, name=f"{folder.name}/{block.name}")
        for section in report.sections
        for block in section.blocks
        if isinstance(block, doc.Picture) and block.name != "scatter.png"
    ]
    told = [
        block
        for name in ("Summary", "Status")
        if name in sections
        for block in sections[name].blocks
    ]
    return doc.Section(report.title, [*told, *figures])


def families_there(table: StudyTable) -> list[str]:
    """Return the families of outcomes that at least one run has."""
    return [family for family in table.families if summary.usable(table, family).any()]


def headlines(table: StudyTable) -> list[str]:
    """Return the most important families of outcomes."""
    there = families_there(table)
    return [family for family in _HEADLINES if family in there] or there[: len(_HEADLINES)]


def study_figures(table: StudyTable) -> dict[str, Figure]:
    """Draw the figures for which there is data, by name."""
    names, count = headlines(table), int(table.ok.sum())
    moved = [family for family in names if plots.influential(table, [family])]
    drawn: dict[str, Figure] = {}
    if names:
        title = f"{table.name}: share of {count} runs at or below a value"
        drawn["distributions"] = plots.distributions(title, table, names)
    if moved:
        family = ERROR if ERROR in moved else moved[0]
        title = f"{table.name}: effect of the inputs on the {metric_of(family).title}"
        drawn["tornado"] = plots.tornado_figure(title, table, family)
        title = f"{table.name}: outcomes over the most important inputs"
        outcomes = list(dict.fromkeys([*names, *families_there(table)]))[: plots.MAX_PANELS]
        inputs = plots.influential(table, names)
        drawn["scatter"] = plots.scatter_matrix(title, table, inputs, outcomes)
    is_front = table.choices and not table.missing and {COST, ERROR} <= set(table.families)
    if is_front and len(table.designs(COST, ERROR)):
        title = f"{table.name}: {metric_of(ERROR).title} over {metric_of(COST).title}"
        drawn["pareto"] = plots_front.pareto_figure(title, table, COST, ERROR)
    return drawn


def cause(table: StudyTable, family: str) -> doc.Marked | None:
    """Return the inputs that an outcome depends on most, or None if there is none.

    Args:
        table: the table of the study.
        family: family of the outcome.
    """
    causes: dict[str, list[str]] = {}
    for level, part in table.groups.items():
        where = doc.said(" with {}", in_print(level)) if table.by else ""
        shares = summary.sensitivity(part, family)
        name, share, error = next(shares.itertuples(name=None), ("", 0, 0))
        if len(shares) > 1 and share > max(_MIN_SHARE, 2 * error):
            percent = study_tables.percent_of(share, error)
            causes.setdefault(name, []).append(doc.said("{} %{}", percent, where))
    if not causes:
        return None
    named = [doc.said("{:code} ({})", name, doc.joined(shares)) for name, shares in causes.items()]
    what = doc.capital(metric_of(family).title)
    return doc.said("**{}** depends most on {}.", what, doc.Marked(listed(named)))


def _by_joint(table: StudyTable, tables: Callable[[list[str]], list[doc.Table]]) -> list[doc.Block]:
    """Return folded tables of each family, for its worst joint and for each joint."""
    folded = [
        doc.details(
            doc.capital(metric_of(family).title),
            *tables([family, *(f"{family}_{k}" for k in table.joints(family))]),
        )
        for family in families_there(table)
    ]
    return [doc.Marked("### All outcomes by joint"), *folded] if folded else []


def _time(seconds: float) -> str:
    for size, unit in ((3600, "h"), (60, "min")):
        if seconds >= 2 * size:
            return f"{seconds / size:.1f} {unit}"
    return f"{seconds:.1f} s"
