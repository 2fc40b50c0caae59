"""The command `learn`."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.cli.common import (
    Changes,
    Columns,
    Flag,
    Given,
    Integer,
    OutFolder,
    Target,
    number,
    one_of,
)
from sdt_drake.cli.printing import echo, print_document_table, print_joints
from sdt_drake.io.errors import InputError
from sdt_drake.io.files import replacing_files
from sdt_drake.io.signals import holding_signals

if TYPE_CHECKING:
    from sdt_drake.machine.learn.filter import Convergence, LearningFilter
    from sdt_drake.run.design import Design

_FLIGHTS, _DRAWS = 5, 20
_Count = Annotated[Integer, number(gte=1, lte=1000)]
_Of = Annotated[
    Literal["reference", "torque"],
    Parameter(
        help="signal to learn: a change of the reference, or a torque feedforward (only its quick "
        "changes, unless the scenario has held_speed: mean)"
    ),
]
_Bandwidth = Annotated[
    float | None,
    Parameter(
        metavar="HZ",
        help="frequency up to which errors are learned (default: as far as the controller's model "
        "is trusted)",
    ),
]
_Study = Annotated[
    str | None,
    one_of(
        "study",
        help="study with the uncertainty of the device; learning must converge for its devices",
    ),
]
_Draws = Annotated[
    Integer | None,
    number(gte=1, lte=1000),
    Parameter(help="largest number of the study's devices to check (default: 20)"),
]


def run(
    scenario: Annotated[str, one_of("scenario")],
    /,
    *,
    flights: _Count = _FLIGHTS,
    of: _Of = "reference",
    bandwidth: _Bandwidth = None,
    study: _Study = None,
    draws: _Draws = None,
    all: Flag = False,
    out: OutFolder = Path("learned"),
    given: Given = Given(),
) -> None:
    """Fly a motion several times and learn a better reference from its errors.

    The flights are simulated; `learn update` learns from recordings of the real machine.

    example: sdt-drake learn wrong_model --set controller.kind=p_pi --flights 5 --out learned

    Args:
        scenario: shipped name or .yaml file
        flights: largest number of flights, the first included
        all: fly all flights, even if another flight would not improve the result
        out: folder for the learned reference, a scenario with it, and a report
    """
    options = _filter_options(of, bandwidth, study, draws)
    _simulated(out, scenario, given.changes, flights, not all, options)


def update(
    state: Annotated[Target, Parameter(name="STATE")],
    recordings: Annotated[list[str], Parameter(name="RECORDING")],
    /,
    *,
    scenario: Annotated[str | None, one_of("scenario")] = None,
    motion: Annotated[str | None, one_of("motion")] = None,
    columns: Columns = None,
    of: _Of = "reference",
    bandwidth: _Bandwidth = None,
    study: _Study = None,
    draws: _Draws = None,
    given: Given = Given(),
) -> None:
    """Learn the next reference from recordings of the real machine flying the last one.

    example: sdt-drake learn update state run_1.csv --scenario my_machine.yaml

    Args:
        state: folder that keeps the learned state
        recordings: one or more recordings of a flight
        scenario: scenario of the first flight; the state keeps it for the next ones
        motion: motion that was flown (shipped name or file), for a check
    """
    import numpy as np

    common.check_folder(state)
    if scenario is None:
        common.refuse(f"the scenario in {state} must not change", changes=given.changes)
    step = sdt.learn_update(
        state,
        recordings,
        scenario=None if scenario is None else sdt.load(scenario, dict(given.changes)),
        motion=motion,
        columns=columns,
        report=_print_filter,
        waiting=lambda: echo(f"{state}: waiting for another sdt-drake learn to end"),
        **_filter_options(of, bandwidth, study, draws),
    )
    best, flight = step.best, step.made.trial
    score = f"{np.degrees(best.score):.5f} deg (RMS of all joints)"
    echo(f"best so far: {best.flown(state)}, {score}")
    echo(f"{step.reference} written; next: fly it, then learn from its recording")
    for recorded, shift in zip(step.recordings, flight.shifts, strict=True):
        echo(f"{recorded.path}: the motion begins {1e3 * shift:.2f} ms after the recording's start")
    errors = [
        ("largest error [deg]", ".4f", flight.largest),
        ("repeatable, RMS [deg]" if flight.floor else "RMS error [deg]", ".5f", flight.rms),
        ("not repeatable, RMS [deg]", ".5f", flight.floor),
    ]
    print_joints(
        step.design.device.simulated.joint_names,
        [(header, spec, np.degrees(values)) for header, spec, values in errors if values],
    )
    for one in step.made.findings:
        echo(f"note: {one}")
    if not flight.floor:
        echo("note: with several recordings of a flight, errors that do not repeat are separated")


def _filter_options(
    of: str, bandwidth: float | None, study: str | None, draws: int | None
) -> dict[str, Any]:
    """Return the arguments that design and check the learning filter."""
    if not study:
        common.refuse("has an effect with --study only", draws=draws)
    return {"of": of, "bandwidth": bandwidth, "study": study or None, "draws": draws or _DRAWS}


def _simulated(
    folder: Path, path: str, changes: Changes, count: int, stops: bool, options: dict[str, Any]
) -> None:
    from sdt_drake.machine.learn.filter import refuse_divergence
    from sdt_drake.machine.learn.procedure import learning_filter
    from sdt_drake.machine.learn.trials import LearningResult, learn
    from sdt_drake.show.documents import REPORT
    from sdt_drake.show.reports import learning as report

    # Learning may continue from a learned scenario only in another folder.
    common.check_folder(folder, report.ALL_FILES)
    kept = folder / report.UNFINISHED
    with_them = shlex.quote(str(kept / report.SCENARIO))
    goes_on = f"to continue from them: sdt-drake learn {with_them} --out OTHER"
    if (kept / report.FLIGHTS).exists():
        raise InputError(
            f"{kept}: contains flights of an interrupted run, expected another --out; {goes_on}"
        )
    design = common.design_of(path, changes)
    filter_, checks = learning_filter(design, **options)
    _print_filter(design, filter_, checks)
    refuse_divergence(checks, filter_)

    def report_flight(result: LearningResult) -> None:
        report.write_learned(kept, design, result)
        numbers = report.flight_numbers(result.trials[-1])
        texts = (x if isinstance(x, str) else " ".join(x) for x in numbers.values())
        echo(", ".join(map(" ".join, zip(numbers, texts, strict=True))))

    try:
        result = learn(design, filter_, count, stops=stops, report=report_flight)
        for line in report.learning_summary(result):
            echo(line)
        with holding_signals() as released:
            with replacing_files(folder) as new, released():
                report.write_learned(new, design, result)
                report.write_learning_report(new, design, filter_, checks, result)
            report.remove_unfinished(folder)
    except (KeyboardInterrupt, InputError) as error:
        if (kept / report.FLIGHTS).exists():
            why = "" if isinstance(error, InputError) else "interrupted; "
            echo(f"{why}the flights so far are in {kept}; {goes_on}")
        raise
    learned, scenario = folder / report.LEARNED, folder / report.SCENARIO
    echo(f"{learned} and {scenario} written")
    echo(f"next: sdt-drake simulate {shlex.quote(str(scenario))}")
    echo(f"{folder / REPORT} written")


def _print_filter(design: Design, filter_: LearningFilter, checks: Sequence[Convergence]) -> None:
    """Print how far errors are learned, and the checks of convergence."""
    import numpy as np

    from sdt_drake.show.reports.learning import check_table

    echo(design.scenario.summary().title)
    for k, (omega, why) in enumerate(filter_.bandwidth):
        echo(f"joint {k + 1}: errors are learned up to {omega / (2 * np.pi):.3g} Hz ({why})")
    echo()
    print_document_table(check_table(checks, filter_))
    for check in checks:
        beyond = int((check.loops.demand.max(axis=1) > 1).sum())
        if beyond:
            echo(
                f"note: {beyond} of {check.loops.name} need more torque than a motor has; motors "
                "saturate there, and learning may not converge"
            )
    echo()
