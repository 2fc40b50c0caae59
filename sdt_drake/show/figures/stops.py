"""The figures of emergency stops over the time at which they begin."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from sdt_drake.analysis.stop_setting import FIGURES
from sdt_drake.analysis.stops import Stops
from sdt_drake.io.arguments import typed
from sdt_drake.io.arrays import Array
from sdt_drake.pilot.head import has_head, head_motion
from sdt_drake.run.stopping import Course
from sdt_drake.show.panels import LIMIT, Line, Panel, picture
from sdt_drake.show.style import PALETTE, Look, joint_title


def stop_panels(stops: Stops) -> list[Panel]:
    """Make a panel for each figure that any stop has: a line for each joint, and the limit."""
    limits = stops.setting.stopping.limits.by_figure(stops.setting.brakes)
    panels = []
    for name, values in stops.figures.items():
        metric = FIGURES[name]
        if np.any(values):
            shown = metric.factor * np.where(np.isfinite(values), values, np.nan)
            lines = _lines(stops, shown)
            for limit in np.unique(limits.get(name, np.inf)):
                if np.isfinite(limit):
                    flat = np.full(len(values), metric.factor * limit)
                    lines.append(Line("limit", LIMIT, flat))
            x, unit = "time of the stop [s]", f"[{metric.unit}]"
            panels.append(Panel(metric.title, x, unit, stops.time, lines))
    return panels


def course_panels(stops: Stops, course: Course) -> list[Panel]:
    """Make panels of a stop: speeds, torques of drives and brakes, and G at the head."""
    signals = {"speed [rad/s]": course.v, "torque [N m], joint side": course.torque}
    if has_head(robot := stops.setting.robot):
        head = head_motion(robot, course.q, course.v, course.vd)
        signals["resultant [G]"] = head.resultant_g
    x = "time since the stop began [s]"
    return [
        Panel("", x, label, course.time, _lines(stops, values)) for label, values in signals.items()
    ]


def _lines(stops: Stops, values: Array) -> list[Line]:
    """Return a line for each joint, shape (N, n), or one of the head or all joints, shape (N,)."""
    names = stops.setting.robot.joint_names if values.ndim > 1 else ()
    titles = [joint_title(k, name) for k, name in enumerate(names)] or ["head, or all joints"]
    columns = zip(titles, values.reshape(len(values), -1).T, strict=True)
    return [
        Line(name, Look(PALETTE[k % len(PALETTE)]), column)
        for k, (name, column) in enumerate(columns)
    ]


@typed
def stops_figure(stops: Stops) -> Figure:
    """Draw the figures of all stops over the time at which each begins."""
    title = f"Stops {stops.summary().title}; no statement on safety"
    return picture(title, [stop_panels(stops)])
