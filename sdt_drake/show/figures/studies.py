"""Figures of a study; each function returns a matplotlib Figure.

Groups are the levels of a text input, such as the controller. A group has the same colour, marker
and line style in all figures.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator

from sdt_drake.analysis.metrics import metric_of
from sdt_drake.io.arrays import Array
from sdt_drake.run.options import in_print
from sdt_drake.show.style import PALETTE, finish, grid, looks_of, plain_numbers, style
from sdt_drake.studies.summary import percentiles, sensitivity, tornado, values_of
from sdt_drake.studies.table import StudyTable, is_text, pandas

if TYPE_CHECKING:
    import pandas as pd

WHOLE_DEVICE = "the whole device"
LOW, HIGH = PALETTE[5], PALETTE[1]

MAX_PANELS, MAX_POINTS = 6, 2000
"""Limits of a scatter matrix: inputs or outcomes, and runs."""
BOTTOM = 0.95
"""The bottom margin of figures [inch]."""

_MAX_BARS = 6
_MARKED = ((50, "o"), (95, "^"), (99, "s"))  # percentiles
_MAX_LEVELS = 10  # inputs with more different values are continuous
_LOG_RATIO = 30  # largest over smallest value; axes with more are logarithmic


def distributions(title: str, table: StudyTable, families: Sequence[str]) -> Figure:
    """Draw the share of runs at or below a value, a row for each outcome, a panel for each joint.

    Args:
        title: title of the figure.
        table: the table of the study.
        families: families of outcomes.
    """
    parts = table.groups
    names = [_members(table, family) for family in families]
    columns = max(map(len, names))
    with style():
        figure, axes = grid(
            len(families), columns, panel=(2.35, 1.75), gaps=(0.35, 0.75), left=0.85,
            bottom=BOTTOM, sharex=False,
        )  # fmt: skip
        for row, family, members in zip(axes, families, names, strict=True):
            for ax, name in zip(row, members, strict=False):
                _distribution(ax, parts, name)
                ax.set_title(table.place(name) or WHOLE_DEVICE, loc="left")
                ax.set_xlabel(metric_of(family).label)
                scale(ax, "x", metric_of(name).factor * values_of(table, name))
            for ax in row[len(members) :]:
                ax.set_axis_off()
            row[0].set_ylabel("runs at or below [%]")
        marks = [
            Line2D([], [], color="0.3", linestyle="", marker=marker, label=f"{percent} %")
            for percent, marker in _MARKED
        ]
        return finish(figure, title, group_handles(parts) + marks)


def _distribution(ax: Axes, parts: dict[str, StudyTable], name: str) -> None:
    at = np.linspace(0, 100, 401)  # enough to look smooth; thousands of points make large files
    for part, look in zip(parts.values(), looks_of(list(parts)), strict=True):
        factor = metric_of(name).factor
        ax.plot(factor * percentiles(part, name, at), at, look.dashes, color=look.colour)
        for percent, marker in _MARKED:
            (value,) = factor * percentiles(part, name, (percent,))
            ax.plot(value, percent, marker, color=look.colour, markersize=4, clip_on=False)
    ax.set(ylim=(0, 102), yticks=(0, 25, 50, 75, 95))


def tornado_figure(title: str, table: StudyTable, family: str) -> Figure:
    """Draw how inputs change the mean of an outcome, a row for each group, a panel for each joint.

    The inputs with the largest effect on the joints of a row are at the top.

    Args:
        title: title of the figure.
        table: the table of a study in which some input varies.
        family: family of the outcome.
    """
    names = _members(table, family)
    parts = table.groups
    rows = {level: [tornado(part, name) for name in names] for level, part in parts.items()}
    rows = {level: swings for level, swings in rows.items() if any(map(len, swings))}
    bars = min(_MAX_BARS, max(len(swings) for row in rows.values() for swings in row))
    left = 0.35 + 0.068 * max(len(table.input_label(name)) for name in table.inputs)
    with style():
        figure, axes = grid(
            len(rows), len(names), panel=(2.35, 0.35 + 0.22 * bars), gaps=(0.45, 0.55), left=left,
            bottom=BOTTOM, sharex=False,
        )  # fmt: skip
        for row, (level, swings) in zip(axes, rows.items(), strict=True):
            order = _ordered(swings)[:bars]
            labels = list(map(table.input_label, order))
            for ax, name, own in zip(row, names, swings, strict=True):
                _bars(ax, order, labels, own, metric_of(name).factor, values_of(parts[level], name))
                ax.set_title(table.place(name) or WHOLE_DEVICE, loc="left")
                ax.tick_params(labelleft=ax is row[0])
            if table.by:
                row[0].set_title(f"{in_print(level)}, {row[0].get_title(loc='left')}", loc="left")
        for ax in axes[-1]:
            ax.set_xlabel(metric_of(family)._replace(title="mean").label)
        handles = [
            Patch(color=LOW, label="lowest fifth of the input, or lowest level"),
            Patch(color=HIGH, label="highest fifth, or highest level"),
            Line2D([], [], color="0.2", label="mean of all"),
        ]
        return finish(figure, title, handles)


def _ordered(swings: Sequence[pd.DataFrame]) -> list[str]:
    """Return the names of inputs; those with the largest sum of relative swings come first."""
    widths = pandas().concat([own["width"] / (own["width"].max() or 1) for own in swings], axis=1)
    return [*widths.sum(axis=1).sort_values(ascending=False, kind="stable").index]


def _bars(
    ax: Axes,
    order: Sequence[str],
    labels: Sequence[str],
    swings: pd.DataFrame,
    factor: float,
    values: pd.Series,
) -> None:
    mean = factor * values.mean() if len(values) else np.nan
    own = {swing.Index: swing for swing in swings.itertuples()}
    for at, swing in ((at, own[name]) for at, name in enumerate(order) if name in own):
        ends = (
            (factor * swing.low, LOW, swing.low_level),
            (factor * swing.high, HIGH, swing.high_level),
        )
        # The shorter bar is drawn last, as both may be on the same side.
        for value, colour, level in sorted(ends, key=lambda end: -abs(end[0] - mean)):
            ax.barh(at, value - mean, 0.7, left=mean, color=colour)
            side = -1 if value < mean else 1
            ax.annotate(
                level, (value, at), xytext=(2 * side, 0), textcoords="offset points",
                horizontalalignment="right" if side < 0 else "left", verticalalignment="center",
                fontsize=6.5, clip_on=False,
            )  # fmt: skip
    ax.axvline(mean, color="0.2", linewidth=0.9)
    ax.set_yticks(range(len(order)), labels)
    ax.set_ylim(len(order) - 0.4, -0.6)  # the first at the top
    ax.margins(x=0.4 if swings["low_level"].any() else 0.1)  # room for the levels
    ax.grid(axis="y", visible=False)
    ax.set_axisbelow(True)
    _few_ticks(ax)


def scatter_matrix(
    title: str,
    table: StudyTable,
    inputs: Sequence[str],
    outcomes: Sequence[str],
) -> Figure:
    """Draw outcomes over inputs, a point for each run.

    At most MAX_POINTS runs are drawn, always the same ones of a table.

    Args:
        title: title of the figure.
        table: the table of the study.
        inputs: columns, at most MAX_PANELS.
        outcomes: rows, at most MAX_PANELS; a family stands for its worst joint.
    """
    # The order is random, so that no group hides another or is left out.
    order = np.random.default_rng(0).permutation(table.runs.index)
    runs = table.select([row for row in order if table.ok[row]][:MAX_POINTS])
    levels = list(table.groups)
    colours = np.array([to_rgba(look.colour) for look in looks_of(levels)])
    groups = [levels.index(name) for name in table.group[runs.runs.index]]
    with style():
        figure, axes = grid(
            len(outcomes), len(inputs), panel=(1.95, 1.5), gaps=(0.25, 0.15), left=1.2,
            bottom=1.2, sharex="col",
        )  # fmt: skip
        for row, outcome in zip(axes, outcomes, strict=True):
            y = metric_of(outcome).factor * runs.outcome(outcome).to_numpy()
            for ax, name in zip(row, inputs, strict=True):
                _points(ax, runs.runs[name], y, colours[groups])
                ax.tick_params(labelleft=ax is row[0])
            row[0].set_ylabel(_broken(outcome_label(table, outcome)), fontsize=8)
        for ax, name in zip(axes[-1], inputs, strict=True):
            ax.set_xlabel(_at_dots(table.input_label(name)), fontsize=8)
        figure.align_ylabels(axes[:, 0])
        handles = group_handles(levels, lines=False) if table.by else []
        for handle in handles:
            handle.set_marker("o")  # the marker of all points
        return finish(figure, title, handles)


def _spread(values: Array) -> float:
    """Return the third over the first quartile; 3 for values that are uniform from 0."""
    first, third = np.quantile(values, [0.25, 0.75])
    return float(third / first)


def _points(ax: Axes, values: pd.Series, y: Array, colours: Array) -> None:
    levels = sorted(map(str, values.unique())) if is_text(values) else []
    x = np.array([levels.index(str(text)) for text in values]) if levels else values.to_numpy()
    places = np.unique(x[np.isfinite(x)])
    if levels or 1 < len(places) <= _MAX_LEVELS:  # points beside each other, not on each other
        gap = np.diff(places).min(initial=1) if levels else np.diff(places).min()
        x = x + np.random.default_rng(0).uniform(-0.25, 0.25, len(values)) * gap
    size = float(np.clip(200 / np.sqrt(max(len(y), 1)), 4, 30))
    # Pixels, as thousands of vector points make a page slow.
    ax.scatter(
        x, y, s=size, c=colours, alpha=0.5 if size < 10 else 0.8, linewidths=0, rasterized=True
    )
    scale(ax, "y", y[np.isfinite(y)])
    if levels:
        names = list(map(in_print, levels))
        ax.set_xticks(range(len(levels)), names, rotation=30, ha="right", fontsize=7)
        ax.set_xlim(-0.5, len(levels) - 0.5)
    else:
        if len(places) > _MAX_LEVELS and places[0] > 0 and _spread(places) > 5:
            ax.set_xscale("log")
            plain_numbers(ax.xaxis)
        else:
            ax.locator_params(axis="x", nbins=4)
        ax.tick_params(axis="x", labelsize=8)


def influential(table: StudyTable, outcomes: Iterable[str]) -> list[str]:
    """Return the MAX_PANELS inputs that explain most of any outcome within a group.

    Args:
        table: the table of the study.
        outcomes: outcomes or families.
    """
    shares = [sensitivity(part, x)["value"] for x in outcomes for part in table.groups.values()]
    best = pandas().concat(shares or [pandas().Series(dtype=float)], axis=1).max(axis=1).fillna(0)
    return [*best.sort_values(ascending=False, kind="stable").index[:MAX_PANELS]]


# --- parts of all figures --------------------------------------------------------------------


def _members(table: StudyTable, family: str) -> list[str]:
    """Return the outcomes of a family, one for each joint, or the family itself without joints."""
    return [f"{family}_{k}" for k in table.joints(family)] or [family]


def outcome_label(table: StudyTable, name: str) -> str:
    """Return the label of an outcome's axis, with the joint."""
    metric = metric_of(name)
    title = ", ".join(filter(None, [metric.title, table.place(name)]))
    return metric._replace(title=title).label


