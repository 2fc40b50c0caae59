"""Figures of a study; each function returns a matplotlib Figure.

Groups are the levels of a text input, such as the controller; each has its colour, marker and line
style, the same in all figures.
"""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterable, Sequence
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator
from numpy.typing import NDArray

from sdt_drake.analysis.plots import PALETTE, plain_numbers, style
from sdt_drake.errors import InputError
from sdt_drake.studies.pareto import pareto
from sdt_drake.studies.quantities import quantity_of
from sdt_drake.studies.summary import Swing, sensitivity, tornado, usable, values_of
from sdt_drake.studies.table import StudyTable, is_text, levels_of
from sdt_drake.studies.verdicts import Verdict, front_of

Array = NDArray[np.float64]

WHOLE = "the whole device"

LOW, HIGH = PALETTE[5], PALETTE[1]

MOST_PANELS = 6
"""Inputs and outcomes of a scatter matrix."""

MOST_POINTS = 2000
"""Of a scatter matrix."""

_MOST_BARS = 6
_MARKED = ((50, "o"), (95, "^"), (99, "s"))
_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
_DASHES = ("-", "--", "-.", ":")
_WIDE = 30  # largest over smallest value, from which on the axis is logarithmic


def distributions(
    title: str, table: StudyTable, families: Sequence[str], by: str | None = None
) -> Figure:
    """Share of the runs below a value: a row for each outcome, a panel for each joint.

    Args:
        title: of the figure.
        table: of the study.
        families: of outcomes.
        by: text input; a line for each of its levels.

    Raises:
        InputError: for an unknown outcome or input.
    """
    parts = table.split(by)
    names = [_members(table, family) for family in families]
    with style():
        figure, axes = _grid(len(families), max(map(len, names)), height=1.75, bottom=0.95)
        for row, family, members in zip(axes, families, names, strict=True):
            for ax, name in zip(row, members, strict=False):
                _distribution(ax, parts, name)
                _scale(ax, "x", _shown(table, name))
                ax.set_xlabel(quantity_of(family).label)
            for ax in row[len(members) :]:
                ax.set_axis_off()
            row[0].set_ylabel("runs below [%]")
        handles = _handles(parts) + [
            Line2D([], [], color="0.3", linestyle="", marker=marker, label=f"{percent} %")
            for percent, marker in _MARKED
        ]
        _finish(figure, title, handles)
    return figure


def _distribution(ax: Axes, parts: dict[str, StudyTable], name: str) -> None:
    at = np.linspace(0, 100, 401)  # enough to look smooth; thousands of points make large files
    for i, part in enumerate(parts.values()):
        values = _shown(part, name)
        if not len(values):
            continue
        colour, _, dashes = _look(i)
        ax.plot(np.percentile(values, at), at, dashes, color=colour)
        for percent, marker in _MARKED:
            at_percent = np.percentile(values, percent)
            ax.plot(at_percent, percent, marker, color=colour, markersize=4, clip_on=False)
    ax.set(ylim=(0, 102), yticks=(0, 25, 50, 75, 95))
    ax.set_title(next(iter(parts.values())).place(name) or WHOLE, loc="left")


