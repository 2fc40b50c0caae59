"""Sentences, tables and report of emergency stops."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from sdt_drake.analysis.stop_setting import FIGURES
from sdt_drake.analysis.stops import Stops, Worst
from sdt_drake.io.files import replacing_files
from sdt_drake.io.shown import by_joint
from sdt_drake.motion.trajectory import interpolated
from sdt_drake.run.stopping import SAMPLE
from sdt_drake.show.documents import MARKDOWN, REPORT, written
from sdt_drake.show.figures.stops import course_panels, stop_panels
from sdt_drake.show.panels import Plots
from sdt_drake.show.sections import Table, bullets
from sdt_drake.show.style import pictures
from sdt_drake.show.view3d.viewer import played

_TABLE, _RECORDING = "stops.csv", "3d.html"
FILES = (*pictures("instants"), *pictures("hardest"), _TABLE, _RECORDING, MARKDOWN, REPORT)
"""Names of all files of a report on stops."""

CAUTION = (
    "No statement on safety: computed with the brakes, ramps and limits of a file, for a model of "
    "the device."
)

_WHAT = (
    "power off at once, brakes close after their delay",
    "drives decelerate along a ramp, then brakes close and power goes off",
    "drives decelerate along a ramp, power stays on",
)


def stop_findings(stops: Stops) -> list[str]:
    """Return what happens in the stops as sentences: first the worst of all, then causes."""
    return [*_answers(stops), *_causes(stops)]


def _answers(stops: Stops) -> Iterator[str]:
    longest = _most(stops, "stopping_time")
    yield (
        f"Of {len(stops.time)} stops of category {stops.setting.stopping.category}, the longest "
        f"{'does not end' if np.isinf(longest.value) else f'takes {_value(longest)}'} "
        f"({_joint(stops, longest)}, stop at {longest.time:.3f} s)."
    )
    if "g" in stops.figures:
        g, onset = _most(stops, "g"), _most(stops, "g_onset")
        yield (
            f"The pilot feels up to {_value(g)} (stop at {g.time:.3f} s), with an onset of up to "
            f"{_value(onset)} (stop at {onset.time:.3f} s)."
        )
    limited = _limited(stops)
    beyond = [x for x in limited if not x.is_allowed]
    if beyond:
        texts = (f"{_named(stops, x)}, {_value(x)}, allowed {x.text(x.limit)}" for x in beyond)
        yield f"Beyond their limits: {'; '.join(texts)}."
    elif limited:
        yield "All limits that were given are kept."
    else:
        yield "No limits were given."


def _causes(stops: Stops) -> Iterator[str]:
    stopping, figures = stops.setting.stopping, stops.figures
    never = np.isinf(figures["stopping_time"]).any(axis=1)
    if never.any():
        yield (
            f"{never.sum()} stops have not ended after {stopping.longest:g} s, first that at "
            f"{stops.time[never][0]:.3f} s."
        )
    load = _most(stops, "brake_load")
    holds = "hold" if load.value <= 1 and not never.any() else "do not hold"
    yield (
        f"Brakes alone {holds} gravity where joints come to rest; it takes up to {_value(load)} of "
        f"the static torque at {_joint(stops, load)} (stop at {load.time:.3f} s)."
    )
    reached = [x for x in stops.worst if x.figure == "joint_stop_speed" and x.value > 0]
    for x in reached:
        yield f"{_joint(stops, x)} reaches a stop of the joint with {_value(x)} ({x.time:.3f} s)."
    if "longer" in figures:
        longer = figures["longer"] > 1
        if longer.any():
            most = _most(stops, "longer")
            yield (
                f"{longer.sum()} of {len(longer)} ramps are longer than asked for, as motors lack "
                f"torque: first at {stops.time[longer][0]:.3f} s, most at {most.time:.3f} s, "
                f"{_value(most)}."
            )
        drive = _most(stops, "drive_torque")
        if drive.value > 1:
            yield (
                f"{_joint(stops, drive)} needs {_value(drive)} at {drive.time:.3f} s: no ramp is "
                "long enough."
            )


def stop_tables(stops: Stops) -> dict[str, Table]:
    """Make the tables of the worst figures by joint, of the head, and of all limits, if any."""
    by_figure: dict[str, list[Worst]] = {}
    for x in stops.worst:
        by_figure.setdefault(x.figure, []).append(x)
    columns, rows = [], []
    for name, found in by_figure.items():
        metric = FIGURES[name]
        if found[0].joint is None:
            rows.append((metric.title, _value(found[0]), f"{found[0].time:.3f}"))
        elif any(x.value for x in found):
            columns.append((metric.label, metric.format, [metric.factor * x.value for x in found]))
            times = [x.time if x.value else np.nan for x in found]
            columns.append(("stop at [s]", ".3f", times))
    limits = [
        (_named(stops, x), _value(x), x.text(x.limit), "yes" if x.is_allowed else "no")
        for x in _limited(stops)
    ]
    tables = {
        "joints": Table(*by_joint(stops.setting.robot.joint_names, columns), "Worst of each joint"),
        "head": Table(("worst", "value", "stop at [s]"), rows, "Worst of all stops"),
        "limits": Table(("limit of", "worst", "allowed", "kept"), limits),
    }
    return {name: table for name, table in tables.items() if table.rows}


def write_stops(stops: Stops, title: str, period: float, folder: Path) -> Path:
    """Write table, plots and report into a folder, all or none, and return the page's path.

    Args:
        stops: the stops.
        title: name of the run.
        period: period of the run [s].
        folder: the folder.

    Raises:
        InputError: if a file cannot be written.
    """
    setting, at = stops.setting, stops.hardest
    stopping, brakes, course = setting.stopping, setting.brakes, stops.course(at)
    even = np.arange(0.0, max(course.time[-1], 0.2), SAMPLE)
    deceleration = [*(stopping.deceleration or np.full(setting.robot.n, np.nan))]
    device = by_joint(
        setting.robot.joint_names,
        [
            ("static torque [N m]", ".5g", brakes.static),
            ("dynamic torque [N m]", ".5g", brakes.dynamic),
            ("closing delay [s]", ".3g", brakes.delay),
            ("inertia [kg m²]", ".3g", brakes.inertia),
            ("deceleration of the ramp [rad/s²]", ".3g", deceleration),
            ("source of the brake", "", brakes.source),
        ],
    )
    dead = "" if stopping.failed_motor is None else f"; motor {stopping.failed_motor} has failed"
    report = written("stops", {
        "title": title, "caution": CAUTION, "findings": bullets(stop_findings(stops)),
        **{"head": None, "limits": "No limits were given."}, **stop_tables(stops),
        "instants.png": Plots([stop_panels(stops)]),
        "at": at, "hardest.png": Plots([course_panels(stops, course)]),
        "recording": played(
            _RECORDING, f"The stop that begins at {at:.3f} s. {CAUTION}", setting.robot, even,
            interpolated(even, course.time, course.q),
            title=f"{title}: stop at {at:.3f} s; no statement on safety",
        ),
        "device": Table(*device, "Brakes, joint side"), "category": stopping.category,
        "what": _WHAT[stopping.category] + dead, "period": 1e3 * period,
        "window": stopping.onset_window,
    })  # fmt: skip
    with replacing_files(folder) as new:
        stops.save(new / _TABLE)
        report.write(new)
    return folder / REPORT


def _limited(stops: Stops) -> list[Worst]:
    """Return the worst value of each limit; joints with the same limit share it."""
    found: dict[tuple[str, float], Worst] = {}
    for x in stops.worst:
        key = x.figure, x.limit
        if np.isfinite(x.limit) and (key not in found or x.value > found[key].value):
            found[key] = x
    return [*found.values()]


def _most(stops: Stops, figure: str) -> Worst:
    return max((x for x in stops.worst if x.figure == figure), key=lambda x: x.value)


def _value(worst: Worst) -> str:
    return worst.text(worst.value)


def _joint(stops: Stops, worst: Worst) -> str:
    return stops.setting.robot.joint((worst.joint or 1) - 1)


def _named(stops: Stops, worst: Worst) -> str:
    title = FIGURES[worst.figure].title
    return title if worst.joint is None else f"{title}, {_joint(stops, worst)}"
