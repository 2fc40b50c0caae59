"""Panels of lines over a common axis, drawn as pictures or as interactive plots of a page."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from numpy.typing import NDArray

from sdt_drake.io.arrays import Array, Index
from sdt_drake.show.style import Look, Picture, finish, grid, joint_title, style

_NAME = 0.15  # height of a line's name [inch]

_MAX_LABEL = 22  # letters beside a panel

MAX_SAMPLES = 10_000
"""Largest number of samples of a panel on a page."""

LIMIT = Look("0.6")
"""The look of limits."""


@dataclass(frozen=True, eq=False)
class Line:
    """A line of a panel."""

    label: str
    look: Look
    values: Array
    """Samples over the axis of the panel, shape (N,)."""
    dots: bool = False
    """Draw separate dots in place of a line."""


@dataclass(frozen=True, eq=False)
class Panel:
    """Lines over one axis with one scale."""

    title: str
    """The title above the panel; "" for none."""
    x_label: str
    """The label of the axis, with unit."""
    y_label: str
    x: Array
    """Values that never decrease, shape (N,)."""
    lines: Sequence[Line]
    marked: NDArray[np.bool_] | None = None
    """Samples with a grey ground, shape (N,)."""
    marked_label: str = ""
    """The meaning of the grey ground."""
    note: str = ""
    """A text above the panel on the right, in pictures only."""

    def kept(self) -> Index:
        """Return the rows that a page shows: all, or at most MAX_SAMPLES that keep every peak.

        Of each group of rows, those with the least and the largest value of each line are kept.
        """
        n = len(self.x)
        if n <= MAX_SAMPLES:
            return np.arange(n)
        per_run = -(-n * (2 * len(self.lines) + 1) // MAX_SAMPLES)
        starts = np.arange(0, n, per_run)
        rows = [starts, np.array([n - 1])]
        for line in self.lines:
            runs = np.pad(line.values, (0, -n % per_run), mode="edge").reshape(-1, per_run)
            rows += [starts + runs.argmin(axis=1), starts + runs.argmax(axis=1)]
        return np.unique(np.minimum(np.concatenate(rows), n - 1))

    def spans(self) -> list[tuple[float, float]]:
        """Return the start and the end of each marked interval of x."""
        if self.marked is None:
            return []
        turns = np.flatnonzero(np.diff(np.concatenate([[False], self.marked, [False]])))
        return [(float(self.x[i]), float(self.x[j - 1])) for i, j in turns.reshape(-1, 2)]


Lines = Sequence[tuple[str, Look, Array]]
"""Lines of several joints: label, look, and samples of shape (N, n)."""


def over_time(
    y_label: str,
    time: Array,
    lines: Lines,
    joint_names: Sequence[str] = (),
    *,
    marked: NDArray[np.bool_] | None = None,
    marked_label: str = "",
    notes: Sequence[str] = (),
) -> list[Panel]:
    """Make a panel of signals over time for each joint.

    Args:
        y_label: label of the axis, with unit.
        time: samples [s], shape (N,).
        lines: lines with a column per joint.
        joint_names: n names for the titles; () for panels beside others with titles.
        marked: samples with a grey ground, shape (N, n) or (N, 1).
        marked_label: the meaning of the grey ground.
        notes: n texts above the panels on the right.
    """
    n = lines[0][2].shape[1]
    titles = [joint_title(k, name) for k, name in enumerate(joint_names)] or [""] * n
    grounds = [None] * n if marked is None else np.broadcast_to(marked, (len(time), n)).T
    panels = []
    for title, ground, note, k in zip(titles, grounds, notes or [""] * n, range(n), strict=True):
        own = [Line(label, look, values[:, k]) for label, look, values in lines]
        panels.append(Panel(title, "time [s]", y_label, time, own, ground, marked_label, note))
    return panels


def picture(title: str, columns: Sequence[Sequence[Panel]], *, width: float = 3.4) -> Picture:
    """Draw columns with equal numbers of panels; the panels of a column share their time axis.

    Args:
        title: title of the figure.
        columns: panels from top to bottom.
        width: width of a column [inch]; a single column is 9.05 inches wide.
    """
    rows = len(columns[0])
    width = 9.05 if len(columns) == 1 else width
    with style():
        figure, axes = grid(rows, len(columns), panel=(width, 1.55), gaps=(0.9, 0.35), sharex="col")
        for column, panels in zip(axes.T, columns, strict=True):
            for ax, panel in zip(column, panels, strict=True):
                draw(ax, panel)
            column[-1].set_xlabel(panels[-1].x_label)
            figure.align_ylabels(column)
        figure.columns = columns
        return finish(figure, title)


def draw(ax: Axes, panel: Panel) -> None:
    """Draw a panel into axes, without the label of x."""
    for line in panel.lines:
        dashes, marker = ("", ".") if line.dots else (line.look.dashes, "")
        ax.plot(
            panel.x,
            line.values,
            linestyle=dashes,
            marker=marker,
            markersize=2,
            color=line.look.colour,
            label=line.label,
        )
    if panel.marked is not None and panel.marked.any():
        shade(ax, panel.x, panel.marked, panel.marked_label)
    label, side = panel.y_label, ""
    if max(map(len, label.split("\n"))) > _MAX_LABEL:  # its side has no room beside the panel
        label, _, side = label.partition(", ")
    ax.set_ylabel(label)
    ax.set_title(panel.title, loc="left", fontweight="bold")
    ax.set_title(", ".join(filter(None, [side, panel.note])), loc="right")
    ax.ticklabel_format(axis="y", useOffset=False)
    ax.margins(x=0)


def label_lines(ax: Axes) -> None:
    """Write the name of each line beside its end, in its colour, in place of a legend.

    Names that would overlap are moved apart.
    """
    ax.autoscale_view()
    step = _NAME * ax.figure.dpi / ax.bbox.height
    to_axes = ax.transData + ax.transAxes.inverted()
    ends = []
    for line in ax.lines:
        y = to_axes.transform(line.get_xydata())[:, 1]
        if not str(line.get_label()).startswith("_"):
            # Lines that end at the same place are in the order of their means.
            ends.append((round(float(np.clip(y[-1], 0, 1)), 2), np.clip(y, 0, 1).mean(), line))
    ends.sort(key=lambda end: end[:2])
    places = [place for place, *_ in ends]
    for k in range(1, len(places)):
        places[k] = max(places[k], places[k - 1] + step)
    for k in reversed(range(len(places))):
        places[k] = min(places[k], 1 - (len(places) - 1 - k) * step)
    for place, (*_, line) in zip(places, ends, strict=True):
        ax.annotate(
            str(line.get_label()), (1, place), xytext=(5, 0), xycoords="axes fraction",
            textcoords="offset points", color=line.get_color(), fontsize=8, va="center",
        )  # fmt: skip


def shade(ax: Axes, x: Array, where: NDArray[np.bool_], label: str) -> None:
    """Draw a grey ground from bottom to top where a condition holds."""
    low, high = ax.get_ylim()
    ax.fill_between(
        x, low, high, where=where, label=label, color="0.5", alpha=0.16, linewidth=0, zorder=0
    )
    ax.set_ylim(low, high)


@dataclass(frozen=True, eq=False)
class Plots:
    """Plots that a page shows with zoom and values at the cursor, and Markdown as a picture."""

    columns: Sequence[Sequence[Panel]]
    """Columns with equal numbers of panels; those of a single column or row fill a page's width."""

    def data(self) -> dict[str, object]:
        """Return the data that plots.js draws."""
        arrays: dict[str, int] = {}  # an array is sent once, even if several panels show it

        def number(values: Array) -> int:
            text = base64.b64encode(values.astype("<f4").tobytes()).decode()
            return arrays.setdefault(text, len(arrays))

        panels = []
        beside = [(panel, row[0]) for row in zip(*self.columns, strict=True) for panel in row]
        for panel, first in beside:
            rows = panel.kept()
            lines = [
                {
                    "label": line.label.removeprefix("_"),
                    "colour": to_hex(line.look.colour),
                    "dash": line.look.dashes,
                    "dots": line.dots,
                    "values": number(line.values[rows]),
                }
                for line in panel.lines
            ]
            panels.append(
                {
                    "title": panel.title or first.title,
                    "note": panel.note,
                    "x_label": panel.x_label,
                    "y_label": panel.y_label,
                    "x": number(panel.x[rows]),
                    "lines": lines,
                    "marked": panel.spans(),
                }
            )
        columns = len(self.columns) if len(self.columns[0]) > 1 else 1
        return {"arrays": list(arrays), "panels": panels, "columns": columns}


@dataclass(frozen=True, eq=False)
class Stored:
    """The data of plots, from a file; their picture is a file, too."""

    content: dict[str, object]

    def data(self) -> dict[str, object]:
        """Return the data that plots.js draws."""
        return self.content
