"""Export a motion in all formats, and simulate the loop fed from each file."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sdt_drake.io.arguments import MAX_PERIODS, a_path, instance_of, takes, whole_number
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, within
from sdt_drake.io.files import checked_output, replacing_files, write_text
from sdt_drake.io.markdown import escaped
from sdt_drake.io.results import Results
from sdt_drake.io.versions import versions
from sdt_drake.machine.drive_files import formats, set_points
from sdt_drake.machine.drive_files.drives import Drives, load_drives
from sdt_drake.motion import Motion
from sdt_drake.run.design import Design, as_design, make_design
from sdt_drake.run.scenario import Scenario
from sdt_drake.run.simulate import simulate
from sdt_drake.run.threads import threads
from sdt_drake.run.tuning import Feedforward

CSV, ST, CAM, TRAJECTORY = "set_points.csv", "set_points.st", "cam.csv", "trajectory.yaml"
READ_BACK, READ_ME = "read_back.csv", "README.md"
FILES = (CSV, ST, CAM, TRAJECTORY, READ_BACK, READ_ME)
"""Files of an exported motion. READ_BACK has the errors of loops that are fed from the others."""


@dataclass(frozen=True, eq=False)
class Exported:
    """The contents of the files of an exported motion."""

    samples: set_points.Samples
    """Samples of the motion at the drive period."""
    points: set_points.SetPoints
    """Integers in CSV and ST."""
    cam: set_points.Integers
    """Integers in CAM, see `formats.cam_table`."""
    own: set_points.Samples
    """Samples in TRAJECTORY, at the interpolation period; without `effort` their torques are 0."""


@dataclass(frozen=True, eq=False)
class Playback:
    """A run whose loop is fed from a file, compared with the planned motion; joint side."""

    source: str
    """Name of the file, or "motion"."""
    has_torque: bool
    """True if a torque is fed forward."""
    position_off: Array
    """Largest distance of the file's positions from the exported motion [rad], shape (n,)."""
    position_error: Array
    """Largest position error of the run against the planned motion [rad], shape (n,)."""
    speed_error: Array
    """RMS speed error of the run against the planned motion [rad/s], shape (n,)."""


