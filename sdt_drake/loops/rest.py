"""The equilibrium that a run starts in."""

from __future__ import annotations

import numpy as np

from sdt_drake.arrays import Array
from sdt_drake.controllers import Controller
from sdt_drake.design import Design
from sdt_drake.device import sliding_friction
from sdt_drake.dynamics import torque_groups
from sdt_drake.systems import (
    AxisProcess,
    ElasticJoints,
    Encoder,
    JointFriction,
    RobotPlant,
    TorqueLoop,
)

_ITERATIONS = 10  # of the angle by which gravity turns a link away from its motor


def at_rest(design: Design) -> dict[type, tuple[Array, ...]]:
    """What `rest` of each kind of block takes, where joints have gone on at the first speed of the
    motion for long, and what the encoders see is on its first sample."""
    q = seen = design.motion.q[0]
    v, wound = design.motion.v[0], np.zeros(design.robot.n)
    if design.springs is not None:
        axes = design.springs.elastic
        for _ in range(_ITERATIONS):
            torque = design.robot.gear_ratio * _holding_torque(design, q)
            wound[axes] = torque[axes] / design.springs.stiffness[axes]
            q = seen if design.scenario.plant.elasticity.encoder == "link" else seen - wound
    tau = _holding_torque(design, q)
    error = design.drive.torque_error
    return {
        AxisProcess: (q, v),
        RobotPlant: (q, v),
        ElasticJoints: (q + wound, v),
        JointFriction: (v,),
        TorqueLoop: (tau,),
        Encoder: (seen, v),
        Controller: (tau if error is None else tau / (1 + np.array(error)),),
    }


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
