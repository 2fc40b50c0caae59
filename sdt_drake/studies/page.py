"""report.html of a study: its results as one page that needs nothing else."""

from __future__ import annotations

import shlex
import xml.etree.ElementTree as ElementTree
import zlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from sdt_drake.analysis.page import (
    PAGE,
    document,
    escape,
    html_figure,
    html_table,
    inline_svg,
)
from sdt_drake.errors import replacing
from sdt_drake.studies.quantities import quantity_of
from sdt_drake.studies.show import (
    TextTable,
    families_there,
    headlines,
    percentile_table,
    sensitivity_tables,
    status_table,
    worst_table,
    write_figures,
)
from sdt_drake.studies.summary import count_statuses, failures, percentiles, sensitivity, varied
from sdt_drake.studies.table import StudyTable

CAPTIONS = {
    "distributions": "Share of the runs that stay below a value; marked: half of them, 95 % and "
    "99 %.",
    "tornado": "Mean over the runs in which an input is in its lowest or in its highest fifth; of "
    "texts, the level with the lowest and the one with the highest mean.",
    "scatter": "A point for each run, at most 2000 of them.",
    "pareto": "The runs that no other one beats in both, and in grey the rest.",
}
"""Of the figures of `show.figures`."""

LOOKS = {"ok": "good", "infeasible": "open", "failed": "bad", "timed_out": "bad", "crashed": "bad"}
"""Class of each status."""

_NEAR_NOTHING = 0.05  # of the variance: not worth a sentence


def write_report(table: StudyTable, folder: Path, by: str | None = None) -> Path:
    """Write the figures and report.html into the folder of a study; each file replaced whole.

    Args:
        table: of the study.
        folder: it is in; named in the commands of the page.
        by: text input whose levels are told apart; see `show.grouping`.

    Returns:
        The path of the page.

    Raises:
        InputError: for an unknown input, or a file that cannot be written.
    """
    pictures = _pictures(table, folder, by)
    path = folder / PAGE
    with replacing(path) as partial:
        partial.write_text(page(table, pictures, folder, by), encoding="utf-8")
    return path


def chapter(table: StudyTable, folder: Path, by: str | None = None) -> tuple[str, str, str]:
    """Of a larger report: id, title and content of what matters most; its figures are written.

    Args:
        table, folder, by: as in `write_report`.

    Raises:
        InputError: for an unknown input, or a file that cannot be written.
    """
    name = f"study-{zlib.crc32(table.name.encode()):08x}"
    pictures = _pictures(table, folder, by, f"{name}-")
    content = _summary(table, by) + _table(status_table(table))
    for figure, look in (("distributions", "wide"), ("tornado", "wide"), ("pareto", "")):
        if figure in pictures:
            content += html_figure(CAPTIONS[figure], pictures[figure], look)
    return name, escape(f"Study {table.name}"), content


def _pictures(table: StudyTable, folder: Path, by: str | None, prefix: str = "") -> dict[str, str]:
    """Figures of a study, written into its folder, as <svg> elements."""
    return {
        name: inline_svg(ElementTree.parse(path).getroot(), prefix + name)
        for name, path in write_figures(table, folder, by).items()
    }


def page(
    table: StudyTable, pictures: Mapping[str, str], folder: Path, by: str | None = None
) -> str:
    """The HTML text.

    Args:
        table, folder, by: as in `write_report`.
        pictures: <svg> elements by names of CAPTIONS.

    Raises:
        InputError: for an unknown input, or one of numbers.
    """

    def figure(name: str) -> str:
        if name not in pictures:
            return ""
        look = "" if name == "pareto" else "wide"  # of one panel, or of many
        return html_figure(CAPTIONS[name], pictures[name], look)

    contents = (
        ("summary", "Summary", _summary(table, by)),
        ("status", "Status", _table(status_table(table))),
        ("distributions", "Distributions", figure("distributions") + _percentiles(table, by)),
        ("worst", "Worst runs", _worst(table, folder, by)),
        ("matters", "What matters", _matters(table, by, figure("tornado"))),
        ("scatter", "All runs", figure("scatter")),
        ("pareto", "Pareto front", figure("pareto")),
    )
    title = escape(f"Study {table.name}")
    theme = '<button type="button" id="theme" hidden>Dark</button>'
    header = f"<header><h1>{title}</h1>{theme}</header>"
    return document(title, header, [entry for entry in contents if entry[2]])


# --- sections --------------------------------------------------------------------------------


