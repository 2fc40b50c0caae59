"""The figures of emergency stops over the time at which they begin."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from sdt_drake.analysis.stop_setting import FIGURES
from sdt_drake.analysis.stops import Stops
from sdt_drake.io.arguments import typed
from sdt_drake.show.panels import LIMIT, Line, Panel, picture
from sdt_drake.show.style import PALETTE, Look, joint_title


def stop_panels(stops: Stops) -> list[Panel]:
    """Make a panel for each figure that any stop has: a line for each joint, and the limit."""
    names = stops.setting.robot.joint_names
    limits = stops.setting.stopping.limits.by_figure(stops.setting.brakes)
    panels = []
    for name, values in stops.figures.items():
        metric, columns = FIGURES[name], values.reshape(len(values), -1).T
        if not np.any(values):
            continue
        lines = [
            Line(
                joint_title(k, names[k]) if len(columns) > 1 else metric.title,
                Look(PALETTE[k % len(PALETTE)]),
                metric.factor * np.where(np.isfinite(column), column, np.nan),
            )
            for k, column in enumerate(columns)
        ]
        for limit in np.unique(limits.get(name, np.inf)):
            if np.isfinite(limit):
                flat = np.full(len(values), metric.factor * limit)
                lines.append(Line("limit", LIMIT, flat))
        panels.append(Panel("", "time of the stop [s]", metric.label, stops.time, lines))
    return panels


@typed
def stops_figure(stops: Stops) -> Figure:
    """Draw the figures of all stops over the time at which each begins."""
    title = f"Stops {stops.summary().title}; no statement on safety"
    return picture(title, [stop_panels(stops)])
