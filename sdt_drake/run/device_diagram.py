"""The device as blocks (drives, joints, plant, loads), and the equilibrium at its start."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import Adder, MatrixGain, PassThrough, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from sdt_drake.io.arrays import Array
from sdt_drake.motion import Motion
from sdt_drake.robot.device import sliding_friction
from sdt_drake.robot.dynamics import torque_groups
from sdt_drake.run.design import Design
from sdt_drake.systems import (
    AxisProcess,
    Disturbance,
    ElasticJoints,
    JointFriction,
    RobotPlant,
    TorqueLoop,
    connect_by_name,
)
from sdt_drake.systems.wiring import Aliases


@dataclass(frozen=True)
class Device:
    """Blocks from the limited torque to the state, and the names of their signals.

    Two signals have the same name if no block stands between them.
    """

    plant: RobotPlant | AxisProcess | None = None
    """The plant; None for prescribed joint motion."""
    elastic_joints: ElasticJoints | None = None
    """The springs; None if all joints are rigid."""
    torque_loop: TorqueLoop | None = None
    """The torque loop of the drives; None if the drives are ideal."""
    tau: str = "tau_limited"
    """Name of the signal of the motors' torque."""
    motor_state: str = "state"
    """Name of the signal of the motors' positions and speeds."""
    measured: str = "state"
    """Name of the signal that the encoders measure."""
    aliases: Aliases = field(default_factory=dict)
    """Names of the signals at ports that are named differently."""


def add_device(builder: DiagramBuilder, design: Design, *, torque: str = "tau_limited") -> Device:
    """Add plant, elastic joints and torque loop: from a torque and `true_load` to `state`.

    The plant is added first, so that its state is the first in the diagram.

    Args:
        builder: the diagram under construction.
        design: the design of the loop.
        torque: name of the torque signal at the drives' input.
    """
    robot, drive, springs = design.robot, design.drive, design.springs
    apart = np.zeros(robot.n, dtype=bool) if springs is None else springs.elastic  # rotors
    plant: RobotPlant | AxisProcess
    if design.scenario.plant.kind == "coupled":
        name, plant = "multibody_plant", RobotPlant(robot=robot, without_rotor=apart)
    else:
        i_eff = design.i_eff - np.where(apart, robot.motor_inertia, 0.0)
        name, plant = "axis_process", AxisProcess(i_eff=i_eff, gear_ratio=robot.gear_ratio)
    builder.AddNamedSystem(name, plant)
    joints = torque_loop = None
    if springs is not None:
        joints = ElasticJoints(
            springs=springs,
            rotor_inertia=robot.motor_inertia,
            gear_ratio=robot.gear_ratio,
            shared_inertia=robot.shared_inertia if name == "multibody_plant" else 0.0,
        )
        builder.AddNamedSystem("elastic_joints", joints)
    if drive.torque_bandwidth is not None or drive.torque_error is not None:
        torque_loop = TorqueLoop(
            motor_torque_limit=robot.motor_torque_limit,
            bandwidth=drive.torque_bandwidth,
            error=drive.torque_error,
        )
        builder.AddNamedSystem("torque_loop", torque_loop)
    tau = torque if torque_loop is None else "tau"
    motor_state = "state" if joints is None else "motor_state"
    on_link = design.scenario.plant.elasticity.encoder == "link"
    aliases = {
        ("torque_loop", "tau_limited"): torque,
        ("elastic_joints", "tau"): tau,
        (name, "tau"): tau if joints is None else "tau_link",
        (name, "load_torque"): "true_load",
    }
    measured = "state" if on_link else motor_state
    return Device(plant, joints, torque_loop, tau, motor_state, measured, aliases)


def add_moved(builder: DiagramBuilder, design: Design, q: Array, v: Array) -> Device:
    """Add prescribed joint motion in place of a plant; q [rad] and v [rad/s], joint side."""
    # Cubics between the samples, so that the integral of the speed is the position.
    moved = PiecewisePolynomial.CubicHermite(design.reference.time, q.T, v.T)
    builder.AddNamedSystem("moved_joints", TrajectorySource(moved, output_derivative_order=1))
    return Device(aliases={("moved_joints", "y0"): "state"})


