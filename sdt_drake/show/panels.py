"""Panels of lines over a common axis: as a picture, and on a page as plots to zoom and read off."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from numpy.typing import NDArray

from sdt_drake.io.arrays import Array, Index
from sdt_drake.show.style import Look, finish, grid, joint_title, save, style

MOST = 10_000
"""Samples of a panel on a page."""

LIMIT = Look("0.6")
"""Of lines that may not be crossed."""


@dataclass(frozen=True, eq=False)
class Line:
    """Samples over the axis of a panel, shape (N,); `dots`: not joined."""

    label: str
    look: Look
    values: Array
    dots: bool = False


@dataclass(frozen=True, eq=False)
class Panel:
    """Lines with one scale.

    Attributes:
        title: above; "" for none.
        x_label, y_label: with units.
        x: never falling, shape (N,).
        lines: over x.
        marked: where x has a grey ground, shape (N,), and `marked_label`, why.
        note: above on the right, in pictures.
    """

    title: str
    x_label: str
    y_label: str
    x: Array
    lines: Sequence[Line]
    marked: NDArray[np.bool_] | None = None
    marked_label: str = ""
    note: str = ""

    def kept(self) -> Index:
        """Rows that a page gets: all, or, of more than MOST, those of each run of rows where any
        line is least or largest. So no peak is lost, and every point is a sample."""
        n = len(self.x)
        if n <= MOST:
            return np.arange(n)
        per_run = -(-n * (2 * len(self.lines) + 1) // MOST)
        starts = np.arange(0, n, per_run)
        rows = [starts, np.array([n - 1])]
        for line in self.lines:
            runs = np.pad(line.values, (0, -n % per_run), mode="edge").reshape(-1, per_run)
            rows += [starts + runs.argmin(axis=1), starts + runs.argmax(axis=1)]
        return np.unique(np.minimum(np.concatenate(rows), n - 1))

    def spans(self) -> list[tuple[float, float]]:
        """Ends of each stretch where x is marked."""
        if self.marked is None:
            return []
        turns = np.flatnonzero(np.diff(np.concatenate([[False], self.marked, [False]])))
        return [(float(self.x[i]), float(self.x[j - 1])) for i, j in turns.reshape(-1, 2)]


Lines = Sequence[tuple[str, Look, Array]]
"""Of several joints: label, look, and samples of shape (N, n)."""


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
    """Panels of signals over time, one for each joint.

    Args:
        y_label: with unit.
        time: [s], shape (N,).
        lines: in each panel, those of its joint.
        joint_names: n names, of the titles; none for panels beside others that have them.
        marked: where the ground is grey, shape (N, n) or (N, 1), and `marked_label`, why.
        notes: n texts above on the right.
    """
    n = lines[0][2].shape[1]
    titles = [joint_title(k, name) for k, name in enumerate(joint_names)] or [""] * n
    grounds = [None] * n if marked is None else np.broadcast_to(marked, (len(time), n)).T
    panels = []
    for title, ground, note, k in zip(titles, grounds, notes or [""] * n, range(n), strict=True):
        own = [Line(label, look, values[:, k]) for label, look, values in lines]
        panels.append(Panel(title, "time [s]", y_label, time, own, ground, marked_label, note))
    return panels


def picture(title: str, columns: Sequence[Sequence[Panel]], *, width: float = 3.4) -> Figure:
    """Columns of as many panels each, `width` [inch], one alone wider; those of a column share
    their axis."""
    rows = len(columns[0])
    width = 9.05 if len(columns) == 1 else width
    with style():
        figure, axes = grid(rows, len(columns), panel=(width, 1.55), gaps=(0.9, 0.35), sharex="col")
        for column, panels in zip(axes.T, columns, strict=True):
            for ax, panel in zip(column, panels, strict=True):
                draw(ax, panel)
            column[-1].set_xlabel(panels[-1].x_label)
        return finish(figure, title)


def draw(ax: Axes, panel: Panel) -> None:
    """Draw a panel into axes: all but the label of its x."""
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
    ax.set_ylabel(panel.y_label)
    ax.set_title(panel.title, loc="left", fontweight="bold")
    ax.set_title(panel.note, loc="right")
    ax.ticklabel_format(axis="y", useOffset=False)
    ax.margins(x=0)


def shade(ax: Axes, x: Array, where: NDArray[np.bool_], label: str) -> None:
    """Grey where a condition holds, from bottom to top."""
    low, high = ax.get_ylim()
    ax.fill_between(
        x, low, high, where=where, label=label, color="0.5", alpha=0.16, linewidth=0, zorder=0
    )
    ax.set_ylim(low, high)


@dataclass(frozen=True, eq=False)
class Plots:
    """Columns of as many panels each: on a page to zoom and read off, in this order and as wide as
    there is room; in Markdown their picture."""

    columns: Sequence[Sequence[Panel]]

    def save_picture(self, png: Path) -> None:
        """Write the picture that stands for the panels in Markdown."""
        save(picture("", self.columns), png)

    def data(self) -> dict[str, object]:
        """What plots.js draws."""
        arrays: dict[str, int] = {}  # each is sent once, however many panels show it

        def number(values: Array) -> int:
            text = base64.b64encode(values.astype("<f4").tobytes()).decode()
            return arrays.setdefault(text, len(arrays))

        panels = []
        for panel in (panel for column in self.columns for panel in column):
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
                    "title": panel.title,
                    "x_label": panel.x_label,
                    "y_label": panel.y_label,
                    "x": number(panel.x[rows]),
                    "lines": lines,
                    "marked": panel.spans(),
                }
            )
        return {"arrays": list(arrays), "panels": panels}
