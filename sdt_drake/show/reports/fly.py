"""The files of `fly`: motion, summary and report."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.files import replacing_files
from sdt_drake.io.formats import in_json
from sdt_drake.io.shown import numbered
from sdt_drake.machine.cueing.candidate import Candidate
from sdt_drake.machine.cueing.procedure import CueingResult
from sdt_drake.machine.cueing.program import MAX_STEPS
from sdt_drake.motion import margins
from sdt_drake.pilot.canals import CUPULA, low_pass
from sdt_drake.pilot.head import GRAVITY
from sdt_drake.pilot.orientation import CAUTION
from sdt_drake.pilot.thresholds import CHANNELS
from sdt_drake.show.documents import MARKDOWN, REPORT, Report, Table, render
from sdt_drake.show.panels import Line, Panel, Plots
from sdt_drake.show.style import LOOKS, PALETTE, Look, finish, grid, pictures, save_both, style
from sdt_drake.show.view3d.viewer import recorded_page

MOTION, SUMMARY = "motion.csv", "summary.json"
_PLOTS, _RECORDING = ("force.png", "attitude.png", "rotation.png"), "3d.html"
FILES = (MOTION, SUMMARY, *pictures("front"), *_PLOTS, _RECORDING, MARKDOWN, REPORT)
"""Names of all files in the folder."""

_DEVICE = Look(PALETTE[5])
_MIN_COST = 0.1  # share of an error; a smaller one is not attributed to the torque limits


def write_flown(folder: Path, flown: CueingResult) -> Path:
    """Write motion, summary and report into a folder, all or none, and return the page's path.

    Raises:
        InputError: if a file cannot be written.
    """
    with replacing_files(folder) as new:
        flown.motion.to_csv(new / MOTION)
        text = json.dumps(in_json(flown.numbers), indent=1, ensure_ascii=False, allow_nan=False)
        (new / SUMMARY).write_text(text + "\n", encoding="utf-8")
        save_both(front_figure(flown), new / "front")
        report = fly_report(flown, new)
        report.write()
        for name, file in report.attached.items():
            if isinstance(file, Plots):
                file.save_picture(new / name)
            else:
                (new / name).write_text(file, encoding="utf-8")
    return folder / REPORT


def fly_report(flown: CueingResult, folder: Path) -> Report:
    """Make the report of a flight for a folder."""
    flight, best = flown.chosen.flight, flown.chosen
    panels = _force_panels(best), _attitude_panels(flown), _rotation_panels(best)
    attached: dict[str, Plots | str] = {
        name: Plots([column]) for name, column in zip(_PLOTS, panels, strict=True) if column
    }
    not_shown = ""
    try:
        attached[_RECORDING] = recorded_page(
            best.robot, best.motion.time, best.motion.q, title=flight.name
        )
    except InputError as error:
        not_shown = str(error)
    figures = [one.figures(flown.felt) for one in flown.candidates]
    rate = flight.angular_rate - low_pass_at(flight.time, flight.angular_rate)
    size = np.linalg.norm(flight.specific_force, axis=1) / GRAVITY
    text = render(
        "fly.md.j2",
        flight=flight,
        robot=best.robot,
        numbers=flown.numbers,
        g=(float(size.min()), float(size.max())),
        flown_rotation=float(np.degrees(np.sqrt((rate**2).mean(axis=0).sum()))),
        own=figures[0],
        alignment=figures[1],
        unlimited=figures[3] if flown.unlimited else None,
        motors=bool(flown.unlimited) and _costs(figures[0], figures[3]),
        compared=Table(*flown.summary()[1:3]),
        starts=_starts(flown),
        max_steps=MAX_STEPS,
        limits=_limits(best),
        attached=attached,
        not_shown=not_shown,
        caution=CAUTION,
    )
    return Report(text, folder, attached)


def _costs(own: dict[str, float | None], free: dict[str, float | None]) -> bool:
    """Check if more than a tenth of either error is due to the torque limits."""
    return any(
        (own[name] or 0) - (free[name] or 0) > _MIN_COST * (own[name] or 0)
        for name in ("g_error_rms", "felt_rotation_rms_deg_s")
    )


def low_pass_at(time: Array, rate: Array) -> Array:
    """Filter a rate at any times by the canals' low pass."""
    period = 0.02
    even = np.arange(0.0, time[-1] + period, period)
    columns = np.stack([np.interp(even, time, column) for column in rate.T], axis=1)
    slow = low_pass(columns, CUPULA, period)
    return np.stack([np.interp(time, even, column) for column in slow.T], axis=1)


