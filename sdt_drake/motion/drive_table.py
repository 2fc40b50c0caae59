"""A motion for the drives: positions, speeds and torque pre-control of the motors."""

from __future__ import annotations

from pathlib import Path

from sdt_drake.motion.planner import Plan
from sdt_drake.robot import Robot
from sdt_drake.tables import write_table


def write_drive_table(path: str | Path, robot: Robot, plan: Plan) -> None:
    """Write time [s], q_motor_k [rad], v_motor_k [rad/s], tau_motor_k [N m], all **motor side**.

    q_motor = r q, v_motor = r v, tau_motor = tau / r, with tau the full inverse dynamics, the
    motors' own inertia included. So tau_motor is the whole torque of a motor, for the additive
    torque setpoint of its drive; a pre-control by acceleration times inertia in the drive has to be
    off then. A row holds until the next one; the last row has no acceleration any more.

    Raises:
        InputError: if the file cannot be written.
    """
    motion, r = plan.motion, robot.gear_ratio
    columns = {"q_motor": r * motion.q, "v_motor": r * motion.v, "tau_motor": plan.torque / r}
    write_table(path, motion.time, columns)
