"""The command `learn`."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from sdt_drake.cli import common
from sdt_drake.cli.common import Changes, Flag, Out, Trust, Whole, number, one_of
from sdt_drake.cli.printing import print_document_table, print_joints, say
from sdt_drake.io.errors import InputError
from sdt_drake.io.files import alone_in, replacing_files

if TYPE_CHECKING:
    from sdt_drake.machine.learn.filter import Convergence, LearningFilter
    from sdt_drake.run.design import Design

    Checked = Callable[[Design], tuple[LearningFilter, list[Convergence]]]

_FLIGHTS, _DRAWS = 5, 20
_Count = Annotated[Whole | None, number(gte=1, lte=1000)]


def run(
    scenario: Annotated[str | None, one_of("scenario")] = None,
    /,
    *,
    flights: _Count = None,
    of: Literal["reference", "torque"] = "reference",
    bandwidth: Annotated[float | None, Parameter(metavar="HZ")] = None,
    study: Annotated[str | None, one_of("study")] = None,
    draws: _Count = None,
    all: Flag = False,
    recording: Annotated[
        list[str] | None, Parameter(metavar="FLIGHT.csv", consume_multiple=True)
    ] = None,
    motion: Annotated[str | None, one_of("motion")] = None,
    columns: Annotated[str | None, Parameter(metavar="FILE")] = None,
    state: Annotated[Out, Parameter(metavar="DIR")] = None,
    out: Out = None,
    changes: Changes = (),
    trust: Trust = False,
) -> None:
    """Fly a motion several times, and learn from its errors what reference to fly next.

    example: sdt-drake learn wrong_model --set controller.kind=p_pi --flights 5 --out learned

    Args:
        scenario: name of one that ships, or .yaml file; with --recording for the first one only
        flights: at most, with the first one (default: 5)
        of: what is learned: a change of the reference, or a torque feedforward, of which only
            what changes quickly can be learned unless the scenario's held_speed is mean
        bandwidth: up to which errors are learned (default: as far as the model is trusted)
        study: whose variables are the uncertainty of the device, which learning must converge for
        draws: devices of the study to check, at most (default: 20)
        all: fly all flights, though another one is not worth it
        recording: of the real machine instead of simulated flights: one step from one or more
            recordings of the reference that was flown last
        motion: that was flown, to be sure (name or file)
        columns: YAML file with the recordings' columns, as `identify`
        state: with --recording: what is known so far
        out: folder for the learned reference, a scenario with it, and a report (default: learned)
    """
    if not study:
        common.refuse("is of a study, expected --study", draws=draws)

    def checked(design: Design) -> tuple[LearningFilter, list[Convergence]]:
        return _checked_filter(design, of, bandwidth, study or None, draws or _DRAWS)

    if recording:
        why = "is for simulated flights, expected no --recording"
        common.refuse(why, flights=flights, all=all, out=out)
        if state is None:
            raise InputError("--state: missing, expected the folder that keeps what is learned")
        _from_recordings(state, recording, scenario, changes, motion, columns, checked)
        return
    why = "is for --recording, expected one"
    common.refuse(why, motion=motion, columns=columns, state=state)
    if scenario is None:
        raise InputError("SCENARIO: missing, expected a scenario to fly")
    folder = out or Path("learned")
    _simulated(folder, scenario, changes, flights or _FLIGHTS, not all, checked)


def _simulated(
    folder: Path, path: str, changes: Changes, count: int, stops: bool, checked: Checked
) -> None:
    from sdt_drake.machine.learn.flights import Lessons, learn
    from sdt_drake.show.documents import REPORT
    from sdt_drake.show.reports import learning as report

    # A scenario that was learned goes on in another folder.
    common.check_folder(folder, report.ALL_FILES)
    kept = folder / report.UNFINISHED
    with_them = shlex.quote(str(kept / report.SCENARIO))
    goes_on = f"sdt-drake learn {with_them} --out OTHER goes on from them"
    if (kept / report.FLIGHTS).exists():
        raise InputError(
            f"{kept}: has flights of an interrupted run, expected another --out; {goes_on}"
        )
    design = common.design_of(path, changes)
    filter_, checks = checked(design)

    def tell(lessons: Lessons) -> None:
        report.write_learned(kept, design, lessons)
        numbers = report.flight_numbers(lessons.flights[-1])
        told = (x if isinstance(x, str) else " ".join(x) for x in numbers.values())
        say(", ".join(map(" ".join, zip(numbers, told, strict=True))))

    try:
        lessons = learn(design, filter_, count, stops=stops, report=tell)
        for line in report.learning_summary(lessons):
            say(line)
        with replacing_files(folder) as new:
            report.write_learned(new, design, lessons)
            report.write_learning_report(new, design, filter_, checks, lessons)
    except KeyboardInterrupt:
        if (kept / report.FLIGHTS).exists():
            say(f"interrupted; flights so far are kept in {kept}: {goes_on}")
        raise
    report.remove_unfinished(folder)
    learned, scenario = folder / report.LEARNED, folder / report.SCENARIO
    say(f"{learned} and {scenario} written: sdt-drake simulate uses them")
    say(f"{folder / REPORT} written")


def _checked_filter(
    design: Design, of: str, bandwidth: float | None, study: str | None, draws: int
) -> tuple[LearningFilter, list[Convergence]]:
    """The filter, and that it converges, both told.

    Raises:
        InputError: if it does not.
    """
    import numpy as np

    from sdt_drake.cli.daily import learning_filter
    from sdt_drake.machine.learn.filter import refuse_divergence
    from sdt_drake.show.reports.learning import check_table

    filter_, checks = learning_filter(design, of, bandwidth=bandwidth, study=study, draws=draws)
    say(design.scenario.summary().title)
    for k, (omega, why) in enumerate(filter_.bandwidth):
        say(f"joint {k + 1}: errors are learned up to {omega / (2 * np.pi):.3g} Hz ({why})")
    say()
    print_document_table(check_table(checks, filter_))
    refuse_divergence(checks, filter_)
    for check in checks:
        beyond = int((check.loops.demand.max(axis=1) > 1).sum())
        if beyond:
            say(
                f"note: {beyond} of {check.loops.name} need more torque than a motor has: there it "
                "saturates, and learning may not converge"
            )
    say()
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
    """Take a step from recordings in the folder of a learning."""
    from sdt_drake.machine.learn.state import SCENARIO, count_flights

    common.check_folder(folder)
    if len({Path(path).resolve() for path in paths}) < len(paths):
        raise InputError("--recording: names a file twice, expected another recording each time")
    known = count_flights(folder)
    with alone_in(folder, lambda: say(f"{folder}: waiting for another learn to end")):
        own = folder / SCENARIO
        if own.exists() == (scenario is not None):
            text = f"has its scenario, {SCENARIO}; leave SCENARIO away" if scenario else "is new"
            raise InputError(
                f"--state {folder}: {text}{'' if scenario else ', expected a SCENARIO'}"
            )
        if scenario is None:
            why = f"{folder} has its scenario, {SCENARIO}, which stays as it is"
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
    """Take a step where nobody else writes; `known`: how many flights there were at the start."""
    import numpy as np

    from sdt_drake.machine.learn.state import State, read_state, teach, write_step
    from sdt_drake.machine.recordings import load_columns, read_recording

    named = load_columns(columns) if columns else None
    recordings = [read_recording(path, design.robot, named, needs=("q",)) for path in paths]
    filter_, _ = checked(design)
    state = read_state(folder, design)
    taught = teach(design, filter_, state, recordings, known)
    flight = taught.flight
    for recorded, shift in zip(recordings, flight.shifts, strict=True):
        say(f"{recorded.path}: the motion begins {1e3 * shift:.2f} ms after its start")
    errors = [
        ("largest error [deg]", ".4f", flight.largest),
        ("repeats, RMS [deg]" if flight.floor else "RMS error [deg]", ".5f", flight.rms),
        ("does not repeat, RMS [deg]", ".5f", flight.floor),
    ]
    print_joints(
        design.robot.joint_names,
        [(header, spec, np.degrees(values)) for header, spec, values in errors if values],
    )
    for note in taught.notes:
        say(f"note: {note}")
    if not flight.floor:
        say("note: with several recordings of a flight, what does not repeat is told apart")
    path = write_step(folder, design, state, taught)
    say(f"{path} written: fly it, then learn from its recording")
    best = State([*state.flights, flight], []).best
    say(f"best so far: {best.flown(folder)}, {np.degrees(best.score):.5f} deg (RMS of all joints)")


def _check_motion(name: str, design: Design) -> None:
    """Refuse another motion than that of the state."""
    import numpy as np

    from sdt_drake.run.design import plan_of

    scenario = design.scenario
    own = plan_of(replace(scenario, motion=name), design.nominal).motion.q
    if own.shape != design.wanted.q.shape or np.abs(own - design.wanted.q).max() > 1e-6:
        raise InputError(f"--motion {name}: is not the motion of the scenario, {scenario.motion}")
