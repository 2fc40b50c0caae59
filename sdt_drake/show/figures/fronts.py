"""Figures of designs: error over cost."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from sdt_drake.analysis.metrics import METRICS, metric_of
from sdt_drake.run.options import in_print
from sdt_drake.show.figures.studies import BOTTOM, group_handles, outcome_label, scale
from sdt_drake.show.style import Look, finish, grid, looks_of, style
from sdt_drake.studies.table import ALL_RUNS, StudyTable, pareto
from sdt_drake.studies.verdicts import Verdict, front_of

_RING: dict[str, Any] = {
    "color": "0.2", "marker": "o", "markersize": 9, "markerfacecolor": "none",
}  # fmt: skip


def pareto_figure(title: str, table: StudyTable, cost: str, error: str) -> Figure:
    """Draw error over cost: the Pareto front in colour, all other designs in grey.

    Args:
        title: title of the figure.
        table: the table of a study with `choices`.
        cost: outcome on the x axis. A family stands for its worst joint; a design counts with the
            largest value of its runs.
        error: outcome on the y axis, in the same form.
    """
    designs = table.designs(cost, error)
    x, y = (metric_of(name).factor * designs[name].to_numpy() for name in (cost, error))
    front = pareto(x, y)
    levels, groups = [ALL_RUNS], np.full(len(designs), ALL_RUNS)
    if has_groups := table.by in (table.choices or ()):  # else a design has runs of several groups
        levels, groups = list(table.groups), table.group[designs.index].to_numpy()
    with style():
        figure, ((ax,),) = grid(1, 1, panel=(7.2, 4.2), left=0.85, bottom=BOTTOM)
        line = front.nonzero()[0][np.argsort(x[front], kind="stable")]
        ax.plot(x[line], y[line], color="0.2", linewidth=1, zorder=2)
        grey = {"color": "0.75", "s": 12, "linewidths": 0, "rasterized": True, "zorder": 1}
        bold = {"edgecolors": "0.2", "s": 34, "linewidths": 0.5, "zorder": 3}
        for level, look in zip(levels, looks_of(levels), strict=True):
            mine = groups == level
            rest, best = mine & ~front, mine & front
            ax.scatter(x[rest], y[rest], marker=look.marker, **grey)
            ax.scatter(x[best], y[best], marker=look.marker, color=look.colour, **bold)
        scale(ax, "x", x)
        scale(ax, "y", y)
        ax.set_xlabel(outcome_label(table, cost))
        ax.set_ylabel(outcome_label(table, error))
        handles = group_handles(levels, lines=False) if has_groups else []
        handles += [
            Line2D([], [], color="0.2", label="no other design is better"),
            Line2D([], [], color="0.75", linestyle="", marker="o", label="another one is better"),
        ]
        return finish(figure, title, handles)


def sizing_front(title: str, verdicts: Sequence[Verdict]) -> Figure:
    """Draw speed error over motor mass, a panel for each controller.

    Candidates that meet all requirements are filled; their Pareto front is a line with rings.

    Args:
        title: title of the figure.
        verdicts: verdicts of `judge_candidates`.
    """
    labels = list(dict.fromkeys(verdict.controller for verdict in verdicts))
    with style():
        figure, (axes,) = grid(
            1, len(labels), panel=(2.6, 2.6), gaps=(0.25, 0), left=0.85, bottom=BOTTOM,
        )  # fmt: skip
        known = [v for v in verdicts if not math.isnan(v.error)]
        for ax, label, look in zip(axes, labels, looks_of(labels), strict=True):
            _candidates(ax, [v for v in known if v.controller == label], look)
            ax.set_title(in_print(label), loc="left")
            ax.set_xlabel("mass of all motors [kg]")
            ax.sharey(axes[0])
            ax.tick_params(labelleft=ax is axes[0])
        scale(axes[0], "y", np.array([v.error for v in known]))
        axes[0].set_ylabel(METRICS["max_abs_speed_error"].label)
        dot: dict[str, Any] = {"linestyle": "", "marker": "o"}
        handles = [
            Line2D([], [], color="0.2", label="meets all requirements", **dot),
            Line2D([], [], color="0.65", markerfacecolor="none", label="misses some", **dot),
            Line2D([], [], label="meets all, and no other is better", **_RING),
        ]
        return finish(figure, title, handles)


def _candidates(ax: Axes, verdicts: Sequence[Verdict], look: Look) -> None:
    for keeps, face, edge in ((False, "none", "0.65"), (True, look.colour, look.colour)):
        some = [v for v in verdicts if v.feasible == keeps]
        ax.scatter(
            [v.mass for v in some], [v.error for v in some], marker="o", s=22,
            facecolors=face, edgecolors=edge, linewidths=0.8,
        )  # fmt: skip
    front = [v for v, best in zip(verdicts, front_of(verdicts), strict=True) if best]
    front.sort(key=lambda v: (v.mass, -v.error))
    ax.plot([v.mass for v in front], [v.error for v in front], linewidth=1, **_RING)
