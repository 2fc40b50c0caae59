"""What the commands of the same names do, as functions: they return what these print and draw."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from sdt_drake.analysis.frequency_response import FrequencyResponse, frequency_response
from sdt_drake.analysis.reproduction import tuning
from sdt_drake.io.arguments import a_path, positive, takes
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import (
    InputError,
    checked_choice,
    checked_count,
    checked_number,
    checked_type,
)
from sdt_drake.io.files import checked_output, replacing_files
from sdt_drake.io.trust import trusting
from sdt_drake.machine import drive_files
from sdt_drake.machine import replay as replaying
from sdt_drake.machine.learn import flights as flying
from sdt_drake.machine.learn.filter import (
    Convergence,
    LearningFilter,
    convergence,
    design_filter,
    refuse_divergence,
)
from sdt_drake.machine.learn.loops import LEARNED, loops_of
from sdt_drake.machine.recordings import SIDES, Columns, Recorded, load_columns, read_recording
from sdt_drake.robot.robot import Robot, load_robot
from sdt_drake.run.design import Design, as_design, load_device
from sdt_drake.run.scenario import Scenario
from sdt_drake.studies.devices import devices_of
from sdt_drake.studies.study import load_study

if TYPE_CHECKING:
    from sdt_drake.machine.identify.procedure import Identified

FOUND = ("payload", "friction")


def tune(design: Design | Scenario) -> dict[str, Array]:
    """Tell the effective inertia along a motion and the gains that follow, as `sdt-drake tune`.

        numbers = sdt.tune(sdt.load("coupled_pi"))
        print(numbers["i_eff_max"], numbers["kp"])

    Args:
        design: a resolved scenario, or a scenario.

    Returns:
        Arrays of shape (n,) by name, motor side: i_eff_max, i_eff_median and i_eff_min [kg m²],
        variation_percent [%], kp [N m s/rad], ki [N m/rad]; at each of the three inertias the
        damping ratio zeta_max, zeta_median, zeta_min [-] and the natural frequency omega_n_max,
        omega_n_median, omega_n_min [rad/s]; omega_0 [rad/s] at the largest inertia.
    """
    return tuning(as_design(design))


def bode(design: Design | Scenario, *, time: float | None = None) -> FrequencyResponse:
    """Compute frequency responses, margins and damping of each joint's loop, as `sdt-drake bode`.

        response = sdt.bode(sdt.load("coupled_pi"))
        print(response)  # bandwidth, margins, damping
        response.plot().savefig("bode.png")

    Args:
        design: a resolved scenario, or a scenario.
        time: linear where the motion is then [s]; by default for each joint where its inertia is
            largest for the first time.

    Raises:
        InputError: for a time beyond the motion, or a controller that cannot be linearised.
    """
    design = as_design(design)
    if time is None:
        return frequency_response(design)
    motion = design.motion
    if checked_number(time, "time", minimum=0) > motion.duration:
        raise InputError(f"{time:g} s, the motion ends at {motion.duration:g} s", place="time")
    return frequency_response(design, sample=round(time / motion.period))


def identify(
    robot: Robot | str | Path,
    recordings: Sequence[str | Path | Recorded] | str | Path | Recorded,
    *,
    validate: Sequence[str | Path | Recorded] | str | Path | Recorded = (),
    columns: str | Path | Columns | None = None,
    side: str | None = None,
    only: str | None = None,
    payload: str = "payload",
    cutoff: float | None = None,
    held_out: float = 1 / 3,
) -> Identified:
    """Identify a robot from recordings, as `sdt-drake identify`.

        found = sdt.identify("sdt", "run.csv")
        print(found)  # what is left of each joint's torque
        robot = sdt_drake.machine.identify.model.identified_robot(found)

    Args:
        robot: to start from, or its SDF or URDF file, or the name of one that ships.
        recordings: files with time [s], q_k [rad] and tau_k [N m] of every joint k, or what
            `read_recording` makes of them; one, or a list.
        validate: recordings to judge by; by default the end of each of the others.
        columns: what the files call their columns, or a mapping file that says so.
        side: of the torques, "joint" or "motor"; by default that of the motors in a recording of
            `simulate`, else of the joints.
        only: "payload" or "friction" to take all else as it is in the file.
        payload: the link that is meant by it.
        cutoff: below which torques are compared [Hz]; by default chosen from the recordings.
        held_out: share of each recording, at its end, to judge by where nothing is to validate [-].

    Returns:
        Parameters with their uncertainty, and `warnings` of what is suspicious. Figures and files
        are made of it by `sdt_drake.show.reports.identification` and `identified_files` beside it.

    Raises:
        InputError: naming the argument or the recording that cannot be used.
    """
    from sdt_drake.machine.identify import procedure  # which needs an extra

    if only is not None:
        checked_choice(only, FOUND, "only")
    if cutoff is not None:
        positive(cutoff, "cutoff")
    if checked_number(held_out, "held_out", minimum=0, exclusive=True) >= 1:
        raise InputError(f"held_out: {held_out:g}, expected less than 1")
    robot = robot if isinstance(robot, Robot) else load_robot(robot)
    named = _columns(columns)
    fitted, judged = (
        [_recorded(one, name, robot, named, ("q", "tau"), side) for one in _each(given)]
        for name, given in (("recordings", recordings), ("validate", validate))
    )
    if not fitted:
        raise InputError("recordings: none given, expected at least one")
    return procedure.identify(
        robot,
        fitted,
        validate=judged,
        only=only,
        payload=payload,
        cutoff=cutoff,
        held_out=held_out,
    )


def replay(
    recording: str | Path | Recorded,
    scenario: Scenario,
    *,
    columns: str | Path | Columns | None = None,
    side: str | None = None,
) -> replaying.Replay:
    """Run a recorded reference through the loop of a scenario, as `sdt-drake replay`.

        replayed = sdt.replay("run.csv", sdt.load("coupled_pi_ctc"))
        print(replayed)  # what of the recording the simulation explains
        replayed.plot().savefig("replay.png")

    Args:
        recording: a file with the reference (q_ref_k [rad] or v_ref_k [rad/s]) and what was
            measured (some of q_k, v_k, joint side, and tau_k [N m]), or what `read_recording` makes
            of it.
        scenario: whose robot and loop it is; its motion has no say.
        columns, side: as of `identify`.

    Returns:
        The recording beside simulations of it: as the scenario is, and with one thing changed.

    Raises:
        InputError: naming the argument or the recording that cannot be used.
    """
    checked_type(scenario, Scenario, "scenario", "sdt_drake.load")
    robot = load_device(scenario)
    recorded = _recorded(recording, "recording", robot, _columns(columns), (), side)
    return replaying.replay(scenario, recorded, robot)


def learn(
    design: Design | Scenario,
    *,
    flights: int = 5,
    of: str = "reference",
    bandwidth: float | None = None,
    study: str | Path | None = None,
    draws: int = 20,
    stops: bool = True,
    report: Callable[[flying.Lessons], None] = lambda lessons: None,
    trust: bool = False,
) -> flying.Lessons:
    """Fly a motion several times and learn from its errors, as `sdt-drake learn`.

        design = sdt.design(sdt.load("wrong_model", {"controller.kind": "p_pi"}))
        lessons = sdt.learn(design, flights=3)
        print(lessons)  # the error of each flight
        better = design.given(lessons.best.learned)

    Args:
        design: a resolved scenario, or a scenario.
        flights: at most, with the first one.
        of: what is learned, "reference" or "torque".
        bandwidth: up to which errors are learned [Hz]; by default as far as the model is trusted.
        study: file or name of a study whose variables are the uncertainty of the device, which
            learning must converge for.
        draws: devices of the study to check, at most.
        stops: whether to stop where another flight is not worth it.
        report: called after each flight, with all so far.
        trust: whether the Python file that the study's scenario may name is run unasked.

    Raises:
        InputError: naming the argument that is none; if learning would not converge.
    """
    checked_count(flights, "flights")
    design = as_design(design)
    with trusting(trust):
        filter_, checks = learning_filter(design, of, bandwidth=bandwidth, study=study, draws=draws)
    refuse_divergence(checks, filter_)
    return flying.learn(design, filter_, flights, stops=stops, report=report)


def learning_filter(
    design: Design,
    of: str,
    *,
    bandwidth: float | None = None,
    study: str | Path | None = None,
    draws: int = 20,
) -> tuple[LearningFilter, list[Convergence]]:
    """The filter to learn with, and how it converges on each set of loops; arguments as of
    `learn`."""
    checked_choice(of, LEARNED, "of")
    checked_count(draws, "draws")
    devices = {}
    if study is not None:
        drawn, base = load_study(study)
        devices[f"the devices of {drawn.name}"] = devices_of(design, drawn, base, draws)
    loops = loops_of(design, of, devices=devices)
    omega = None if bandwidth is None else 2 * np.pi * checked_number(bandwidth, "bandwidth")
    filter_ = design_filter(design, loops, of, bandwidth=omega)
    return filter_, [convergence(filter_, group) for group in loops]


@takes(folder=a_path)
def export(
    design: Design | Scenario,
    drives: drive_files.Drives | str | Path,
    folder: str | Path,
    *,
    cam_points: int = 1000,
    title: str = "",
) -> list[drive_files.Fed]:
    """Write a motion as drives, PLCs and ROS 2 read it, as `sdt-drake export`.

        fed = sdt.export(sdt.load("training"), "drives", "exported")
        print(fed[1].source, fed[1].position_error)  # [rad], joint side

    Args:
        design: whose motion it is, or its scenario.
        drives: of the joints, or a file of them, or the name of one that ships; motor side.
        folder: for the files, made if it is not there.
        cam_points: the most points of the cam table.
        title: of the motion; that of the scenario by default.

    Returns:
        What the loop of the design makes of the motion, and of what each file holds.

    Raises:
        InputError: naming the argument or the file that cannot be used; for a motion that does not
            start and end at rest, or is beyond what a drive takes.
    """
    if checked_count(cam_points, "cam_points") < 2:
        raise InputError(f"cam_points: {cam_points}, expected at least 2")
    design, source, folder = as_design(design), "drives", Path(folder)
    if not isinstance(drives, drive_files.Drives):
        source = str(a_path(drives, "drives"))
        drives = drive_files.load_drives(drives, design.robot.n)
    checked_output(folder / drive_files.READ_BACK)
    title = title or design.scenario.name
    with replacing_files(folder) as new:
        exported = drive_files.export(
            design, drives, new, cam_points=cam_points, title=title, source=source
        )
        fed = drive_files.feed(design, drives, exported)
        drive_files.write_read_back(new / drive_files.READ_BACK, fed)
    return fed


# --- recordings ----------------------------------------------------------------------------------


def _each(
    given: Sequence[str | Path | Recorded] | str | Path | Recorded,
) -> Sequence[str | Path | Recorded]:
    """One recording, or several, as a list."""
    return [given] if isinstance(given, str | Path | Recorded) else given


def _columns(columns: str | Path | Columns | None) -> Columns | None:
    if columns is None or isinstance(columns, Columns):
        return columns
    return load_columns(cast("str | Path", a_path(columns, "columns")))


def _recorded(
    given: str | Path | Recorded,
    name: str,
    robot: Robot,
    columns: Columns | None,
    needs: Sequence[str],
    side: str | None,
) -> Recorded:
    """A recording itself, or that of a file."""
    if isinstance(given, Recorded):
        return given
    if side is not None:
        checked_choice(side, SIDES, "side")
    path = cast("str | Path", a_path(given, name))
    return read_recording(path, robot, columns, needs=needs, side=side)