def _starts(flown: CueingResult) -> Table:
    rows = flown.numbers["starts"]
    assert isinstance(rows, list)
    best = min(row["cost"] for row in rows)
    return Table(
        ["sense of the arm, seat", "G error [G]", "felt rotation error [deg/s]",
         "cost above the best [%]"],
        [
            (f"{'+' if row['sense'] > 0 else '−'}, {row['seat_deg']:.0f} deg",
             f"{row['g_error_rms']:.3f}", f"{row['felt_rotation_rms_deg_s']:.1f}",
             f"{100 * (row['cost'] / best - 1):.1f}")
            for row in rows
        ],
    )  # fmt: skip


def _limits(candidate: Candidate) -> Table:
    """Make the table of the largest used share of each limit, by joint."""
    share = margins(candidate.robot, candidate.motion).share
    return Table(
        ["joint", *(f"{name} [%]" for name in share)],
        [
            [name, *(f"{100 * values[:, k].max():.1f}" for values in share.values())]
            for k, name in enumerate(numbered(candidate.robot.joint_names))
        ],
    )


# --- figures -------------------------------------------------------------------------------------


def _beside(label: str, x: Array, flown: Array, device: Array, title: str = "") -> Panel:
    lines = [Line("flight", LOOKS["reference"], flown), Line("device", _DEVICE, device)]
    return Panel(title, "time [s]", label, x, lines)


def _force_panels(candidate: Candidate) -> list[Panel]:
    """Make the panels of resultant G and of specific force along each axis of the head."""
    flown, own = (
        candidate.flight.at(candidate.time)[0] / GRAVITY,
        candidate.head.specific_force / GRAVITY,
    )
    panels = [
        _beside(
            "G",
            candidate.time,
            np.linalg.norm(flown, axis=1),
            np.linalg.norm(own, axis=1),
            "resultant",
        )
    ]
    for k, name in enumerate(CHANNELS[3:]):
        panels.append(_beside("force [G]", candidate.time, flown[:, k], own[:, k], name))
    return panels


def _attitude_panels(flown: CueingResult) -> list[Panel]:
    """Make the panels of felt roll and pitch, with the aircraft's attitude."""
    panels = []
    time, felt, own = flown.chosen.time, flown.felt, flown.chosen.percept
    attitude = flown.chosen.flight.attitude
    for k, name in enumerate(("roll", "pitch")):
        lines = []
        if felt is not None and own is not None:
            in_flight = np.interp(time, felt.time, getattr(felt, name))
            lines = [
                Line("felt in flight", LOOKS["reference"], np.degrees(in_flight)),
                Line("felt on the device", _DEVICE, np.degrees(getattr(own, name))),
            ]
        if attitude is not None:
            true = np.interp(time, flown.chosen.flight.time, attitude[:, k])
            lines.append(Line("of the aircraft", Look("0.6", "--"), np.degrees(true)))
        if lines:
            panels.append(Panel(name, "time [s]", "angle [deg]", time, lines))
    return panels


def _rotation_panels(candidate: Candidate) -> list[Panel]:
    """Make the panels of the head's rate and its felt error, by axis."""
    flown, own = candidate.flight.at(candidate.time)[1], candidate.head.angular_velocity
    panels = []
    for k, name in enumerate(CHANNELS[:3]):
        felt = Line("felt error", Look(PALETTE[2]), np.degrees(candidate.felt_rate_error[:, k]))
        both = np.degrees(flown[:, k]), np.degrees(own[:, k])
        panel = _beside("rate [deg/s]", candidate.time, *both, name)
        panels.append(replace(panel, lines=[*panel.lines, felt]))
    return panels


def front_figure(flown: CueingResult) -> Figure:
    """Draw felt rotation error over G error, by weight, with the chosen motion and baselines."""

    def place(candidate: Candidate) -> tuple[float, float]:
        figures = candidate.figures(None)
        return figures["g_error_rms"] or 0.0, figures["felt_rotation_rms_deg_s"] or 0.0

    with style():
        figure, ((ax,),) = grid(1, 1, panel=(7.2, 3.6), left=0.85)
        ax.plot(*zip(*sorted(place(one) for _, one in flown.front), strict=True),
                color="0.2", marker="o", markersize=4, label="by weight of G")  # fmt: skip
        for one, look in zip(flown.candidates, (_DEVICE, *map(Look, PALETTE[1:4])), strict=False):
            ax.plot(*place(one), color=look.colour, marker="s", linestyle="", label=one.name)
        ax.set_xlabel("G error, RMS [G]")
        ax.set_ylabel("felt rotation error, RMS [deg/s]")
        ax.set_xlim(left=0)
        ax.set_ylim(bottom=0)
        finish(figure, "Less of one error costs more of the other")
    return figure
