"""The scope: what each joint of a run was asked for, did, and took of its motor, over time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from sdt_drake.io.arguments import chosen_joints
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.run.design import Design
from sdt_drake.run.motor_torque import arrived, envelope, torque_limits
from sdt_drake.run.simulate import Recording
from sdt_drake.show.panels import LIMIT, Line, Lines, Panel, over_time, picture
from sdt_drake.show.style import LOOKS, PALETTE, Look, joint_title

ACHIEVED = Look(PALETTE[1], "--")
_ERROR, _TORQUE = Look(PALETTE[2]), Look(PALETTE[6])


def scope(
    title: str, recording: Recording, design: Design | None = None, joint: int | None = None
) -> Figure:
    """Speed, speed error, position error and torque over time, a column for each joint.

    Args:
        title: of the figure.
        recording: of a run.
        design: of the same run; without it joints have no names, and torques no limits.
        joint: 1..n, to show that one alone.

    Raises:
        InputError: if there is no such joint, or the design has other joints than the recording.
    """
    n = recording.q.shape[1]
    if design is not None and design.robot.n != n:
        raise InputError(f"design: {design.robot.n} joint(s), expected {n} as in the recording")
    joints = chosen_joints(joint, n)
    names = [""] * n if design is None else design.robot.joint_names
    columns = joint_columns(recording, design, names)
    return picture(title, [columns[k] for k in joints])


def joint_columns(
    recording: Recording, design: Design | None, joint_names: Sequence[str] = ()
) -> list[list[Panel]]:
    """Speed, speed error, position error and torque over time, a column for each joint.

    Args:
        recording, design: as in `scope`.
        joint_names: n names, of the titles; none for columns without.
    """
    run, torques = recording, [("motor torque", _TORQUE, recording.tau)]
    if design is not None:
        lower, upper = limits_along(run, design)
        limits = [("limits of the motor", LIMIT, upper), ("_lower limit", LIMIT, lower)]
        torques = limits + torques
    speeds = [("reference", LOOKS["reference"], run.v_ref), ("achieved", ACHIEVED, run.v)]

    saturated = run.saturated > 0  # in the period that ends there
    saturated[:-1] |= saturated[1:]

    def row(y_label: str, lines: Lines, names: Sequence[str] = ()) -> list[Panel]:
        return over_time(y_label, run.time, lines, names, marked=saturated, marked_label=SATURATED)

    rows = [
        row("speed [rad/s]", speeds, joint_names),
        row("speed error [rad/s]", [("error", _ERROR, run.speed_error)]),
        row("position error [deg]", [("error", _ERROR, np.degrees(run.position_error))]),
        row("motor torque [N m]", torques),
    ]
    return list(map(list, zip(*rows, strict=True)))


def position_panels(recording: Recording) -> list[Panel]:
    """Reference and achieved angle over time, a panel for each joint."""
    lines = [
        ("reference", LOOKS["reference"], np.degrees(recording.q_ref)),
        ("achieved", ACHIEVED, np.degrees(recording.q)),
    ]
    return over_time("position [deg]", recording.time, lines)


SATURATED = "saturated: the motor gives less than is asked"


def limits_along(recording: Recording, design: Design) -> tuple[Array, Array]:
    """Least and largest torque of the motors along a run, motor side [N m], each (N + 1, n).

    With elastic joints the speed of a motor is taken for that of its link times the gear ratio.
    """
    newest = arrived(design, recording.time)
    lower, upper = torque_limits(design, newest, recording.v)
    return np.broadcast_to(lower, recording.v.shape), np.broadcast_to(upper, recording.v.shape)


def torque_over_speed(recording: Recording, design: Design, k: int) -> Panel:
    """Torque of the motor of joint k, from 0, over its speed, in the envelope of motor and drive.

    Motor side. The envelope goes on to the speeds n1 and n0, where there are any.
    """
    ratio, n = design.robot.gear_ratio[k], design.robot.n
    corners: list[float] = []
    envelope_ = design.envelope
    if envelope_ is not None and np.isfinite(envelope_.n0[k]):
        corners = [sign * w[k] for w in (envelope_.n1, envelope_.n0) for sign in (-1, 1)]
    speed = np.concatenate([ratio * recording.v[:, k], corners])
    torque = np.concatenate([recording.tau[:, k], np.full(len(corners), np.nan)])
    order = np.argsort(speed, kind="stable")
    at = np.repeat(speed[order, None], n, axis=1) / design.robot.gear_ratio
    lower, upper = (np.broadcast_to(limit, at.shape)[:, k] for limit in envelope(design, at))
    return Panel(
        joint_title(k, design.robot.joint_names[k]),
        "motor speed [rad/s]",
        "motor torque [N m]",
        speed[order],
        [
            Line("limits of the motor", LIMIT, upper),
            Line("_lower limit", LIMIT, lower),
            Line("motor torque", _TORQUE, torque[order], dots=True),
        ],
    )
