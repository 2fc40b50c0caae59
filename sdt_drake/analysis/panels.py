"""Panels of lines over a common axis, and their picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from sdt_drake.analysis.style import Look, finish, grid, style
from sdt_drake.arrays import Array

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
    """

    title: str
    x_label: str
    y_label: str
    x: Array
    lines: Sequence[Line]
    marked: NDArray[np.bool_] | None = None
    marked_label: str = ""


def picture(title: str, columns: Sequence[Sequence[Panel]]) -> Figure:
    """Columns of as many panels each; those of a column share their axis."""
    rows = len(columns[0])
    width = 9.05 if len(columns) == 1 else 3.4
    with style():
        figure, axes = grid(rows, len(columns), panel=(width, 1.55), gaps=(0.9, 0.35), sharex="col")
        for column, panels in zip(axes.T, columns, strict=True):
            for ax, panel in zip(column, panels, strict=True):
                _draw(ax, panel)
            column[-1].set_xlabel(panels[-1].x_label)
        finish(figure, title)
    return figure


def _draw(ax: Axes, panel: Panel) -> None:
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
    ax.margins(x=0)


def shade(ax: Axes, x: Array, where: NDArray[np.bool_], label: str) -> None:
    """Grey where a condition holds, from bottom to top."""
    low, high = ax.get_ylim()
    ax.fill_between(
        x, low, high, where=where, label=label, color="0.5", alpha=0.16, linewidth=0, zorder=0
    )
    ax.set_ylim(low, high)
