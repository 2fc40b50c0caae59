"""Parts of a real robot that a file's links lack: rotors, which are assumed, and friction."""

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.robot.published import few
from sdt_drake.robot.robot import Robot

MOTOR_ACCELERATION = 100.0
"""Acceleration that the largest torque gives a motor without load, joint side [rad/s²].

Geared servos reach 60 to 150, from those of hobby arms to those of industrial ones."""
_SHARE = 0.02  # of the links' inertia, where no torque limit is known

ASSUMPTION = (
    "the largest torque gives motor and gear without load "
    f"{MOTOR_ACCELERATION:g} rad/s² at the joint"
)
"""Assumption of `assumed_inertia`, in words."""


def assumed_inertia(robot: Robot) -> Array:
    """Return an assumed inertia of each motor and its gear, joint side [kg m²], shape (n,).

    It is that of a motor whose largest torque accelerates it by MOTOR_ACCELERATION. Where no torque
    limit is known, it is a share of the links' inertia at q = 0.
    """
    links = robot.plant.CalcMassMatrix(robot.context_at_zero()).diagonal()
    by_torque = robot.effort_limit / MOTOR_ACCELERATION
    return np.where(np.isfinite(by_torque), by_torque, _SHARE * links)


def without_rotors(robot: Robot) -> str:
    """Return a sentence on joints whose motors have no inertia, "" if all have."""
    joints = [robot.joint(k) for k in np.flatnonzero(robot.motor_inertia == 0).tolist()]
    which = "any joint" if len(joints) == robot.n else few(joints)
    if not joints:
        return ""
    return (
        f"no rotor inertia of {which} is known (<drake:rotor_inertia>, or device.motors of a "
        "scenario): motors turn the links alone, so that light joints react faster than real ones"
    )


def without_friction(robot: Robot) -> str:
    """Return a sentence on friction of the file, which the links do not have, "" if it has none."""
    values = ", ".join(f"{x:g}" for x in robot.coulomb)
    text = f"the file's <friction> [{values}] N m is left out: plant.friction.coulomb of a scenario"
    return f"{text} simulates it" if robot.coulomb.any() else ""