def add_loads(
    builder: DiagramBuilder, design: Design, loaded: bool = True
) -> tuple[JointFriction | None, Aliases]:
    """Add the load of the motors as the signal `true_load`.

    It is the sum of disturbance, friction and `extra_load_torque`, an input that is 0 by default.
    On the axis plant the load torque of the reference is added if `loaded`.

    Returns:
        The friction block or None, and names of the signals at ports that are named differently.
    """
    n, disturbance, friction = design.robot.n, design.scenario.disturbance, None
    parts = ["load_torque"] if loaded and design.scenario.plant.kind == "axis" else []
    if disturbance.amplitude > 0:
        injected = Disturbance(n=n, amplitude=disturbance.amplitude, omega_d=disturbance.omega_d)
        builder.AddNamedSystem("disturbance", injected)
        parts.append("disturbance")
    if design.friction is not None:
        friction = JointFriction(friction=design.friction, gear_ratio=design.robot.gear_ratio)
        builder.AddNamedSystem("friction", friction)
        parts.append("friction")
    builder.AddNamedSystem("extra_load_torque", PassThrough(np.zeros(n)))
    aliases = {("true_load", f"u{i}"): part for i, part in enumerate([*parts, "extra"])}
    aliases["extra_load_torque", "u"] = "extra_load_torque"
    aliases["extra_load_torque", "y"] = "extra" if parts else "true_load"
    aliases["true_load", "sum"] = "true_load"
    if parts:
        builder.AddNamedSystem("true_load", Adder(len(parts) + 1, n))
    return friction, aliases


def make_process(design: Design) -> Diagram:
    """Make the open loop for linear analysis, from `tau_cmd` to `measured` and `state`.

    `measured` is the signal that the encoders measure, `state` that of the links. Motors do not
    saturate. Only viscous friction is included, as the rest has no frequency response. The plant's
    state is the first in the diagram.
    """
    builder, n = DiagramBuilder(), design.robot.n
    device = add_device(builder, design, torque="tau_cmd")
    viscous = np.zeros(n) if design.friction is None else design.friction.viscous
    load = np.hstack([np.zeros((n, n)), np.diag(viscous / design.robot.gear_ratio)])
    builder.AddNamedSystem("viscous_friction", MatrixGain(load))
    friction = {("viscous_friction", "u0"): "state", ("viscous_friction", "y0"): "true_load"}
    signals = connect_by_name(builder, {**device.aliases, **friction})
    builder.ExportOutput(signals[device.measured], "measured")
    builder.ExportOutput(signals["state"], "state")
    process = builder.Build()
    process.set_name("process")
    return process


# --- the equilibrium that a run starts in -----------------------------------------------------

N_ITERATIONS = 10
"""Iterations of the angle by which gravity turns a link away from its motor."""


class Equilibrium(NamedTuple):
    """The steady state at which a run starts; all arrays have the shape (n,).

    The joints turn at the initial speed, and the encoders measure the initial angles.
    """

    q: Array
    """Positions of the links, joint side [rad]."""
    v: Array
    """Speeds of links and motors, joint side [rad/s]."""
    q_motor: Array
    """Positions of the motors, joint side [rad]."""
    q_seen: Array
    """Positions that the encoders measure, joint side [rad]."""
    tau: Array
    """Torque of the motors, motor side [N m]."""
    tau_cmd: Array
    """Commanded torque, motor side [N m]."""


def equilibrium(design: Design, start: Motion, loaded: bool = True) -> Equilibrium:
    """Return the steady state at which a run of a design starts.

    Args:
        design: the design of the loop.
        start: a motion of one sample without acceleration.
        loaded: whether the load torque of the reference acts on the axis plant.
    """
    q = seen = start.q[0]
    v, wound = start.v[0], np.zeros(design.robot.n)
    if design.springs is not None:
        axes = design.springs.elastic
        for _ in range(N_ITERATIONS):
            torque = design.robot.gear_ratio * _holding_torque(design, q, start, loaded)
            wound[axes] = torque[axes] / design.springs.stiffness[axes]
            q = seen if design.scenario.plant.elasticity.encoder == "link" else seen - wound
    tau = _holding_torque(design, q, start, loaded)
    error = design.drive.torque_error
    tau_cmd = tau if error is None else tau / (1 + np.array(error))
    return Equilibrium(q, v, q + wound, seen, tau, tau_cmd)


def _holding_torque(design: Design, q: Array, start: Motion, loaded: bool) -> Array:
    """Return the torque that keeps joints at angles q at the initial speed, motor side [N m]."""
    robot, v = design.robot, start.v[0]
    if design.scenario.plant.kind == "axis":  # its load depends on the reference alone
        load = design.loads_along(start).load_torque[0] if loaded else np.zeros(robot.n)
    else:
        load = torque_groups(robot, q, v, np.zeros(robot.n)).total / robot.gear_ratio
    if design.friction is None:
        return load
    return load + sliding_friction(design.friction, v) / robot.gear_ratio