def _broken(label: str) -> str:
    """Break a label into short lines for a low panel, but not its unit."""
    words, bracket, unit = label.partition(" [")
    lines = [line for part in re.split(r"(?<=,) ", words) for line in textwrap.wrap(part, 18)]
    return "\n".join([*lines, f"[{unit}"] if bracket else lines)


def _at_dots(name: str) -> str:
    """Break the name of an input at dots into lines as wide as a panel."""
    lines = [""]
    for part in re.split(r"(?<=\.)|(?= \[)", name):
        if lines[-1] and len(lines[-1]) + len(part) > 24:
            lines.append("")
        lines[-1] += part
    return "\n".join(lines)


def scale(ax: Axes, axis: Literal["x", "y"], values: Array | pd.Series) -> None:
    """Make an axis logarithmic if its values span more than a factor of 30."""
    if len(values) and values.min() > 0 and values.max() > _LOG_RATIO * values.min():
        getattr(ax, f"set_{axis}scale")("log")
        ticks = getattr(ax, f"{axis}axis")
        if values.max() < 100 * values.min():  # too few powers of ten
            ticks.set_major_locator(LogLocator(subs=(1, 2, 5), numticks=12))
        plain_numbers(ticks)
    elif axis == "x":
        _few_ticks(ax)


def _few_ticks(ax: Axes) -> None:
    """Set few ticks, as long numbers and those of neighbouring panels need room."""
    ax.locator_params(axis="x", nbins=4, prune="both")
    ax.ticklabel_format(axis="x", useOffset=False)


def group_handles(groups: Iterable[str], *, lines: bool = True) -> list[Line2D]:
    """Make the legend's entries of groups, as lines or as markers."""
    labels = list(groups)
    handles = []
    for label, look in zip(labels, looks_of(labels), strict=True):
        own: dict[str, Any] = {"linestyle": look.dashes}
        if not lines:
            own = {"linestyle": "", "marker": look.marker}
        handles.append(Line2D([], [], color=look.colour, label=in_print(label), **own))
    return handles
