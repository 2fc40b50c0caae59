"""The files of `learn`: learned reference, scenario and report."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from sdt_drake.io.files import replacing_files
from sdt_drake.io.shown import formatted
from sdt_drake.io.tables import write_table
from sdt_drake.machine.learn.filter import Convergence, LearningFilter
from sdt_drake.machine.learn.trials import LearningResult, Trial
from sdt_drake.run.design import Design
from sdt_drake.run.options import in_print
from sdt_drake.run.scenario import save_scenario
from sdt_drake.show.documents import MARKDOWN, REPORT, written
from sdt_drake.show.figures import learning as figures
from sdt_drake.show.sections import Table, capital, joined, said, spread
from sdt_drake.show.style import pictures

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


def flight_numbers(flight: Trial) -> dict[str, str | list[str]]:
    """Return the numbers of a flight by name: a text, or a text per joint."""
    return {
        "flight": f"{flight.number}",
        "largest error [deg]": [f"{x:.4f}" for x in np.degrees(flight.largest)],
        "RMS error [deg]": [f"{x:.5f}" for x in np.degrees(flight.rms)],
        "felt [% of time]": formatted(100 * flight.felt, ".1f"),
        "peak torque [%]": [f"{x:.1f}" for x in 100 * flight.peak],
    }


def learning_summary(result: LearningResult) -> list[str]:
    """Return the result of the learning, why it ended, and notes on flights, as sentences."""
    first, best = result.trials[0], result.best
    worst = int(first.largest.argmax())
    lines = [
        f"best: flight {best.number}; the largest position error (joint {worst + 1}) fell from "
        f"{np.degrees(first.largest[worst]):.4f} to {np.degrees(best.largest[worst]):.4f} deg"
        if best is not first
        else f"best: flight {best.number}, the first one; the largest position error is "
        f"{np.degrees(first.largest[worst]):.4f} deg (joint {worst + 1})"
    ]
    if result.reason:
        lines.append(f"stopped after flight {result.trials[-1].number}: {result.reason}")
    notes = (f"flight {n}: {step.note}" for n, step in enumerate(result.steps, 2) if step.note)
    return [*lines, *notes]


def write_learned(folder: Path, design: Design, result: LearningResult) -> None:
    """Write the best reference, a scenario with it, and the table of flights, all or none.

    Args:
        folder: the folder.
        design: the design of the first flight.
        result: the flights so far.
    """
    name = f"{design.scenario.name}_learned"
    scenario = design.scenario.changed({"name": name, "learned": LEARNED})
    with replacing_files(folder) as new:
        result.best.learned.to_csv(new / LEARNED, design.reference.planned)
        save_scenario(scenario, new / SCENARIO)
        _write_flights(new / FLIGHTS, result.trials)


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
    result: LearningResult,
) -> Path:
    """Write figures and report of the learning, and return the path of the page.

    Args:
        folder: the folder.
        design: the design of the first flight.
        filter_: the learning filter.
        checks: checks of its convergence.
        result: the flights.
    """
    names, first, best = design.device.simulated.joint_names, result.trials[0], result.best
    title = f"{design.scenario.name}: {in_print(design.scenario.controller.label)}"
    time, compared = design.reference.planned.time, [first] if best is first else [first, best]
    rows = [flight_numbers(trial) for trial in result.trials]
    answer, *more = map(capital, learning_summary(result))
    share = f"{title}, share of the error after a flight"
    return written("learning", {
        "title": title, "of": filter_.of,
        "answer": joined([said("**{}.**", answer), *(said("{}.", line) for line in more)], " "),
        "table": spread(list(rows[0]), [list(row.values()) for row in rows]),
        "flights.png": figures.flights(f"{title}, by flight", result.trials, names),
        "errors.png": figures.errors(f"{title}, position errors", time, compared, names),
        "checks": check_table(checks, filter_),
        "convergence.png": figures.checks(share, checks, filter_, names),
    }).write(folder)  # fmt: skip


def _write_flights(path: Path, flights: Sequence[Trial]) -> None:
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
