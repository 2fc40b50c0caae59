"""What learning leaves in a folder: the learned reference, a scenario with it, and a report."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure as Picture

from sdt_drake.analysis import style
from sdt_drake.analysis.document import Cell, Document, Figure, Section, Table, Text, write_text
from sdt_drake.arrays import Array
from sdt_drake.design import Design
from sdt_drake.errors import replacing_all
from sdt_drake.learning import plots
from sdt_drake.learning.convergence import Convergence
from sdt_drake.learning.filter import LearningFilter
from sdt_drake.learning.flights import Flight, Lessons
from sdt_drake.scenario import save_scenario
from sdt_drake.tables import write_table

LEARNED, SCENARIO, FLIGHTS = "learned.csv", "scenario.yaml", "flights.csv"
"""Files of the folder: the best reference, a scenario with it, and the numbers of each flight."""

UNFINISHED = "unfinished"
"""Folder within, with the same files, of flights that are not yet, or never were, all flown."""

Rows = tuple[list[str], list[list[Cell]]]
"""Header and rows of a table; a cell may have a text for each joint."""


@dataclass(frozen=True, eq=False)
class Learned:
    """Everything of a course of flights.

    Attributes:
        design: of the first flight.
        filter: that was learned with.
        checks: of its convergence.
        lessons: the flights.
    """

    design: Design
    filter: LearningFilter
    checks: Sequence[Convergence]
    lessons: Lessons


def check_rows(
    checks: Sequence[Convergence], filter_: LearningFilter
) -> tuple[list[str], list[list[str]]]:
    """The check of the convergence as a table."""
    n = len(filter_.bandwidth)
    header = [
        "largest |Q (1 - L G)|", *(f"joint {k + 1}" for k in range(n)), "together",
        "torque taken [%]",
    ]  # fmt: skip
    rows = [
        [
            _name(one),
            *(f"{x:.3f}" for x in one.share.max(axis=0)),
            f"{one.together.max():.3f}",
            f"{100 * one.loops.demand.max():.1f}",
        ]
        for one in checks
    ]
    return header, rows


def _name(check: Convergence) -> str:
    loops = check.loops
    return f"{loops.name} ({loops.devices})" if loops.devices > 1 else loops.name


def flight_rows(flights: Sequence[Flight]) -> Rows:
    """Errors by flight as a table."""
    header = [
        "flight", "largest error [deg]", "RMS error [deg]", "felt [% of time]", "peak torque [%]",
    ]  # fmt: skip
    rows = [
        [
            f"{flight.number}",
            _joints(np.degrees(flight.largest), ".4f"),
            _joints(np.degrees(flight.rms), ".5f"),
            f"{100 * flight.felt:.1f}".replace("nan", "–"),
            _joints(100 * flight.peak, ".1f"),
        ]
        for flight in flights
    ]
    return header, rows


def _joints(values: Array, spec: str) -> list[str]:
    return [format(value, spec) for value in values]


def summary(lessons: Lessons) -> list[str]:
    """For people: how it went, and why it ended."""
    first, best = lessons.flights[0], lessons.best
    lines = []
    for number, step in enumerate(lessons.steps, start=2):
        if step.share < 1:
            lines.append(
                f"flight {number}: scaled back to {100 * step.share:.0f} % of the step, "
                f"{step.limit}"
            )
        elif step.limit:
            lines.append(f"flight {number}: torque cut off, {step.limit}")
    if lessons.reason:
        lines.append(f"stopped after flight {lessons.flights[-1].number}: {lessons.reason}")
    worst = int(first.largest.argmax())
    lines.append(
        f"best: flight {best.number}; joint {worst + 1} from {np.degrees(first.largest[worst]):.4f}"
        f" to {np.degrees(best.largest[worst]):.4f} deg at most"
    )
    return lines


def write_learned(folder: Path, design: Design, lessons: Lessons) -> None:
    """Write what the best flight had, a scenario with it, and the numbers of all flights so far.

    Either all three are replaced or none.

    Args:
        folder: to write into.
        design: of the first flight.
        lessons: the flights.
    """
    scenario = copy.deepcopy(design.scenario)
    scenario.name, scenario.learned = f"{scenario.name}_learned", LEARNED
    with replacing_all([folder / name for name in (LEARNED, SCENARIO, FLIGHTS)]) as partials:
        best, with_it, flights = partials
        lessons.best.learned.to_csv(best)
        save_scenario(scenario, with_it)
        _write_flights(flights, lessons.flights)


def remove_unfinished(folder: Path) -> None:
    """Remove what `write_learned` has kept in UNFINISHED; all is in `folder` now."""
    for name in (FLIGHTS, SCENARIO, LEARNED):
        (folder / UNFINISHED / name).unlink(missing_ok=True)
    with suppress(OSError):  # somebody keeps something else there
        (folder / UNFINISHED).rmdir()


def write_report(folder: Path, learned: Learned) -> Path:
    """Write figures and report; the report's page."""
    design, lessons, names = learned.design, learned.lessons, learned.design.robot.joint_names
    first, best = lessons.flights[0], lessons.best
    title = f"{design.scenario.name}: {design.scenario.controller.label}"
    compared = [first] if best is first else [first, best]
    pictures = {
        "convergence": plots.check(
            f"{title}, the error that a flight leaves", learned.checks, learned.filter, names
        ),
        "flights": plots.by_flight(f"{title}, by flight", lessons.flights, names),
        "errors": plots.errors(f"{title}, position errors", design.wanted.time, compared, names),
    }
    document = Document(f"{title}: learned", lead=" ".join(f"{x}." for x in summary(lessons)))
    document.sections = [
        Section("Flights", [
            Table(*flight_rows(lessons.flights)),
            _figure(folder, pictures, "flights", "Errors, what can be felt, torques by flight."),
            _figure(folder, pictures, "errors", "Errors of the first and of the best flight."),
        ]),
        Section("Does it converge?", [
            Text(
                "Told before the first flight, from linear models: the share of an error that a "
                f"flight leaves. What is learned is the {learned.filter.of}."
            ),
            Table(*check_rows(learned.checks, learned.filter)),
            _figure(
                folder, pictures, "convergence",
                "Below 1 an error shrinks; above the bandwidth (dotted) nothing is learned, and "
                "nothing lost."
            ),
        ]),
    ]  # fmt: skip
    write_text(folder / "report.md", document.markdown())
    return write_text(folder / "report.html", document.html())


def _figure(folder: Path, pictures: dict[str, Picture], name: str, caption: str) -> Figure:
    return Figure(caption, style.save_both(pictures[name], folder / f"{name}.png"), folder)


def _write_flights(path: Path, flights: Sequence[Flight]) -> None:
    """For each flight: errors [rad], shares of torque and of time [-]."""
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
