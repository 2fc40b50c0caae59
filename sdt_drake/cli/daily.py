"""The functions tune, bode, identify, replay, learn and export of `sdt_drake`.

Each computes what the command of its name prints, and returns it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from sdt_drake.analysis.frequency_response import FrequencyResponse, frequency_response
from sdt_drake.analysis.reproduction import tuning
from sdt_drake.io.arguments import a_path, like, positive, takes
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

ONLY = ("payload", "friction")


def tune(design: Design | Scenario) -> dict[str, Array]:
    """Return the effective inertia along a motion and the tuned gains, as `sdt-drake tune`.

    >>> import sdt_drake as sdt
    >>> sdt.tune(sdt.load("axis_pi"))["ki"].round()  # [N m/rad], motor side
    array([  4640., 107000., 867000., 273000.])

    Args:
        design: a scenario or its design.

    Returns:
        Arrays of shape (n,) by name, motor side. Inertia: i_eff_max, i_eff_median, i_eff_min
        [kg m²], variation_percent [%]. Gains: kp [N m s/rad], ki [N m/rad]. At each of the three
        inertias: damping ratio zeta_max, zeta_median, zeta_min [-] and natural frequency
        omega_n_max, omega_n_median, omega_n_min [rad/s]. At the largest: omega_0 [rad/s].

    Raises:
        InputError: if `design` is neither, or the scenario cannot be resolved.
    """
    return tuning(as_design(design))


def bode(design: Design | Scenario, *, time: float | None = None) -> FrequencyResponse:
    """Compute frequency responses, margins and damping of each joint's loop, as `sdt-drake bode`.

        response = sdt.bode(sdt.load("coupled_pi"))
        print(response)  # bandwidth, margins, damping
        response.plot().savefig("bode.png")

    >>> import sdt_drake as sdt
    >>> sdt.bode(sdt.load("axis_pi"), time=0).bandwidth.round(1)  # [rad/s], shape (n,)
    array([22.8, 21.9, 21.6, 22.9])

    Args:
        design: a scenario or its design.
        time: time of the motion at which the loops are linearised [s]. By default each joint's
            loop is linearised where its inertia is largest for the first time.

    Raises:
        InputError: for a time after the end of the motion, or a controller that cannot be
            linearised.
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

    Args:
        robot: the robot before identification, its SDF or URDF file, or the name of a shipped one.
        recordings: one recording or a list. Each is a file with time [s], q_k [rad] and tau_k
            [N m] of every joint k, or an object from `read_recording`.
        validate: held-out recordings; by default the end of each of `recordings` is held out.
        columns: names of the files' columns, or a YAML file with them.
        side: side of the torques, "joint" or "motor". The default is "motor" for a recording of
            `simulate` and "joint" for all others.
        only: "payload" or "friction" to identify it alone and take all else from the file.
        payload: the link that `only="payload"` identifies.
        cutoff: frequency below which torques are compared [Hz]; by default chosen from the
            recordings.
        held_out: share at the end of each recording that is held out without `validate` [-].

    Returns:
        Parameters with their uncertainty, and `findings` that speak against the recordings.
        `sdt_drake.show.reports.identification` writes figures and files of it.

    Raises:
        InputError: naming the wrong argument or recording.

    Examples:
        >>> import numpy as np
        >>> import sdt_drake as sdt
        >>> speeds = np.outer(np.sin(np.linspace(0, np.pi, 201)) ** 2, [0.1, 0.2, 0.2, 0.3])
        >>> motion = sdt.Motion.from_speeds(0.005, np.zeros(4), speeds)
        >>> design = sdt.design(sdt.load("real_device"), motion=motion)
        >>> sdt.simulate(design).to_csv("run.csv")
        >>> found = sdt.identify("sdt", "run.csv", only="friction")
        >>> print(found)
        Identified sdt from run.csv: torque not explained, in held-out data
        joint        by the file [%]  identified [%]
        1 planetary             6.16            0.02
        2 roll                 37.76            0.19
        3 pitch                12.14            0.02
        4 yaw                  19.56            0.05
    """
    from sdt_drake.machine.identify import procedure  # needs an extra

    if only is not None:
        checked_choice(only, ONLY, "only")
    if cutoff is not None:
        positive(cutoff, "cutoff")
    if checked_number(held_out, "held_out", minimum=0, exclusive=True) >= 1:
        raise InputError(f"held_out: {held_out:g}, expected less than 1")
    robot = robot if isinstance(robot, Robot) else load_robot(robot)
    named = _columns(columns)
    fitted, judged = (
        [_recorded(one, name, robot, named, ("q", "tau"), side) for one in _each(given, name)]
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
    """Simulate a recorded reference in the loop of a scenario, as `sdt-drake replay`.

    Args:
        recording: a file with the reference (q_ref_k [rad] or v_ref_k [rad/s], joint side) and
            measured signals (some of q_k, v_k, joint side, and tau_k [N m]), or an object from
            `read_recording`.
        scenario: gives the robot and the loop; its motion is not used.
        columns, side: as in `identify`.

    Returns:
        The recording and simulations of it: one of the scenario as it is, others with one change.

    Raises:
        InputError: naming the wrong argument or recording.

    Examples:
        >>> import numpy as np
        >>> import sdt_drake as sdt
        >>> speeds = np.outer(np.sin(np.linspace(0, np.pi, 201)) ** 2, [0.1, 0.2, 0.2, 0.3])
        >>> motion = sdt.Motion.from_speeds(0.005, np.zeros(4), speeds)
        >>> design = sdt.design(sdt.load("coupled_pi_ctc"), motion=motion)
        >>> sdt.simulate(design).to_csv("run.csv")
        >>> replayed = sdt.replay("run.csv", sdt.load("wrong_model"))
        >>> replayed.explained("speed_error").round(2)  # share of the recorded error
        array([1.  , 0.97, 1.  , 1.  ])
    """
    checked_type(scenario, Scenario, "scenario", "sdt_drake.load")
    robot = load_device(scenario)
    recorded = _recorded(recording, "recording", robot, _columns(columns), (), side)
    return replaying.replay(scenario, recorded, robot)


@takes(stops=like(bool), report=like(Callable))
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
    """Fly a motion several times and learn a reference from its errors, as `sdt-drake learn`.

    Args:
        design: a scenario or its design.
        flights: largest number of flights, the first included.
        of: the learned signal, "reference" or "torque".
        bandwidth: frequency up to which errors are learned [Hz]; by default as far as the
            controller's model is trusted.
        study: file or name of a study. Learning must converge for all devices that its variables
            give.
        draws: largest number of the study's devices to check.
        stops: whether to stop when another flight would not improve the result.
        report: function that is called after each flight with all flights so far.
        trust: whether a Python file that the study's scenario names is run without asking.

    Returns:
        All flights with their errors, the best of them, and the reason to stop.

    Raises:
        InputError: naming the wrong argument, or if learning would not converge.

    Examples:
        >>> import numpy as np
        >>> import sdt_drake as sdt
        >>> speeds = np.outer(np.sin(np.linspace(0, np.pi, 201)) ** 2, [0.1, 0.2, 0.2, 0.3])
        >>> motion = sdt.Motion.from_speeds(0.005, np.zeros(4), speeds)
        >>> scenario = sdt.load("wrong_model", {"controller.kind": "p_pi"})
        >>> lessons = sdt.learn(sdt.design(scenario, motion=motion), flights=2)
        >>> [float(np.rad2deg(flight.largest.max()).round(3)) for flight in lessons.flights]  # deg
        [0.058, 0.013]
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
    """Design the learning filter and check its convergence on each set of loops.

    The arguments are those of `learn`.
    """
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