def tornado_figure(title: str, table: StudyTable, family: str, by: str | None = None) -> Figure:
    """What moves the mean of an outcome: a row for each level of `by`, a panel for each joint.

    The inputs of a row are in one order: those that move its joints most are at the top.

    Args:
        title, table: as in `distributions`.
        family: of the outcome.
        by: text input.

    Raises:
        InputError: for an unknown outcome or input, or if nothing varies.
    """
    names = _members(table, family)
    parts = table.split(by)
    rows = {level: [tornado(part, name) for name in names] for level, part in parts.items()}
    rows = {level: swings for level, swings in rows.items() if any(swings)}
    if not rows:
        raise InputError(f"study '{table.name}': no input varies, expected one that does")
    bars = min(_MOST_BARS, max(len(swings) for row in rows.values() for swings in row))
    with style():
        figure, axes = _grid(
            len(rows), len(names), height=0.35 + 0.22 * bars, across=0.2, down=0.55, bottom=0.95,
            left=0.35 + 0.068 * max(map(len, table.inputs)),
        )  # fmt: skip
        for row, (level, swings) in zip(axes, rows.items(), strict=True):
            order = _ordered(swings)[:bars]
            for ax, name, own in zip(row, names, swings, strict=True):
                _bars(ax, order, own, name, _shown(parts[level], name))
                ax.set_title(table.place(name) or WHOLE, loc="left")
                ax.tick_params(labelleft=ax is row[0])
            if by:
                row[0].set_title(f"{level}, {row[0].get_title(loc='left')}", loc="left")
        for ax in axes[-1]:
            ax.set_xlabel(quantity_of(family)._replace(title="mean").label)
        handles = [
            Patch(color=LOW, label="lowest fifth of the input, or lowest level"),
            Patch(color=HIGH, label="highest fifth, or highest level"),
            Line2D([], [], color="0.2", label="mean of all"),
        ]
        _finish(figure, title, handles)
    return figure


def _ordered(swings: Sequence[Sequence[Swing]]) -> list[str]:
    """Names of the inputs; those with the largest sum of relative swings first."""
    total: dict[str, float] = {}
    for own in swings:
        widest = max((swing.width for swing in own), default=0) or 1
        for swing in own:
            total[swing.name] = total.get(swing.name, 0) + swing.width / widest
    return sorted(total, key=lambda name: -total[name])


def _bars(
    ax: Axes, order: Sequence[str], swings: Sequence[Swing], name: str, values: Array
) -> None:
    factor, mean = quantity_of(name).factor, values.mean() if len(values) else np.nan
    own = {swing.name: swing for swing in swings}
    for at, key in enumerate(order):
        if key not in own:
            continue
        ends = (own[key].low, LOW, own[key].low_level), (own[key].high, HIGH, own[key].high_level)
        shown = [(factor * value, colour, level) for value, colour, level in ends]
        # The shorter one last: both may be on one side.
        for value, colour, level in sorted(shown, key=lambda end: -abs(end[0] - mean)):
            ax.barh(at, value - mean, 0.7, left=mean, color=colour)
            if level:
                _name_level(ax, value, at, level, left=value < mean)
    ax.axvline(mean, color="0.2", linewidth=0.9)
    ax.set_yticks(range(len(order)), order)
    ax.set_ylim(len(order) - 0.4, -0.6)  # the first at the top
    ax.margins(x=0.4 if any(swing.low_level for swing in swings) else 0.1)  # room for the levels
    ax.grid(axis="y", visible=False)
    ax.set_axisbelow(True)
    _few_ticks(ax)


def _name_level(ax: Axes, x: float, y: float, level: str, *, left: bool) -> None:
    ax.annotate(
        level,
        (x, y),
        xytext=(-2 if left else 2, 0),
        textcoords="offset points",
        horizontalalignment="right" if left else "left",
        verticalalignment="center",
        fontsize=6.5,
        clip_on=False,
    )


