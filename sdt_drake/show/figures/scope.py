"""The scope of a run: reference, achieved motion, errors and motor torque of each joint."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from sdt_drake.io.arguments import chosen_joints, typed
from sdt_drake.io.errors import InputError
from sdt_drake.run.design import Design
from sdt_drake.run.motor_torque import arrived, motor_limits, torque_limits
from sdt_drake.run.probes import unit_of
from sdt_drake.run.recording import Recording
from sdt_drake.show.panels import LIMIT, Line, Lines, Panel, over_time, picture
from sdt_drake.show.style import LOOKS, PALETTE, Look, joint_title, nth_look

ACHIEVED = Look(PALETTE[1], "--")
ERROR, MOTOR_TORQUE = Look(PALETTE[2]), Look(PALETTE[6])


@typed
def scope(
    title: str, recording: Recording, design: Design | None = None, joint: int | None = None
) -> Figure:
    """Draw speed, speed error, position error and torque over time, a column for each joint.

    Args:
        title: title of the figure.
        recording: the recording of a run.
        design: the design of this run; without it the figure has no names and torque limits.
        joint: draw only this joint, 1..n.

    Raises:
        InputError: if `joint` does not exist, or design and recording have different joints.
    """
    n = recording.q.shape[1]
    if design is not None and design.device.simulated.n != n:
        raise InputError(
            f"design: {design.device.simulated.n} joint(s), expected {n}, as in the recording"
        )
    joints = chosen_joints(joint, n)
    names = [""] * n if design is None else design.device.simulated.joint_names
    columns = joint_columns(recording, design, names)
    return picture(title, [columns[k] for k in joints])


def joint_columns(
    recording: Recording, design: Design | None, joint_names: Sequence[str] = ()
) -> list[list[Panel]]:
    """Make the panels of `scope`, a column for each joint.

    Args:
        recording: the recording of a run.
        design: its design, or None.
        joint_names: n names for the titles; () for columns without titles.
    """
    run, torques = recording, [("motor torque", MOTOR_TORQUE, recording.tau)]
    if design is not None:
        # With elastic joints, the motor speed is approximated by link speed times gear ratio.
        newest, shape = arrived(design, run.time), run.v.shape
        lower, upper = (np.broadcast_to(x, shape) for x in torque_limits(design, newest, run.v))
        limits = [("limits of the motor", LIMIT, upper), ("_lower limit", LIMIT, lower)]
        torques = limits + torques
    speeds = [("reference", LOOKS["reference"], run.v_ref), ("achieved", ACHIEVED, run.v)]

    saturated = run.saturated > 0  # in the period that ends there
    saturated[:-1] |= saturated[1:]

    def row(y_label: str, lines: Lines, names: Sequence[str] = ()) -> list[Panel]:
        return over_time(y_label, run.time, lines, names, marked=saturated, marked_label=SATURATED)

    rows = [
        row("speed [rad/s]", speeds, joint_names),
        row("speed error [rad/s]", [("error", ERROR, run.speed_error)]),
        row("position error [deg]", [("error", ERROR, np.degrees(run.position_error))]),
        row("torque [N m], motor side", torques),
    ]
    return list(map(list, zip(*rows, strict=True)))


def joint_panels(recording: Recording, design: Design) -> list[list[Panel]]:
    """Make the panels of a page: angle, speed, errors and torque, a column for each joint."""
    lines = [
        ("reference", LOOKS["reference"], np.degrees(recording.q_ref)),
        ("achieved", ACHIEVED, np.degrees(recording.q)),
    ]
    positions = over_time("position [deg]", recording.time, lines)
    others = joint_columns(recording, design)
    return [[first, *more] for first, more in zip(positions, others, strict=True)]


def probe_panels(recording: Recording) -> dict[str, list[Panel]]:
    """Make the panels of each probe, one for each unit, by the names of the probes."""
    panels: dict[str, list[Panel]] = {}
    for name, values in recording.probes.items():
        units = unit_of(name).split(", ")
        panels[name] = []
        for unit, part in zip(units, np.hsplit(values, len(units)), strict=True):
            label = f"{name} [{unit}]" if unit else name
            lines = [Line(f"{k + 1}", nth_look(k), column) for k, column in enumerate(part.T)]
            panels[name].append(Panel("", "time [s]", label, recording.time, lines))
    return panels


@typed
def probes(title: str, recording: Recording) -> Figure:
    """Draw the probes of a run over time, a panel for each probe and unit.

    Raises:
        InputError: if the run has no probe.
    """
    panels = [panel for own in probe_panels(recording).values() for panel in own]
    if not panels:
        raise InputError("recording: has no probes, expected a run with probes=[...]")
    return picture(title, [panels])


@typed
def windings(title: str, recording: Recording, design: Design) -> Figure:
    """Draw the temperatures of the motors' windings over time.

    Raises:
        InputError: if the run has no windings.
    """
    if recording.winding_temperature is None:
        raise InputError("recording: has no windings, expected a scenario with plant.windings")
    return picture(title, [warm_windings(recording, design)])


SATURATED = "saturated: less torque than commanded"


def torque_over_speed(recording: Recording, design: Design, k: int) -> Panel:
    """Make the panel of torque over speed of a motor, motor side, with its torque-speed envelope.

    The envelope extends to the corner speeds n1 and n0, if it has any.

    Args:
        recording: the recording of a run.
        design: its design.
        k: joint, counted from 0.
    """
    ratio, n = design.device.simulated.gear_ratio[k], design.device.simulated.n
    corners: list[float] = []
    envelope = design.envelope
    if envelope is not None and np.isfinite(envelope.n0[k]):
        corners = [sign * w[k] for w in (envelope.n1, envelope.n0) for sign in (-1, 1)]
    speed = np.concatenate([ratio * recording.v[:, k], corners])
    torque = np.concatenate([recording.tau[:, k], np.full(len(corners), np.nan)])
    order = np.argsort(speed, kind="stable")
    at = np.repeat(speed[order, None], n, axis=1) / design.device.simulated.gear_ratio
    lower, upper = (np.broadcast_to(limit, at.shape)[:, k] for limit in motor_limits(design, at))
    return Panel(
        joint_title(k, design.device.simulated.joint_names[k]),
        "motor speed [rad/s]",
        "torque [N m], motor side",
        speed[order],
        [
            Line("limits of the motor", LIMIT, upper),
            Line("_lower limit", LIMIT, lower),
            Line("motor torque", MOTOR_TORQUE, torque[order], dots=True),
        ],
    )


def warm_windings(recording: Recording, design: Design) -> list[Panel]:
    """Make the panel of the temperatures of all windings over time."""
    assert recording.winding_temperature is not None
    lines = [
        Line(joint_title(k, name), nth_look(k), recording.winding_temperature[:, k])
        for k, name in enumerate(design.device.simulated.joint_names)
    ]
    return [Panel("windings", "time [s]", "temperature [°C]", recording.time, lines)]
