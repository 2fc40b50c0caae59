"""Fly a motion several times, and learn from its errors what reference to fly next."""

from __future__ import annotations

import argparse
import shlex
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from sdt_drake.cli import common
from sdt_drake.cli.common import say
from sdt_drake.io.errors import InputError
from sdt_drake.io.files import replacing_files

if TYPE_CHECKING:
    from sdt_drake.machine.learn.filter import Convergence, LearningFilter
    from sdt_drake.run.design import Design

EXAMPLE = "sdt-drake learn wrong_model --set controller.kind=p_pi --flights 5 --out learned"

_FLIGHTS, _MOST = 5, 1000


def add(parser: argparse.ArgumentParser) -> None:
    text = "name of one that ships, or .yaml file; with --recording for the first one only"
    common.add_scenario(parser, text, nargs="?")
    parser.add_argument(
        "--flights",
        type=common.number(int, minimum=1, maximum=_MOST),
        help=f"at most, with the first one (default: {_FLIGHTS})",
    )
    parser.add_argument(
        "--of",
        choices=("reference", "torque"),
        default="reference",
        help="what is learned: a change of the reference (default), or a torque feedforward, of "
        "which only what changes quickly can be learned unless the scenario's held_speed is mean",
    )
    parser.add_argument(
        "--bandwidth",
        type=float,
        metavar="HZ",
        help="up to which errors are learned (default: as far as the model is trusted)",
    )
    parser.add_argument(
        "--study",
        metavar="STUDY",
        help="whose variables are the uncertainty of the device, which learning must converge for",
    )
    parser.add_argument(
        "--draws",
        type=common.number(int, minimum=1, maximum=_MOST),
        default=20,
        help="devices of the study to check, at most (default: 20)",
    )
    parser.add_argument(
        "--all", action="store_true", help="fly all flights, though another one is not worth it"
    )
    parser.add_argument(
        "--recording",
        nargs="+",
        metavar="FLIGHT.csv",
        help="of the real machine instead of simulated flights: one step from one or more "
        "recordings of the reference that was flown last",
    )
    parser.add_argument("--motion", help="that was flown, to be sure (name or file)")
    parser.add_argument(
        "--columns", metavar="FILE", help="YAML file with the recordings' columns, as `identify`"
    )
    parser.add_argument(
        "--state",
        type=common.some_path,
        metavar="DIR",
        help="with --recording: what is known so far",
    )
    common.add_out(
        parser,
        "folder for the learned reference, a scenario with it, and a report (default: learned)",
    )


def run(options: argparse.Namespace) -> None:
    if not options.study:
        common.refuse_options(options, "is of a study, expected --study", "draws")
    if options.recording:
        why = "is for simulated flights, expected no --recording"
        common.refuse_options(options, why, "flights", "all", "out")
        _from_recordings(options)
        return
    why = "is for --recording, expected one"
    common.refuse_options(options, why, "motion", "columns", "state")
    if options.scenario is None:
        raise InputError("SCENARIO: missing, expected a scenario to fly")
    _simulated(options)


def _simulated(options: argparse.Namespace) -> None:
    from sdt_drake.machine.learn.flights import Lessons, learn
    from sdt_drake.show.documents import REPORT
    from sdt_drake.show.reports import learning as report

    folder: Path = options.out or Path("learned")
    # A scenario that was learned goes on in another folder.
    common.check_folder(folder, report.ALL_FILES)
    count, kept = options.flights or _FLIGHTS, folder / report.UNFINISHED
    with_them = shlex.quote(str(kept / report.SCENARIO))
    goes_on = f"sdt-drake learn {with_them} --out OTHER goes on from them"
    if (kept / report.FLIGHTS).exists():
        raise InputError(
            f"{kept}: has flights of an interrupted run, expected another --out; {goes_on}"
        )
    design = common.design_of(options)
    filter_, checks = _checked_filter(options, design)

    def tell(lessons: Lessons) -> None:
        report.write_learned(kept, design, lessons)
        numbers = report.flight_numbers(lessons.flights[-1])
        told = (x if isinstance(x, str) else " ".join(x) for x in numbers.values())
        say(", ".join(map(" ".join, zip(numbers, told, strict=True))))

    try:
        lessons = learn(design, filter_, count, stops=not options.all, report=tell)
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
    options: argparse.Namespace, design: Design
) -> tuple[LearningFilter, list[Convergence]]:
    """The filter, and that it converges, both told.

    Raises:
        InputError: if it does not.
    """
    import numpy as np

    from sdt_drake.cli.daily import learning_filter
    from sdt_drake.machine.learn.filter import refuse_divergence
    from sdt_drake.show.reports.learning import check_table

    filter_, checks = learning_filter(
        design,
        options.of,
        bandwidth=options.bandwidth,
        study=options.study or None,
        draws=options.draws,
    )
    say(design.scenario.summary().title)
    for k, (omega, why) in enumerate(filter_.bandwidth):
        say(f"joint {k + 1}: errors are learned up to {omega / (2 * np.pi):.3g} Hz ({why})")
    say()
    common.print_document_table(check_table(checks, filter_))
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


def _from_recordings(options: argparse.Namespace) -> None:
    from sdt_drake.machine.learn.state import alone_in, count_flights

    folder: Path | None = options.state
    if folder is None:
        raise InputError("--state: missing, expected the folder that keeps what is learned")
    common.check_folder(folder)
    files = [Path(path).resolve() for path in options.recording]
    if len(set(files)) < len(files):
        raise InputError("--recording: names a file twice, expected another recording each time")
    known = count_flights(folder)
    with alone_in(folder, lambda: say(f"{folder}: waiting for another learn to end")):
        _step_in(folder, known, options)


def _step_in(folder: Path, known: int, options: argparse.Namespace) -> None:
    """Take a step from recordings in the folder of a learning.

    Args:
        folder: of the learning; nobody else writes to it.
        known: how many flights it had when this command began.
        options: of the command.
    """
    import numpy as np

    from sdt_drake.machine.learn.state import SCENARIO, State, read_state, teach, write_step
    from sdt_drake.machine.recordings import load_columns, read_recording

    begun = (folder / SCENARIO).exists()
    if begun == (options.scenario is not None):
        text = f"has its scenario, {SCENARIO}; leave SCENARIO away" if begun else "is new"
        raise InputError(f"--state {folder}: {text}{'' if begun else ', expected a SCENARIO'}")
    if begun:
        if options.changes:
            raise InputError(f"--set: {folder} has its scenario, {SCENARIO}, which stays as it is")
        options.scenario = str(folder / SCENARIO)
    design = common.design_of(options)
    if options.motion:
        _check_motion(options.motion, design)
    columns = load_columns(options.columns) if options.columns else None
    recordings = [
        read_recording(path, design.robot, columns, needs=("q",)) for path in options.recording
    ]
    filter_, _ = _checked_filter(options, design)
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
    common.print_joints(
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