def scatter_matrix(
    title: str,
    table: StudyTable,
    inputs: Sequence[str],
    outcomes: Sequence[str],
    by: str | None = None,
) -> Figure:
    """Outcomes over inputs, a point for each run.

    Of more than MOST_POINTS runs some are left out, always the same ones of a table.

    Args:
        title, table: as in `distributions`.
        inputs: columns, at most MOST_PANELS.
        outcomes: rows, at most MOST_PANELS; a family for the worst joint of it.
        by: text input; a colour for each of its levels.

    Raises:
        InputError: for an unknown outcome or input, none or too many of them.
    """
    for what, names in (("inputs", inputs), ("outcomes", outcomes)):
        if not 1 <= len(names) <= MOST_PANELS:
            raise InputError(f"scatter matrix: {len(names)} {what}, expected 1 to {MOST_PANELS}")
    runs = table.select(_some(table))
    parts = table.split(by)
    colours = _point_colours(runs, by, list(parts))
    with style():
        figure, axes = _grid(
            len(outcomes), len(inputs), width=1.95, height=1.5, left=1.2, bottom=1.2,
            across=0.25, down=0.15, share_x=True,
        )  # fmt: skip
        for row, outcome in zip(axes, outcomes, strict=True):
            y = quantity_of(outcome).factor * runs.outcome(outcome)
            for ax, name in zip(row, inputs, strict=True):
                _points(ax, runs.checked_input(name), y, colours)
                ax.tick_params(labelleft=ax is row[0])
            row[0].set_ylabel(_broken(_label(table, outcome)), fontsize=8)
        for ax, name in zip(axes[-1], inputs, strict=True):
            ax.set_xlabel(_at_dots(name), fontsize=8)
        figure.align_ylabels(axes[:, 0])
        _finish(figure, title, _handles(parts, lines=False) if by else [])
    return figure


def _some(table: StudyTable) -> NDArray[np.int64]:
    """Indices of runs that are ok, MOST_POINTS of them at most.

    In random order, so that no group hides another, nor falls out of step.
    """
    order = np.random.default_rng(0).permutation(len(table))
    return order[table.ok[order]][:MOST_POINTS]


def _points(ax: Axes, values: NDArray, y: Array, colours: NDArray) -> None:
    x, levels = _places(values)
    # Pixels: as drawings, thousands of points would make a page that no one can scroll.
    ax.scatter(x, y, s=4, c=colours, alpha=0.5, linewidths=0, rasterized=True)
    _scale(ax, "y", y[np.isfinite(y)])
    if levels:
        ax.set_xticks(range(len(levels)), levels, rotation=30, ha="right", fontsize=7)
        ax.set_xlim(-0.5, len(levels) - 0.5)
    else:
        ax.locator_params(axis="x", nbins=4)
        ax.tick_params(axis="x", labelsize=8)


def _point_colours(table: StudyTable, by: str | None, levels: Sequence[str]) -> NDArray:
    """Of each run, shape (N, 4)."""
    looks = np.array([to_rgba(_look(i)[0]) for i in range(len(levels))])
    if by is None:
        return np.repeat(looks, len(table), axis=0)
    return looks[[levels.index(str(text)) for text in table.inputs[by]]]


def _places(values: NDArray) -> tuple[Array, list[str]]:
    """Where the points of an input are, and the names of its levels; none for numbers."""
    if not is_text(values):
        return values, []
    levels = sorted(levels_of(values))
    # Beside each other instead of on each other.
    apart = np.random.default_rng(0).uniform(-0.3, 0.3, len(values))
    return np.array([levels.index(str(text)) for text in values]) + apart, levels


def pareto_figure(
    title: str, table: StudyTable, cost: str, error: str, by: str | None = None
) -> Figure:
    """Error over cost: the runs that no other beats in both, and the rest in grey.

    Args:
        title, table: as in `distributions`.
        cost, error: outcomes; a family for the worst joint of it.
        by: text input; a colour and a marker for each of its levels.

    Raises:
        InputError: for an unknown outcome or input, or if no run has both outcomes.
    """
    runs = table.select(usable(table, cost, error))
    if not len(runs):
        raise InputError(
            f"study '{table.name}': no run that is ok has {cost} and {error}, expected one"
        )
    x, y = (quantity_of(name).factor * runs.outcome(name) for name in (cost, error))
    front = np.asarray(pareto(x, y), dtype=bool)
    groups = runs.inputs[by].astype(str) if by else np.full(len(runs), "")
    with style():
        figure, ((ax,),) = _grid(1, 1, width=7.2, height=4.2, bottom=0.95)
        line = front.nonzero()[0][np.argsort(x[front], kind="stable")]
        ax.plot(x[line], y[line], color="0.2", linewidth=1, zorder=2)
        parts = table.split(by)
        for i, level in enumerate(parts):
            colour, marker, _ = _look(i)
            mine = groups == level if by else np.full(len(runs), True)
            rest, best = mine & ~front, mine & front
            grey = {"color": "0.75", "s": 12, "linewidths": 0, "rasterized": True, "zorder": 1}
            ax.scatter(x[rest], y[rest], marker=marker, **grey)
            ax.scatter(
                x[best], y[best], marker=marker, color=colour, edgecolors="0.2", s=34,
                linewidths=0.5, zorder=3,
            )  # fmt: skip
        _scale(ax, "x", x)
        _scale(ax, "y", y)
        ax.set_xlabel(_label(table, cost))
        ax.set_ylabel(_label(table, error))
        handles = _handles(parts, lines=False) if by else []
        handles += [
            Line2D([], [], color="0.2", label="no other run is better in both"),
            Line2D([], [], color="0.75", linestyle="", marker="o", label="another one is"),
        ]
        _finish(figure, title, handles)
    return figure


