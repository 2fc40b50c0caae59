"""The equilibrium that a run starts in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdt_drake.arrays import Array
from sdt_drake.design import Design
from sdt_drake.device import sliding_friction
from sdt_drake.dynamics import torque_groups

_ITERATIONS = 10  # of the angle by which gravity turns a link away from its motor


@dataclass(frozen=True, eq=False)
class Rest:
    """Joints that have gone on at the first speed of a motion for long; each of shape (n,).

    Attributes:
        q, q_motor: of links and motors, joint side [rad]: apart where springs are wound.
        v: of both, joint side [rad/s].
        tau: what the motors give, motor side [N m].
        tau_cmd: what they are asked for, motor side [N m].
    """

    q: Array
    q_motor: Array
    v: Array
    tau: Array
    tau_cmd: Array


def at_rest(design: Design) -> Rest:
    """Where what the encoders see is on the first sample of the motion."""
    q = q_motor = seen = design.motion.q[0]
    springs, elasticity = design.springs, design.scenario.plant.elasticity
    if springs is not None:
        wound, axes = np.zeros(len(seen)), springs.elastic
        for _ in range(_ITERATIONS):
            torque = design.robot.gear_ratio * _holding_torque(design, q)
            wound[axes] = torque[axes] / springs.stiffness[axes]
            q = seen if elasticity.encoder == "link" else seen - wound
        q_motor = q + wound
    tau = _holding_torque(design, q)
    error = design.drive.torque_error
    tau_cmd = tau if error is None else tau / (1 + np.array(error))
    return Rest(q, q_motor, design.motion.v[0], tau, tau_cmd)


def _holding_torque(design: Design, q: Array) -> Array:
    """What moves the joints on at the first speed, motor side [N m], shape (n,)."""
    robot, v = design.robot, design.motion.v[0]
    if design.scenario.plant.kind == "axis":  # which has its load from the reference alone
        load = design.steady_load
    else:
        load = torque_groups(robot, q, v, np.zeros(robot.n)).total / robot.gear_ratio
    if design.friction is None:
        return load
    return load + sliding_friction(design.friction, v) / robot.gear_ratio