@takes(folder=a_path, title=instance_of(str))
def export(
    design: Design | Scenario,
    drives: Drives | str | Path,
    folder: str | Path,
    *,
    cam_points: int = 1000,
    effort: bool = False,
    title: str = "",
) -> list[Playback]:
    """Write a motion as files for drives, PLCs and ROS 2, as `sdt-drake export`.

    Args:
        design: a scenario or its design, which gives the motion and the loop.
        drives: data of the joints' drives (motor side), a file, or the name of a shipped one.
        folder: folder for the files, made if it does not exist.
        cam_points: largest number of points of the cam table.
        effort: True for torques in the trajectory of ROS 2. Its joint_trajectory_controller
            rejects them unless it commands effort.
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
    if whole_number(cam_points, "cam_points") < 2:
        raise InputError(f"{cam_points}, expected at least 2", place="cam_points")
    design, source, folder = as_design(design), "drives", Path(folder)
    if not isinstance(drives, Drives):
        source = str(a_path(drives, "drives"))
        drives = load_drives(drives, design.device.simulated.n)
    checked_output(folder / READ_BACK)
    title = title or design.scenario.name
    with replacing_files(folder) as new:
        exported = write_files(
            design,
            drives,
            new,
            cam_points=cam_points,
            effort=effort,
            title=title,
            source=source,
        )
        played = play_back(design, drives, exported)
        write_read_back(new / READ_BACK, played)
    return played


def write_files(
    design: Design,
    drives: Drives,
    folder: Path,
    *,
    cam_points: int,
    title: str,
    effort: bool = False,
    source: str = "drives",
) -> Exported:
    """Write the motion of a design as CSV, ST, CAM, TRAJECTORY and READ_ME; all files or none.

    Torques are the nominal robot's inverse dynamics. With a learned reference, motion and torques
    are those of its flights.

    Args:
        design: design with the motion.
        drives: drives of its joints.
        folder: folder for the files.
        cam_points: maximum number of points of the cam table.
        title: title of the motion, for the function block and messages.
        effort: True for torques in TRAJECTORY.
        source: file of the drives, for messages.

    Returns:
        The contents of the files.

    Raises:
        InputError: for a motion that does not start and end at rest, too short a cycle time, or
            numbers beyond the limits of a drive.
    """
    robot, motion = design.device.nominal, design.reference.tracked
    if motion.duration > MAX_PERIODS * drives.cycle_time:
        raise InputError(
            f"{source}: cycle_time: {drives.cycle_time:g} s, expected at least "
            f"{motion.duration / MAX_PERIODS:g} s for a motion of {motion.duration:g} s"
        )
    with within(title):
        samples = _commanded(design, drives.cycle_time)
        own = _commanded(design, motion.period)
    own = own if effort else replace(own, tau=np.zeros_like(own.tau))
    still = _commanded(design, drives.cycle_time, still=True)
    with within(source):
        points = set_points.set_points(robot, drives, samples)
        rest = set_points.set_points(robot, drives, still)
    cam = formats.cam_table(robot, drives, samples, cam_points)
    with replacing_files(folder) as new:
        formats.write_csv(new / CSV, drives, points)
        formats.write_st(new / ST, drives, points, rest, title)
        formats.write_cam(new / CAM, cam)
        formats.write_trajectory(new / TRAJECTORY, robot, own, motion.vd, effort=effort)
        _write_read_me(new / READ_ME, design, drives, points, title)
    return Exported(samples, points, cam, own)


def _write_read_me(
    path: Path, design: Design, drives: Drives, points: set_points.SetPoints, title: str
) -> None:
    """Write what an engineer needs to know before the drives play the files."""
    robot = design.device.nominal
    axes, homing = [], []
    for k, (name, axis) in enumerate(zip(robot.joint_names, drives.axes, strict=True)):
        gear = axis.gear_ratio or robot.gear_ratio[k]
        torque = f"0.1 % of {axis.rated_torque:g} N m"
        cells = (axis.increments, f"{gear:g}", axis.sign, axis.speed_unit, torque)
        axes.append((k + 1, name, *cells, ", ".join(axis.objects)))
        first, last = points.position[[0, -1], k]
        start = f"{np.degrees(design.reference.tracked.q[0, k]):g}"
        homing.append((k + 1, name, axis.zero, first, start, last))
    text = Path(__file__).with_name("export.md").read_text(encoding="utf-8")
    values = {
        "title": escaped(title),
        "version": versions()["package"],
        "duration": design.reference.tracked.duration,
        "cycle": 1e3 * drives.cycle_time,
        "rows": len(points.position),
        "axes": _rows(axes),
        "homing": _rows(homing),
    }
    write_text(path, text.format(**values))


def _rows(rows: Sequence[Sequence[object]]) -> str:
    return "\n".join(f"| {' | '.join(map(escaped, row))} |" for row in rows)


def _commanded(design: Design, period: float, *, still: bool = False) -> set_points.Samples:
    """Return the exported samples of a design, or those of its standstill before the motion.

    A learned reference already compensates for its loop's errors. Torques that this loop did not
    have would compensate twice. So they are then those of the loop, not inverse dynamics.
    """
    robot, motion = design.device.nominal, design.reference.tracked
    feedforward = design.tuning.feedforward
    is_learned = design.reference.torque is not None or motion is not design.reference.planned
    tau_ff = feedforward.along
    if still:
        rest = np.zeros((2, robot.n))
        motion, tau_ff = Motion.from_speeds(period, motion.q[0], rest), rest + feedforward.steady
    torque = np.zeros_like(motion.q) if tau_ff is None else tau_ff * robot.gear_ratio
    return set_points.samples_of(robot, motion, period, torque if is_learned else None)


def cycles_in_a_period(design: Design, drives: Drives) -> int:
    """Return the number of drive cycles per period of the loop that is fed from the files."""
    return max(1, round(design.reference.tracked.period / drives.cycle_time))


def play_back(design: Design, drives: Drives, exported: Exported) -> list[Playback]:
    """Simulate the scenario's loop fed from the motion and from each file of `export`.

    The loop's period is the multiple of the drive period nearest to the interpolation period, with
    the mean of the speeds in between. For TRAJECTORY it is the interpolation period.
    """
    robot, whole = design.device.nominal, exported.samples
    m = cycles_in_a_period(design, drives)
    exact = _commanded(design, m * drives.cycle_time)
    points = set_points.samples_from(robot, drives, exported.points, whole.q[0])
    cam = formats.samples_from_cam(robot, drives, exported.cam)
    nothing = np.zeros(robot.n)
    off = {x: np.abs(y.q - whole.q).max(axis=0) for x, y in ((CSV, points), (CAM, cam))}
    sources = {
        "motion": exact,
        CSV: points.every(m),
        TRAJECTORY: exported.own,
        "motion, no torque": replace(exact, tau=np.zeros_like(exact.tau)),
        CAM: cam.every(m),
    }
    with threads(2) as pool:
        motion, csv, *others = pool.map(
            lambda name: _playback(design, name, sources[name], off.get(name, nothing)), sources
        )
    return [motion, csv, replace(csv, source=ST), *others]  # CSV and ST have the same integers


def _playback(
    design: Design, source: str, samples: set_points.Samples, position_off: Array
) -> Playback:
    """Simulate the loop fed from samples."""
    made = _with_samples(design, samples)
    recording = simulate(made)
    wanted = set_points.samples_of(design.device.nominal, design.reference.planned, samples.period)
    return Playback(
        source,
        made.tuning.feedforward.along is not None,
        position_off,
        np.abs(recording.q - wanted.q).max(axis=0),
        np.sqrt(np.mean((recording.v - wanted.v) ** 2, axis=0)),
    )


def _with_samples(design: Design, samples: set_points.Samples) -> Design:
    """Return the design with samples as its reference and torque feedforward, if any."""
    period, v = samples.period, samples.v
    vd = np.vstack([np.diff(v, axis=0) / period, np.zeros_like(v[:1])])
    scenario = replace(design.scenario, learned="")
    made = make_design(
        scenario, robot=design.device.nominal, motion=Motion(period, samples.q, v, vd)
    )
    if not np.any(samples.tau) or not design.scenario.controller.takes_feedforward:
        return replace(made, feedforward_override=Feedforward())
    return made.with_feedforward(samples.tau / design.device.simulated.gear_ratio)


def write_read_back(path: Path, played: Sequence[Playback]) -> None:
    """Write the results of `play_back` as CSV: a row for each source and joint, full precision."""
    n = len(played[0].position_off)
    columns = {
        "source": np.repeat([x.source for x in played], n),
        "torque": np.repeat([int(x.has_torque) for x in played], n),
        "joint": np.tile(np.arange(1, n + 1), len(played)),
        "position_off_rad": np.concatenate([x.position_off for x in played]),
        "position_error_rad": np.concatenate([x.position_error for x in played]),
        "rms_speed_error_rad_s": np.concatenate([x.speed_error for x in played]),
    }
    Results({}, columns).write(path)
