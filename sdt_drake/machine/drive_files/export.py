"""Exporting a motion in all formats, and what a loop makes of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sdt_drake.analysis.threads import threads
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import MAX_PERIODS, InputError, within
from sdt_drake.io.files import replacing_files
from sdt_drake.io.results import Results
from sdt_drake.machine.drive_files import formats
from sdt_drake.machine.drive_files.drives import Drives
from sdt_drake.machine.drive_files.set_points import (
    Integers,
    Samples,
    SetPoints,
    samples_from,
    samples_of,
    set_points,
)
from sdt_drake.motion import Motion
from sdt_drake.run.design import Design, make_design
from sdt_drake.run.simulate import simulate
from sdt_drake.run.tuning import Feedforward

CSV, ST, CAM, TRAJECTORY = "set_points.csv", "set_points.st", "cam.csv", "trajectory.yaml"
READ_BACK = "read_back.csv"
FILES = (CSV, ST, CAM, TRAJECTORY, READ_BACK)
"""Files of an exported motion, with what a loop made of them."""


@dataclass(frozen=True, eq=False)
class Exported:
    """What the files of an exported motion hold.

    Attributes:
        samples: of the motion, in each cycle of the drives.
        points: integers of CSV and ST.
        cam: integers of CAM, see `formats.cam_table`.
        own: samples of TRAJECTORY.
    """

    samples: Samples
    points: SetPoints
    cam: Integers
    own: Samples


@dataclass(frozen=True, eq=False)
class Fed:
    """A loop that is fed from a file, judged by the planned motion; joint side, shape (n,) each.

    Attributes:
        source: the file, or the motion.
        has_torque: whether a torque is fed forward.
        position_off: how far its positions are from the motion that was exported, at most, in all
            cycles [rad].
        position_error: largest of the run, against the planned motion [rad].
        speed_error: RMS of the run, likewise [rad/s].
    """

    source: str
    has_torque: bool
    position_off: Array
    position_error: Array
    speed_error: Array


def export(
    design: Design,
    drives: Drives,
    folder: Path,
    *,
    cam_points: int,
    title: str,
    source: str = "drives",
) -> Exported:
    """Write the motion of a design for its drives: CSV, ST, CAM and TRAJECTORY; all or none.

    Args:
        design: whose motion it is, and whose nominal robot's inverse dynamics are the torques; with
            what flights have taught, it is that motion, with the torques that they fed forward.
        drives: of its joints.
        folder: for the files.
        cam_points: the most points of the cam table.
        title: of the motion: that of the function block, and for errors.
        source: of the drives, for errors.

    Returns:
        What the files hold.

    Raises:
        InputError: for a motion from or to motion, a cycle that is a million times in it, or
            numbers beyond what a drive takes.
    """
    robot, motion = design.nominal, design.motion
    if motion.duration > MAX_PERIODS * drives.cycle_time:
        raise InputError(
            f"{source}: cycle_time: {drives.cycle_time:g} s, expected at least a {MAX_PERIODS}th "
            f"of the motion's {motion.duration:g} s"
        )
    with within(title):
        samples = _commanded(design, drives.cycle_time)
        own = _commanded(design, motion.period)
    still = _commanded(design, drives.cycle_time, still=True)
    with within(source):
        points = set_points(robot, drives, samples)
        rest = set_points(robot, drives, still)
    cam = formats.cam_table(robot, drives, samples, cam_points)
    with replacing_files(folder) as new:
        formats.write_csv(new / CSV, drives, points)
        formats.write_st(new / ST, drives, points, rest, title)
        formats.write_cam(new / CAM, cam)
        formats.write_trajectory(new / TRAJECTORY, robot, own, motion.vd)
    return Exported(samples, points, cam, own)


def _commanded(design: Design, period: float, *, still: bool = False) -> Samples:
    """What is exported of a design, or how it stands still before.

    What flights have taught makes good for what their loop lacks: with torques that it did not
    have, it would be made good for twice.
    """
    robot, motion, tau_ff = design.nominal, design.motion, design.tau_ff
    taught = design.learned_torque is not None or motion is not design.wanted
    if still:
        rest = np.zeros((2, robot.n))
        motion, tau_ff = Motion.from_speeds(period, motion.q[0], rest), rest + design.steady_ff
    torque = np.zeros_like(motion.q) if tau_ff is None else tau_ff * robot.gear_ratio
    return samples_of(robot, motion, period, torque if taught else None)


def cycles_in_a_period(design: Design, drives: Drives) -> int:
    """Of the drives, in a period of the loop that is fed from their files."""
    return max(1, round(design.motion.period / drives.cycle_time))


def feed(design: Design, drives: Drives, exported: Exported) -> list[Fed]:
    """Feed the scenario's loop from the motion and from what each file of `export` holds.

    The loop runs at the multiple of the drives' cycle that is nearest to the scenario's period,
    with the mean of the speeds in between; from TRAJECTORY at the period of the motion.
    """
    robot, whole = design.nominal, exported.samples
    m = cycles_in_a_period(design, drives)
    exact = _commanded(design, m * drives.cycle_time)
    points = samples_from(robot, drives, exported.points, whole.q[0])
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
            lambda name: _fed(design, name, sources[name], off.get(name, nothing)), sources
        )
    return [motion, csv, replace(csv, source=ST), *others]  # these two hold the same integers


def _fed(design: Design, source: str, samples: Samples, position_off: Array) -> Fed:
    made = _fed_with(design, samples)
    recording = simulate(made)
    wanted = samples_of(design.nominal, design.wanted, samples.period)
    return Fed(
        source,
        made.tau_ff is not None,
        position_off,
        np.abs(recording.q - wanted.q).max(axis=0),
        np.sqrt(np.mean((recording.v - wanted.v) ** 2, axis=0)),
    )


def _fed_with(design: Design, samples: Samples) -> Design:
    """The design with another reference and torque feedforward, or none."""
    period, v = samples.period, samples.v
    vd = np.vstack([np.diff(v, axis=0) / period, np.zeros_like(v[:1])])
    scenario = replace(design.scenario, learned="")
    made = make_design(scenario, robot=design.nominal, motion=Motion(period, samples.q, v, vd))
    if not np.any(samples.tau) or not design.scenario.controller.takes_feedforward:
        return replace(made, fed=Feedforward())
    return made.with_feedforward(samples.tau / design.robot.gear_ratio)


def write_read_back(path: Path, fed: Sequence[Fed]) -> None:
    """Write what `feed` found as CSV: a row for each source and joint, joint side, exactly."""
    n = len(fed[0].position_off)
    columns = {
        "source": np.repeat([x.source for x in fed], n),
        "torque": np.repeat([int(x.has_torque) for x in fed], n),
        "joint": np.tile(np.arange(1, n + 1), len(fed)),
        "position_off_rad": np.concatenate([x.position_off for x in fed]),
        "position_error_rad": np.concatenate([x.position_error for x in fed]),
        "rms_speed_error_rad_s": np.concatenate([x.speed_error for x in fed]),
    }
    Results({}, columns).write(path)