def sizing_front(title: str, verdicts: Sequence[Verdict]) -> Figure:
    """Speed error over motor mass: a panel for each controller, candidates that keep all
    requirements filled, and the Pareto front of each as a line.

    Args:
        title: of the figure.
        verdicts: of `verdicts.judge`.
    """
    labels = list(dict.fromkeys(verdict.controller for verdict in verdicts))
    with style():
        figure, (axes,) = _grid(1, len(labels), width=2.6, height=2.6, across=0.6, bottom=0.95)
        for i, (ax, label) in enumerate(zip(axes, labels, strict=True)):
            own = [v for v in verdicts if v.controller == label and not math.isnan(v.error)]
            colour, marker, _ = _look(i)
            for keeps, face in ((False, "none"), (True, colour)):
                some = [v for v in own if v.feasible == keeps]
                ax.scatter(
                    [v.mass for v in some], [v.error for v in some], marker=marker, s=22,
                    facecolors=face, edgecolors=colour if keeps else "0.65", linewidths=0.8,
                )  # fmt: skip
            front = [v for v, best in zip(own, front_of(own), strict=True) if best]
            front.sort(key=lambda v: (v.mass, -v.error))
            ax.plot([v.mass for v in front], [v.error for v in front], color="0.2", linewidth=1)
            ax.set_title(label, loc="left")
            ax.set_xlabel("mass of all motors [kg]")
            ax.set_ylim(bottom=0)
        axes[0].set_ylabel("largest speed error [rad/s]")
        handles = [
            Line2D([], [], color="0.2", linestyle="", marker="o", label="keeps all requirements"),
            Line2D(
                [], [], color="0.65", linestyle="", marker="o", markerfacecolor="none",
                label="misses one",
            ),
            Line2D([], [], color="0.2", label="no other is lighter and better"),
        ]  # fmt: skip
        _finish(figure, title, handles)
    return figure


def influential(
    table: StudyTable, outcomes: Iterable[str], by: str | None = None, most: int = MOST_PANELS
) -> list[str]:
    """Names of the inputs that explain most of any of these outcomes, within the groups of `by`.

    Args:
        table, by: as in `distributions`.
        outcomes: or families of them.
        most: how many.

    Raises:
        InputError: for an unknown outcome or input.
    """
    best: dict[str, float] = {}
    for outcome in outcomes:
        for part in table.split(by).values():
            for name, share in sensitivity(part, outcome).items():
                best[name] = max(best.get(name, 0), np.nan_to_num(share))
    return sorted(best, key=lambda name: -best[name])[:most]


# --- what they share -------------------------------------------------------------------------


def _members(table: StudyTable, family: str) -> list[str]:
    """The outcomes of a family, one for each joint; itself if it is of the whole device.

    Raises:
        InputError: for an unknown outcome.
    """
    table.outcome(family)
    return [f"{family}_{k}" for k in table.joints(family)] or [family]


