"""A motion for the drives: positions, speeds and torque pre-control of the motors."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sdt_drake.errors import InputError
from sdt_drake.motion.planner import Plan
from sdt_drake.motion.trajectory import Motion
from sdt_drake.robot import Robot
from sdt_drake.tables import write_table

_REST = 1e-3  # rad/s; what is slower is at rest


def write_drive_table(path: str | Path, robot: Robot, plan: Plan) -> None:
    """Write time [s], q_motor_k [rad], v_motor_k [rad/s], tau_motor_k [N m], all **motor side**.

    q_motor = r q, v_motor = r v, tau_motor = tau / r, with tau the full inverse dynamics, the
    motors' own inertia included. So tau_motor is the whole torque of a motor, for the additive
    torque setpoint of its drive; a pre-control by acceleration times inertia in the drive has to be
    off then. A row holds until the next one; the last row has no acceleration any more.

    Raises:
        InputError: if a joint starts or ends in motion, or the file cannot be written.
    """
    moving = ends_in_motion(robot, plan.motion)
    if moving:
        raise InputError(f"{path}: {moving[0]}, expected rest: no drive starts or ends in motion")
    motion, r = plan.motion, robot.gear_ratio
    columns = {"q_motor": r * motion.q, "v_motor": r * motion.v, "tau_motor": plan.torque / r}
    write_table(path, motion.time, columns)


def ends_in_motion(robot: Robot, motion: Motion) -> list[str]:
    """For people: each joint that starts or ends in motion, and its speed."""
    return [
        f"joint {k + 1} '{robot.joint_names[k]}' {when} at {v[k]:.4g} rad/s"
        for v, when in ((motion.v[0], "starts"), (motion.v[-1], "ends"))
        for k in np.flatnonzero(np.abs(v) > _REST)
    ]