def _summary(table: StudyTable, by: str | None) -> str:
    tiles = "".join(
        f'<li class="{LOOKS[status]}"><strong>{runs}</strong> {status.replace("_", " ")}</li>'
        for status, runs, _ in count_statuses(table)
    )
    names = ", ".join(f"<code>{escape(name)}</code>" for name in varied(table))
    seconds = float(np.nansum(table.duration))
    failed = failures(table)
    warning = f'<p class="bad">{escape(_capital(failed))}.</p>' if failed else ""
    own = names or "inputs, which are all the same"
    found = "".join(f"<li>{text}</li>" for text in findings(table, by))
    return (
        f"{warning}<p>{len(table)} runs, each with its own {own}; "
        f"{_time(seconds)} of computation in all.</p>"
        f'<ul class="tiles">{tiles}</ul>'
        + (
            f'<h3>What we found</h3><ul class="findings">{found}</ul><p class="soft">In brackets: '
            "share of the variance that the input explains alone.</p>"
            if found
            else ""
        )
    )


def findings(table: StudyTable, by: str | None = None) -> list[str]:
    """How large the outcomes get, and what they come of, in words as HTML.

    Args:
        table, by: as in `write_report`.

    Raises:
        InputError: for an unknown input, or one of numbers.
    """
    return [_finding(table, family, by) for family in headlines(table)]


def _finding(table: StudyTable, family: str, by: str | None) -> str:
    label = ", ".join(filter(None, [quantity_of(family).label, table.place(family)]))
    limits, causes = [], {}
    for level, part in table.split(by).items():
        (value,) = quantity_of(family).factor * percentiles(part, family, (95,))
        if np.isnan(value):
            continue
        limits.append(f"{value:.3g}{_with(level, by)}")
        name, share = next(iter(sensitivity(part, family).items()), ("", np.nan))
        if share > _NEAR_NOTHING:
            causes.setdefault(name, []).append(f"{100 * share:.0f} %{_with(level, by)}")
    text = f"<b>{escape(_capital(label))}:</b> 95 % of the runs stay below {_listed(limits)}."
    if not causes:
        return text
    most = [f"<code>{escape(name)}</code> ({', '.join(shares)})" for name, shares in causes.items()]
    return f"{text} It varies most with {_listed(most)}."


def _with(level: str, by: str | None) -> str:
    return f" with <code>{escape(level)}</code>" if by else ""


def _percentiles(table: StudyTable, by: str | None) -> str:
    return (
        "<p>Over the runs that are ok; joint side, torques as shares of the motor's largest.</p>"
        + "".join(_titled(percentile_table(table, [family], by)) for family in headlines(table))
        + _by_joint(table, lambda names: [percentile_table(table, names, by)])
    )


def _by_joint(table: StudyTable, tables: Callable[[list[str]], Sequence[TextTable]]) -> str:
    """Each family with the tables of its worst joint and of each joint, to unfold."""
    folded = ""
    for family in families_there(table):
        names = [family, *(f"{family}_{k}" for k in table.joints(family))]
        title = escape(_capital(quantity_of(family).title))
        content = "".join(map(_titled, tables(names)))
        folded += f"<details><summary>{title}</summary>{content}</details>"
    return f"<h3>Everything, by joint</h3>{folded}" if folded else ""


def _worst(table: StudyTable, folder: Path, by: str | None) -> str:
    """With the command that repeats each run."""
    start = f"sdt-drake study repeat {shlex.quote(str(folder))} --row"
    text = ""
    for family in headlines(table):
        title, header, rows = worst_table(table, family, by)
        at = 3 if table.joints(family) else 2  # after row, joint and value
        header = [*header[:at], "to repeat it", *header[at:]]
        rows = [[*row[:at], f"{start} {row[0]}", *row[at:]] for row in rows]
        text += _titled(TextTable(title, header, rows))
    return text


def _matters(table: StudyTable, by: str | None, figure: str) -> str:
    overview = "".join(map(_titled, sensitivity_tables(table, headlines(table), by)))
    if not overview:
        return ""
    return (
        "<p>Share of the variance of an outcome that each input explains alone (first-order "
        "index, as the correlation ratio less what chance gives; worst joint of each run). What "
        "is missing from a sum of 100 % comes of inputs acting together.</p>"
        f"{overview}{figure}" + _by_joint(table, lambda names: sensitivity_tables(table, names, by))
    )


# --- pieces ----------------------------------------------------------------------------------


def _titled(table: TextTable) -> str:
    return f"<h3>{escape(table.title)}</h3>{_table(table)}"


def _table(table: TextTable) -> str:
    escaped = [[escape(cell) for cell in row] for row in table.rows]
    return html_table([escape(cell) for cell in table.header], escaped)


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _listed(texts: Sequence[str]) -> str:
    """a, b and c"""
    return " and ".join([", ".join(texts[:-1]), texts[-1]] if len(texts) > 1 else texts)


def _time(seconds: float) -> str:
    for size, unit in ((3600, "h"), (60, "min")):
        if seconds >= 2 * size:
            return f"{seconds / size:.1f} {unit}"
    return f"{seconds:.1f} s"
