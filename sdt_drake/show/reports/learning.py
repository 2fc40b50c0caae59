"""The files of `learn`: learned reference, scenario and report."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from sdt_drake.io.arrays import Array
from sdt_drake.io.files import replacing_files
from sdt_drake.io.shown import formatted
from sdt_drake.io.tables import write_table
from sdt_drake.machine.learn.filter import Convergence, LearningFilter
from sdt_drake.machine.learn.flights import Flight, Lessons
from sdt_drake.run.design import Design
from sdt_drake.run.scenario import save_scenario
from sdt_drake.show.documents import MARKDOWN, REPORT, Report, Table, render, spread
from sdt_drake.show.panels import over_time, picture
from sdt_drake.show.style import (
    PALETTE,
    Look,
    finish,
    grid,
    joint_title,
    nth_look,
    pictures,
    plain_numbers,
    save_both,
    style,
)

LEARNED, SCENARIO, FLIGHTS = "learned.csv", "scenario.yaml", "flights.csv"
FILES = (LEARNED, SCENARIO, FLIGHTS)
"""Names of the best reference, a scenario with it, and the table of flights."""

UNFINISHED = "unfinished"
"""The folder within, with the same files, while flights are running or after an interruption."""

ALL_FILES = (
    *FILES,
    *(f"{UNFINISHED}/{name}" for name in FILES),
    *pictures("convergence", "flights", "errors"),
    *(MARKDOWN, REPORT),
)
"""Names of all files, with those that exist only until the last flight."""


def check_table(checks: Sequence[Convergence], filter_: LearningFilter) -> Table:
    """Make the table of the convergence check."""
    n = len(filter_.bandwidth)
    header = [
        "largest |Q (1 - L G)|", *(f"joint {k + 1}" for k in range(n)), "together",
        "torque taken [%]",
    ]  # fmt: skip
    rows = [
        [
            one.loops.title,
            *(f"{x:.3f}" for x in one.share.max(axis=0)),
            f"{one.together.max():.3f}",
            f"{100 * one.loops.demand.max():.1f}",
        ]
        for one in checks
    ]
    return Table(header, rows)


def flight_numbers(flight: Flight) -> dict[str, str | list[str]]:
    """Return the numbers of a flight by name: a text, or a text per joint."""
    return {
        "flight": f"{flight.number}",
        "largest error [deg]": [f"{x:.4f}" for x in np.degrees(flight.largest)],
        "RMS error [deg]": [f"{x:.5f}" for x in np.degrees(flight.rms)],
        "felt [% of time]": formatted(100 * flight.felt, ".1f"),
        "peak torque [%]": [f"{x:.1f}" for x in 100 * flight.peak],
    }


def learning_summary(lessons: Lessons) -> list[str]:
    """Return the result of the learning, why it ended, and notes on flights, as sentences."""
    first, best = lessons.flights[0], lessons.best
    worst = int(first.largest.argmax())
    lines = [
        f"best: flight {best.number}; the largest position error (joint {worst + 1}) fell from "
        f"{np.degrees(first.largest[worst]):.4f} to {np.degrees(best.largest[worst]):.4f} deg"
        if best is not first
        else f"best: flight {best.number}, the first one; the largest position error is "
        f"{np.degrees(first.largest[worst]):.4f} deg (joint {worst + 1})"
    ]
    if lessons.reason:
        lines.append(f"stopped after flight {lessons.flights[-1].number}: {lessons.reason}")
    notes = (f"flight {n}: {step.note}" for n, step in enumerate(lessons.steps, 2) if step.note)
    return [*lines, *notes]


def write_learned(folder: Path, design: Design, lessons: Lessons) -> None:
    """Write the best reference, a scenario with it, and the table of flights, all or none.

    Args:
        folder: the folder.
        design: the design of the first flight.
        lessons: the flights so far.
    """
    name = f"{design.scenario.name}_learned"
    scenario = design.scenario.changed({"name": name, "learned": LEARNED})
    with replacing_files(folder) as new:
        lessons.best.learned.to_csv(new / LEARNED, design.wanted)
        save_scenario(scenario, new / SCENARIO)
        _write_flights(new / FLIGHTS, lessons.flights)


def remove_unfinished(folder: Path) -> None:
    """Remove the files of `write_learned` in UNFINISHED; `folder` contains all results now."""
    for name in FILES:
        (folder / UNFINISHED / name).unlink(missing_ok=True)
    with suppress(OSError):  # not empty: a user's files stay
        (folder / UNFINISHED).rmdir()


def write_learning_report(
    folder: Path,
    design: Design,
    filter_: LearningFilter,
    checks: Sequence[Convergence],
    lessons: Lessons,
) -> Path:
    """Write figures and report of the learning, and return the path of the page.

    Args:
        folder: the folder.
        design: the design of the first flight.
        filter_: the learning filter.
        checks: checks of its convergence.
        lessons: the flights.
    """
    names, first, best = design.robot.joint_names, lessons.flights[0], lessons.best
    title = f"{design.scenario.name}: {design.scenario.controller.label}"
    compared = [first] if best is first else [first, best]
    figures = {
        "convergence": plot_checks(
            f"{title}, share of the error after a flight", checks, filter_, names
        ),
        "flights": plot_flights(f"{title}, by flight", lessons.flights, names),
        "errors": plot_errors(f"{title}, position errors", design.wanted.time, compared, names),
    }
    for name, figure in figures.items():
        save_both(figure, folder / name)
    rows = [flight_numbers(flight) for flight in lessons.flights]
    text = render(
        "learned.md.j2",
        title=title,
        summary=learning_summary(lessons),
        learned=filter_.of,
        flights=spread(list(rows[0]), [list(row.values()) for row in rows]),
        checks=check_table(checks, filter_),
    )
    return Report(text, folder).write()


def _write_flights(path: Path, flights: Sequence[Flight]) -> None:
    """Write the table of flights: errors [rad], shares of torque and of time [-]."""
    columns = {
        "max_abs_position_error": np.array([flight.largest for flight in flights]),
        "rms_position_error": np.array([flight.rms for flight in flights]),
        "peak_torque_share": np.array([flight.peak for flight in flights]),
        "saturated_fraction": np.array([flight.saturated for flight in flights]),
    }
    felt = np.array([[flight.felt] for flight in flights])
    if not np.isnan(felt).any():
        columns["felt_share"] = felt
    number = np.array([float(flight.number) for flight in flights])
    write_table(path, number, columns, first="flight")


# --- figures -------------------------------------------------------------------------------------


def plot_checks(
    title: str, checks: Sequence[Convergence], filter_: LearningFilter, joint_names: Sequence[str]
) -> Figure:
    """Draw the share of an error after a flight over frequency, a panel for each joint."""
    hertz = filter_.omega / (2 * np.pi)
    with style():
        figure, _ = grid(
            (len(joint_names) + 1) // 2, 2, panel=(3.95, 1.9), gaps=(0.75, 0.45), sharex=True
        )
        for k, name in enumerate(joint_names):
            ax = figure.axes[k]
            for i, one in enumerate(checks):
                look = nth_look(i)
                label = f"{one.loops.title}, this joint alone"
                ax.loglog(hertz, one.share[:, k], look.dashes, color=look.colour, label=label)
                if i == len(checks) - 1:
                    label = f"{one.loops.title}, all joints together"
                    ax.loglog(hertz, one.together, color="0.6", label=label, zorder=1)
            ax.axhline(1.0, color=PALETTE[1], linewidth=0.9, label="as large as before")
            cut, why = filter_.bandwidth[k]
            ax.axvline(cut / (2 * np.pi), color="0.4", linestyle=":", linewidth=0.9)
            ax.set_title(joint_title(k, name), loc="left", fontweight="bold")
            ax.set_title(f"up to {cut / (2 * np.pi):.3g} Hz: {why}", loc="right", fontsize=7)
            ax.set(ylim=(1e-4, 2), xlim=(hertz[0], hertz[-1]), ylabel="remaining error [-]")
            plain_numbers(ax.xaxis)
            plain_numbers(ax.yaxis)
        for ax in figure.axes[len(joint_names) :]:
            ax.set_visible(False)
        for ax in figure.axes[max(0, len(joint_names) - 2) : len(joint_names)]:  # lowest panels
            ax.set_xlabel("frequency [Hz]")
            ax.tick_params(labelbottom=True)
        return finish(figure, title)


def plot_errors(
    title: str, time: Array, flights: Sequence[Flight], joint_names: Sequence[str]
) -> Figure:
    """Draw position errors of flights over time, a panel for each joint."""
    lines = [
        (f"flight {flight.number}", Look(PALETTE[i]), np.degrees(flight.error))
        for flight, i in zip(flights, (1, 0), strict=False)
    ]
    largest = np.degrees([flight.largest for flight in flights])
    notes = [f"largest: {', '.join(f'{x:.3g}' for x in of_joint)} deg" for of_joint in largest.T]
    return picture(
        title, [over_time("position error [deg]", time, lines, joint_names, notes=notes)]
    )


def plot_flights(title: str, flights: Sequence[Flight], joint_names: Sequence[str]) -> Figure:
    """Draw largest and RMS error, share of felt time, and peak torque over the flights."""
    number = [flight.number for flight in flights]
    panels = (
        ("largest position error [deg]", np.degrees([flight.largest for flight in flights])),
        ("RMS position error [deg]", np.degrees([flight.rms for flight in flights])),
        ("error that can be felt [% of time]", 100 * np.array([[f.felt] for f in flights])),
        ("peak torque [% of the motor]", 100 * np.array([flight.peak for flight in flights])),
    )
    with style():
        figure, axes = grid(2, 2, panel=(3.95, 1.9), gaps=(0.75, 0.45))
        for ax, (label, values) in zip(figure.axes, panels, strict=True):
            one = values.shape[1] != len(joint_names)
            for k in range(values.shape[1]):
                look = nth_look(k)
                ax.plot(
                    number,
                    values[:, k],
                    look.dashes,
                    color="black" if one else look.colour,
                    marker=look.marker,
                    markersize=4,
                    label=None if one else joint_title(k, joint_names[k]),
                )
            if label.endswith("[deg]") and np.all(values > 0):
                ax.set_yscale("log")
                plain_numbers(ax.yaxis)
            elif np.isnan(values).all():
                ax.text(0.5, 0.5, "no head", transform=ax.transAxes, ha="center")
                ax.set_yticks([])
            else:
                ax.set_ylim(0, None)
            ax.set_title(label, loc="left")
            ax.set_xticks(number)
        for ax in axes[-1]:
            ax.set_xlabel("flight")
        return finish(figure, title)