def _shown(table: StudyTable, name: str) -> Array:
    """An outcome of the runs that have it, in the unit of the figures."""
    return quantity_of(name).factor * values_of(table, name)


def _label(table: StudyTable, name: str) -> str:
    """The label of an outcome's axis, which says which joint."""
    quantity, place = quantity_of(name), table.place(name)
    return quantity._replace(title=f"{quantity.title}, {place}").label if place else quantity.label


def _broken(label: str) -> str:
    """In short lines, for a low panel; the unit stays in one piece."""
    words, bracket, unit = label.partition(" [")
    lines = [line for part in re.split(r"(?<=,) ", words) for line in textwrap.wrap(part, 18)]
    return "\n".join([*lines, f"[{unit}"] if bracket else lines)


def _at_dots(name: str) -> str:
    """The name of an input in lines as wide as a panel at most."""
    lines = [""]
    for part in re.split(r"(?<=\.)", name):
        if lines[-1] and len(lines[-1]) + len(part) > 24:
            lines.append("")
        lines[-1] += part
    return "\n".join(lines)


def _scale(ax: Axes, axis: Literal["x", "y"], values: Array) -> None:
    """A logarithmic axis where the values need one."""
    if len(values) and values.min() > 0 and values.max() > _WIDE * values.min():
        getattr(ax, f"set_{axis}scale")("log")
        ticks = getattr(ax, f"{axis}axis")
        if values.max() < 100 * values.min():  # too few powers of ten
            ticks.set_major_locator(LogLocator(subs=(1, 2, 5), numticks=12))
        plain_numbers(ticks)
    elif axis == "x":
        _few_ticks(ax)


def _few_ticks(ax: Axes) -> None:
    """Room for numbers of many digits."""
    ax.locator_params(axis="x", nbins=3)
    ax.ticklabel_format(axis="x", useOffset=False)


def _look(i: int) -> tuple[str, str, str]:
    """Colour, marker and line style of group i."""
    return (
        PALETTE[i % len(PALETTE)],
        _MARKERS[i % len(_MARKERS)],
        _DASHES[i % len(_DASHES)],
    )


def _handles(groups: Iterable[str], *, lines: bool = True) -> list[Line2D]:
    """Of the legend, as lines or as markers."""
    handles = []
    for i, name in enumerate(groups):
        colour, marker, dashes = _look(i)
        look = {"linestyle": dashes} if lines else {"linestyle": "", "marker": marker}
        handles.append(Line2D([], [], color=colour, label=name, **look))
    return handles


def _grid(
    rows: int,
    columns: int,
    *,
    width: float = 2.35,
    height: float,
    left: float = 0.85,
    bottom: float,
    across: float = 0.35,
    down: float = 0.75,
    share_x: bool = False,
) -> tuple[Figure, NDArray]:
    """A figure and its axes; all sizes and gaps are fixed [inch], of the panels and around them."""
    right, top = 0.2, 0.65
    whole = left + columns * width + (columns - 1) * across + right
    high = top + rows * height + (rows - 1) * down + bottom
    figure = Figure(figsize=(max(whole, 6.5), high))
    axes = figure.subplots(
        rows,
        columns,
        squeeze=False,
        sharex="col" if share_x else False,
        gridspec_kw={
            "left": left / whole,
            "right": 1 - right / whole,
            "top": 1 - top / high,
            "bottom": bottom / high,
            "wspace": across / width,
            "hspace": down / height,
        },
    )
    return figure, axes


def _finish(figure: Figure, title: str, handles: Sequence) -> None:
    """Title above, legend below."""
    figure.suptitle(title, y=1 - 0.12 / figure.get_figheight(), verticalalignment="top")
    if handles:
        # About as wide as its entries are side by side [inch].
        wide = sum(0.6 + 0.068 * len(handle.get_label()) for handle in handles)
        rows = math.ceil(wide / figure.get_figwidth())
        columns = math.ceil(len(handles) / rows)
        figure.legend(handles=handles, loc="lower center", ncols=columns)
