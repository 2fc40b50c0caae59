"""The command `plan`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.cli.common import (
    Held,
    Motion,
    OptionalTarget,
    OtherRobot,
    Out,
    Show,
    Trust,
    number,
    one_of,
)
from sdt_drake.cli.printing import echo, print_joints
from sdt_drake.io.errors import InputError, within
from sdt_drake.io.shown import formatted

if TYPE_CHECKING:
    from sdt_drake.motion import Margins, Plan
    from sdt_drake.robot.robot import Robot as RobotModel

Planner = Literal["limiter", "retiming"]

_MIN_ANGLE_LOST = 0.1  # deg; smaller ones are not printed


def run(
    motion: Motion = common.MOTION,
    /,
    *,
    robot: OtherRobot = None,
    period: float = 0.005,
    planner: Planner = "limiter",
    torque_margin: Annotated[float, number(gt=0, lte=1)] = 1.0,
    envelope: Annotated[str | None, one_of("scenario")] = None,
    stoppable: Annotated[str | None, one_of("stops")] = None,
    drive_table: Annotated[OptionalTarget, Parameter(metavar="FILE.csv")] = None,
    out: Out = None,
    show: Show = False,
    trust: Trust = False,
    held: Held = Held(),
) -> None:
    """Plan a motion within the limits of the motors' torques.

    example: sdt-drake plan graveyard_spin --planner retiming --out motion.csv

    Args:
        period: interpolation period [s]
        planner: planner for motors that are too weak: `limiter` slows down single joints for a
            while, `retiming` slows down all joints and keeps the path
        torque_margin: share of the motors' torque to use, in (0, 1]
        envelope: scenario whose device has a torque-speed envelope (of its motors, or from
            drive.n1 and n0); the motion is planned for that device
        stoppable: file of emergency stops with limits; the motion is slowed down until the stops
            from all its instants are within them, or refused
        drive_table: file for positions, speeds and feedforward torques of the motors (motor side,
            SI units); `export` writes files for drives
        out: motion file (.csv), or file for a figure of torques and speeds (.png, .svg, .pdf)
    """
    from sdt_drake.machine.drive_files.formats import write_drive_table
    from sdt_drake.machine.drive_files.set_points import samples_of
    from sdt_drake.motion import load_plan, margins
    from sdt_drake.robot.rotors import without_friction

    common.check_out(out, show, [".csv"])
    if drive_table is not None:
        with within("--drive-table"):
            common.check_file(drive_table, [".csv"])
        if out is not None and drive_table.resolve() == out.resolve():
            text = f"--drive-table: {drive_table} is the file of --out too, expected another file"
            raise InputError(text)
    if envelope is not None:
        common.refuse("has no effect with --envelope", hold=held.hold, tip=held.tip)
    model = held.load(robot) if envelope is None else driven(envelope, robot)
    plan = load_plan(motion, model, period=period, torque_margin=torque_margin, planner=planner)
    slower = 1.0
    if stoppable is not None:
        plan, slower = _stoppable(plan, model, stoppable, envelope)
    report = margins(model, plan.motion)
    if drive_table:
        with within(drive_table):
            samples = samples_of(model, plan.motion, plan.motion.period)
        write_drive_table(drive_table, model, samples)
    _print_report(motion, planner, model, plan, report)
    if line := without_friction(model):
        echo(f"note: {line}")
    if stoppable is not None:
        slowed = f", {slower:.3g} times as slow as planned" if slower > 1 else ""
        echo(f"Its emergency stops are within the limits of {stoppable}{slowed}. {CAUTION}")
    if drive_table:
        echo(f"{drive_table} written")
    title = f"{Path(motion).name}, {planner}: {_duration(plan)}"
    drawn = title, model, plan, report
    common.deliver(out, show, lambda: sdt.plots_motion.plan(*drawn), plan.motion.to_csv)


CAUTION = "No statement on safety."


def _stoppable(
    plan: Plan, robot: RobotModel, stops: str, envelope: str | None
) -> tuple[Plan, float]:
    """Return the plan, slow enough for its emergency stops, and its factor on the duration."""
    from sdt_drake.analysis.stop_setting import make_setting
    from sdt_drake.analysis.stops import stoppable
    from sdt_drake.motion.plan import checked_plan
    from sdt_drake.robot.motors import DeviceChoice

    device = DeviceChoice() if envelope is None else sdt.load(envelope).device
    with within("--stoppable"):
        setting = make_setting(robot, stops, device)
        if setting.stopping.limits.is_none:
            raise InputError(f"{stops}: no limits, expected one that the stops keep")
        motion, slower = stoppable(setting, plan.motion)
    if slower > 1:
        slow = checked_plan(robot, motion, plan.commanded, plan.torque_margin)
        plan = replace(slow, loss=plan.loss)
    return plan, slower


def driven(path: str, robot: str | None) -> RobotModel:
    """Return the device of the scenario that --envelope names.

    Raises:
        InputError: if it has no torque-speed envelope, or --robot is given too.
    """
    from sdt_drake.robot.motors import as_driven
    from sdt_drake.run.design import load_device

    common.refuse(f"has no effect with --envelope, since {path} names the robot", robot=robot)
    scenario = sdt.load(path)
    model = as_driven(load_device(scenario), scenario.drive)
    if model.envelope is None or not model.envelope.limits:
        raise InputError(
            f"{path}: no torque-speed envelope, expected drive.n1 and drive.n0, or device.motors "
            "with speeds in their catalogue"
        )
    return model


def _duration(plan: Plan) -> str:
    text = f"{plan.motion.duration:g} s"
    return text if plan.longer <= 0 else f"{text}, {plan.longer:g} s longer than commanded"


def _print_ends(planner: Planner, robot: RobotModel, plan: Plan) -> None:
    """Print joints that do not end at the commanded angle, or do not start and end at rest."""
    import numpy as np

    from sdt_drake.motion import ends_in_motion

    # The retiming rounds its time up: a motion that ends at speed continues a little.
    lost = np.degrees(plan.angle_lost) if planner == "limiter" else np.zeros(robot.n)
    for k in np.flatnonzero(lost > _MIN_ANGLE_LOST).tolist():
        echo(
            f"{robot.joint(k)} ends {lost[k]:.1f} deg from the commanded angle; the limiter does "
            "not catch up. To keep the path: --planner retiming"
        )
    moving = ends_in_motion(robot, plan.motion)
    if moving:
        echo(f"not at rest: {', '.join(moving)}")


def _print_report(
    name: str, planner: Planner, robot: RobotModel, plan: Plan, report: Margins
) -> None:
    import numpy as np

    motion = plan.motion
    share = f" with {100 * plan.torque_margin:.4g} % of the motors' torque"
    share *= plan.torque_margin != 1
    place = report.smallest
    echo(
        f"{name}: {_duration(plan)}, feasible{share}; smallest margin "
        f"{formatted(100 * place.left, '.1f')} % of the whole limit, {place.quantity} of "
        f"{robot.joint(place.joint)} at {place.time:.3f} s"
    )
    if robot.envelope is not None:
        echo(f"within the torque-speed envelope of {robot.envelope.source}")
    _print_ends(planner, robot, plan)
    if plan.loss is not None:
        loss = plan.loss
        j, k = int(loss.speed.argmax()), int(loss.position.argmax())
        longer = f" and {loss.longer:.3g} s longer" if loss.longer > 1e-6 else ""
        echo(
            f"resampled at {motion.period:g} s{longer}: at most {loss.speed[j]:.3g} rad/s lost "
            f"(joint {j + 1}, {loss.speed_time[j]:.3f} s) and {loss.position[k]:.3g} rad (joint "
            f"{k + 1}, {loss.position_time[k]:.3f} s)"
        )
    angles, speed = np.degrees(motion.q), np.abs(motion.v).max(axis=0)
    fastest = np.where(np.isfinite(robot.top_speed), robot.top_speed, np.nan)
    tightest = [
        f"{place.quantity}, {formatted(100 * place.share, '.1f')} % at {place.time:.3f} s"
        for place in map(report.tightest, range(robot.n))
    ]
    print_joints(
        robot.joint_names,
        [
            ("torque [N m]", ".1f", report.peak_torque),
            ("of motor [%]", ".1f", 100 * report.peak_torque / robot.effort_limit),
            ("RMS [%]", ".1f", 100 * report.rms_torque / robot.effort_limit),
            ("held [s]", ".3f", plan.limited.sum(axis=0) * motion.period),
            ("speed [rad/s]", ".3f", speed),
            ("of limit [%]", ".1f", 100 * speed / fastest),
            ("from [deg]", ".1f", angles.min(axis=0)),
            ("to [deg]", ".1f", angles.max(axis=0)),
            ("tightest", "", tightest),
        ],
    )
    for k in np.flatnonzero(np.isfinite(report.to_stop)).tolist():
        echo(f"joint {k + 1} comes within {np.degrees(report.to_stop[k]):.1f} deg of a stop")
    growth = report.growth / robot.effort_limit
    k = int(growth.argmax())
    echo(
        "Torques are the largest per joint (joint side, with the motors' inertia). held: time in "
        "which the limiter slows down the joint, or the retiming all joints"
    )
    most = "less than 0.0001" if growth[k] < 1e-6 else f"up to {100 * growth[k]:.2g}"
    echo(
        f"Between the {len(motion.time)} samples, peak torques exceed those at the samples by "
        f"{most} % of the motor (joint {k + 1})."
    )
