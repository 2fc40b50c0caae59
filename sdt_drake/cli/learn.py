"""The command `learn`."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from sdt_drake.cli import common
from sdt_drake.cli.common import Changes, Columns, Flag, Given, Integer, Target, number, one_of
from sdt_drake.cli.printing import echo, print_document_table, print_joints
from sdt_drake.io.errors import InputError
from sdt_drake.io.files import alone_in, replacing_files
from sdt_drake.io.signals import holding_signals

if TYPE_CHECKING:
    from sdt_drake.machine.learn.filter import Convergence, LearningFilter
    from sdt_drake.run.design import Design

    Checked = Callable[[Design], tuple[LearningFilter, list[Convergence]]]

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
    out: Target = Path("learned"),
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
    checked = _checked(of, bandwidth, study, draws)
    _simulated(out, scenario, given.changes, flights, not all, checked)


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
    checked = _checked(of, bandwidth, study, draws)
    _from_recordings(state, recordings, scenario, given.changes, motion, columns, checked)


def _checked(of: str, bandwidth: float | None, study: str | None, draws: int | None) -> Checked:
    """Return the function that designs and checks the learning filter of a design."""
    if not study:
        common.refuse("has an effect with --study only", draws=draws)
    return partial(
        _checked_filter, of=of, bandwidth=bandwidth, study=study or None, draws=draws or _DRAWS
    )


def _simulated(
    folder: Path, path: str, changes: Changes, count: int, stops: bool, checked: Checked
) -> None:
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
    filter_, checks = checked(design)

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


def _checked_filter(
    design: Design, *, of: str, bandwidth: float | None, study: str | None, draws: int
) -> tuple[LearningFilter, list[Convergence]]:
    """Design the learning filter, print its convergence, and return both.

    Raises:
        InputError: if learning would not converge.
    """
    import numpy as np

    from sdt_drake.machine.learn.filter import refuse_divergence
    from sdt_drake.machine.learn.procedure import learning_filter
    from sdt_drake.show.reports.learning import check_table

    filter_, checks = learning_filter(design, of, bandwidth=bandwidth, study=study, draws=draws)
    echo(design.scenario.summary().title)
    for k, (omega, why) in enumerate(filter_.bandwidth):
        echo(f"joint {k + 1}: errors are learned up to {omega / (2 * np.pi):.3g} Hz ({why})")
    echo()
    print_document_table(check_table(checks, filter_))
    refuse_divergence(checks, filter_)
    for check in checks:
        beyond = int((check.loops.demand.max(axis=1) > 1).sum())
        if beyond:
            echo(
                f"note: {beyond} of {check.loops.name} need more torque than a motor has; motors "
                "saturate there, and learning may not converge"
            )
    echo()
    return filter_, checks


def _from_recordings(
    folder: Path,
    paths: Sequence[str],
    scenario: str | None,
    changes: Changes,
    motion: str | None,
    columns: str | None,
    checked: Checked,
) -> None:
    """Take a step of learning from recordings in its folder."""
    from sdt_drake.machine.learn.state import SCENARIO, count_trials

    common.check_folder(folder)
    if len({Path(path).resolve() for path in paths}) < len(paths):
        raise InputError("RECORDING: the same file twice, expected different recordings")
    known = count_trials(folder)
    with alone_in(folder, lambda: echo(f"{folder}: waiting for another sdt-drake learn to end")):
        own = folder / SCENARIO
        if own.exists() == (scenario is not None):
            text = (
                f"contains the scenario already, {SCENARIO}; leave out --scenario"
                if scenario
                else "is new, expected a --scenario"
            )
            raise InputError(f"{folder}: {text}")
        if scenario is None:
            why = f"{folder} contains the scenario, {SCENARIO}, which must not change"
            common.refuse(why, changes=changes)
        design = common.design_of(scenario or f"{own}", changes)
        if motion:
            _check_motion(motion, design)
        _step_in(folder, known, design, paths, columns, checked)


def _step_in(
    folder: Path,
    known: int,
    design: Design,
    paths: Sequence[str],
    columns: str | None,
    checked: Checked,
) -> None:
    """Take a step of learning while the folder is locked.

    `known` is the number of flights before the lock was taken.
    """
    import numpy as np

    from sdt_drake.machine.learn.state import State, read_state, update, write_step
    from sdt_drake.machine.recordings import load_columns, read_recording

    named = load_columns(columns) if columns else None
    recordings = [
        read_recording(path, design.device.simulated, named, needs=("q",)) for path in paths
    ]
    filter_, _ = checked(design)
    state = read_state(folder, design)
    made = update(design, filter_, state, recordings, known)
    flight = made.trial
    best = State([*state.trials, flight], []).best
    path = write_step(folder, design, state, made)
    echo(f"best so far: {best.flown(folder)}, {np.degrees(best.score):.5f} deg (RMS of all joints)")
    echo(f"{path} written; next: fly it, then learn from its recording")
    for recorded, shift in zip(recordings, flight.shifts, strict=True):
        echo(f"{recorded.path}: the motion begins {1e3 * shift:.2f} ms after the recording's start")
    errors = [
        ("largest error [deg]", ".4f", flight.largest),
        ("repeatable, RMS [deg]" if flight.floor else "RMS error [deg]", ".5f", flight.rms),
        ("not repeatable, RMS [deg]", ".5f", flight.floor),
    ]
    print_joints(
        design.device.simulated.joint_names,
        [(header, spec, np.degrees(values)) for header, spec, values in errors if values],
    )
    for one in made.findings:
        echo(f"note: {one}")
    if not flight.floor:
        echo("note: with several recordings of a flight, errors that do not repeat are separated")


def _check_motion(name: str, design: Design) -> None:
    """Raise InputError unless `name` is the motion of the state's scenario."""
    import numpy as np

    from sdt_drake.run.design import plan_of

    scenario = design.scenario
    own = plan_of(replace(scenario, motion=name), design.device.nominal).motion.q
    if (
        own.shape != design.reference.planned.q.shape
        or np.abs(own - design.reference.planned.q).max() > 1e-6
    ):
        raise InputError(f"--motion {name}: is not the motion of the scenario, {scenario.motion}")