@takes(folder=a_path, title=like(str))
def export(
    design: Design | Scenario,
    drives: drive_files.Drives | str | Path,
    folder: str | Path,
    *,
    cam_points: int = 1000,
    title: str = "",
) -> list[drive_files.Fed]:
    """Write a motion as files for drives, PLCs and ROS 2, as `sdt-drake export`.

    Args:
        design: a scenario or its design, which gives the motion and the loop.
        drives: data of the joints' drives (motor side), a file, or the name of a shipped one.
        folder: folder for the files, made if it does not exist.
        cam_points: largest number of points of the cam table.
        title: title of the motion; by default the scenario's name.

    Returns:
        Position errors of the design's loop with the planned motion, and with each file's content.

    Raises:
        InputError: naming the wrong argument or file. Also for a motion that does not start and end
            at rest, or exceeds the range of a drive.

    Examples:
        >>> import numpy as np
        >>> import sdt_drake as sdt
        >>> speeds = np.outer(np.sin(np.linspace(0, np.pi, 201)) ** 2, [0.1, 0.2, 0.2, 0.3])
        >>> motion = sdt.Motion.from_speeds(0.005, np.zeros(4), speeds)
        >>> design = sdt.design(sdt.load("coupled_pi_ctc"), motion=motion)
        >>> files = sdt.export(design, "drives", "exported")
        >>> files[1].source, float(np.rad2deg(files[1].position_error.max()).round(2))  # deg
        ('set_points.csv', 0.98)
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
    given: Sequence[str | Path | Recorded] | str | Path | Recorded, name: str
) -> Sequence[str | Path | Recorded]:
    """Return one or several recordings as a list."""
    if isinstance(given, str | Path | Recorded):
        return [given]
    if not isinstance(given, Sequence):
        raise InputError(f"{name}: a {type(given).__name__}, expected a path or a list of paths")
    return given


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
    """Return a recording, read from its file if needed."""
    if isinstance(given, Recorded):
        return given
    if side is not None:
        checked_choice(side, SIDES, "side")
    path = cast("str | Path", a_path(given, name))
    return read_recording(path, robot, columns, needs=needs, side=side)
