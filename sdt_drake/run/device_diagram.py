"""What a controller drives: drives, joints, a plant, what loads it; and where a run starts."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import Diagram
from pydrake.systems.primitives import Adder, MatrixGain, PassThrough, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from sdt_drake.io.arrays import Array
from sdt_drake.robot.device import sliding_friction
from sdt_drake.robot.dynamics import torque_groups
from sdt_drake.run.controllers import Controller
from sdt_drake.run.design import Design
from sdt_drake.systems import (
    AxisProcess,
    Disturbance,
    ElasticJoints,
    Encoder,
    JointFriction,
    RobotPlant,
    TorqueLoop,
    Wired,
)


def add_device(diagram: Wired, design: Design) -> None:
    """Add torque loop, elastic joints and plant: from `tau_limited` and `true_load` to `state`,
    `motor_state`, `measured` (what the encoders are on) and `tau`.

    The plant comes first: its state is the first in the diagram.
    """
    robot, drive, springs = design.robot, design.drive, design.springs
    apart = np.zeros(robot.n, dtype=bool) if springs is None else springs.elastic  # rotors
    if design.scenario.plant.kind == "coupled":
        plant = RobotPlant(robot=robot, without_rotor=apart)
        diagram.add("multibody_plant", plant, tau="tau_link", load_torque="true_load")
    else:
        i_eff = design.i_eff - np.where(apart, robot.rotor_inertia, 0.0)
        process = AxisProcess(i_eff=i_eff, gear_ratio=robot.gear_ratio)
        diagram.add("axis_process", process, tau="tau_link", load_torque="true_load")
    if springs is None:
        diagram.same("tau_link", "tau")
        diagram.same("motor_state", "state")
    else:
        joints = ElasticJoints(
            springs=springs, rotor_inertia=robot.rotor_inertia, gear_ratio=robot.gear_ratio
        )
        diagram.add("elastic_joints", joints)
    on_link = design.scenario.plant.elasticity.encoder == "link"
    diagram.same("measured", "state" if on_link else "motor_state")
    if drive.torque_bandwidth is not None or drive.torque_error is not None:
        torque_loop = TorqueLoop(
            motor_torque_limit=robot.motor_torque_limit,
            bandwidth=drive.torque_bandwidth,
            error=drive.torque_error,
        )
        diagram.add("torque_loop", torque_loop)
    else:
        diagram.same("tau", "tau_limited")


def add_moved(diagram: Wired, design: Design, q: Array, v: Array) -> None:
    """Add a device without a plant: links and motors do what they are said to, whatever the
    torque."""
    # A cubic between the samples: what integrates its speed gets its position.
    moved = PiecewisePolynomial.CubicHermite(design.reference.time, q.T, v.T)
    diagram.add("moved_joints", TrajectorySource(moved, output_derivative_order=1), "state")
    diagram.same("motor_state", "state")
    diagram.same("measured", "state")
    diagram.same("tau", "tau_limited")


def add_loads(diagram: Wired, design: Design) -> None:
    """Add what the motors turn against, `true_load`: on the axis plant the load torque of the
    reference; disturbance, friction, and `extra_load_torque` from outside, 0 by default."""
    n, disturbance = design.robot.n, design.scenario.disturbance
    parts = ["load_torque"] if design.scenario.plant.kind == "axis" else []
    if disturbance.amplitude > 0:
        injected = Disturbance(n=n, amplitude=disturbance.amplitude, omega_d=disturbance.omega_d)
        diagram.add("disturbance", injected)
        parts.append("disturbance")
    if design.friction is not None:
        friction = JointFriction(friction=design.friction, gear_ratio=design.robot.gear_ratio)
        diagram.add("friction", friction)
        parts.append("friction")
    diagram.add("extra_load_torque", PassThrough(np.zeros(n)), "extra_load_torque", "extra")
    if parts:
        diagram.add("true_load", Adder(len(parts) + 1, n), *parts, "extra", "true_load")
    else:
        diagram.same("true_load", "extra")


def make_process(design: Design) -> Diagram:
    """What a controller acts on, alone and linear but for the plant: for linear analysis.

    From `tau_cmd` to `measured` (what the encoders are on) and `state` (of the links). Motors do
    not saturate, and of friction only the viscous part counts: the rest has no frequency response.
    The plant's state is the first in the diagram.
    """
    process, n = Wired(), design.robot.n
    add_device(process, design)
    viscous = np.zeros(n) if design.friction is None else design.friction.viscous
    load = np.hstack([np.zeros((n, n)), np.diag(viscous / design.robot.gear_ratio)])
    process.add("viscous_friction", MatrixGain(load), "state", "true_load")
    process.same("tau_limited", "tau_cmd")
    process.build("measured", "state")
    process.set_name("process")
    return process


# --- the equilibrium that a run starts in -----------------------------------------------------

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
