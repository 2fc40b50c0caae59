"""The device as blocks: drives, joints, a plant and its loads; and the equilibrium at its start."""

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
    """Blocks between the limited torque and the state, and what their signals are called.

    Two signals are one where no block stands between them.

    Attributes:
        plant: None for joints that are moved, whatever the torque.
        elastic_joints, torque_loop: None where there are none.
        tau, motor_state, measured: names of these signals.
        aliases: signals of ports with other names.
    """

    plant: RobotPlant | AxisProcess | None = None
    elastic_joints: ElasticJoints | None = None
    torque_loop: TorqueLoop | None = None
    tau: str = "tau_limited"
    motor_state: str = "state"
    measured: str = "state"
    aliases: Aliases = field(default_factory=dict)


def add_device(builder: DiagramBuilder, design: Design, *, torque: str = "tau_limited") -> Device:
    """Add plant, elastic joints and torque loop: from a torque and `true_load` to `state`.

    The plant comes first: its state is the first in the diagram.

    Args:
        builder: gets the blocks.
        design: a resolved scenario.
        torque: name of the signal that the drives are given.
    """
    robot, drive, springs = design.robot, design.drive, design.springs
    apart = np.zeros(robot.n, dtype=bool) if springs is None else springs.elastic  # rotors
    plant: RobotPlant | AxisProcess
    if design.scenario.plant.kind == "coupled":
        name, plant = "multibody_plant", RobotPlant(robot=robot, without_rotor=apart)
    else:
        i_eff = design.i_eff - np.where(apart, robot.rotor_inertia, 0.0)
        name, plant = "axis_process", AxisProcess(i_eff=i_eff, gear_ratio=robot.gear_ratio)
    builder.AddNamedSystem(name, plant)
    joints = torque_loop = None
    if springs is not None:
        joints = ElasticJoints(
            springs=springs, rotor_inertia=robot.rotor_inertia, gear_ratio=robot.gear_ratio
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
    """Add a device without a plant: links and motors do what they are said to, whatever the
    torque."""
    # A cubic between the samples: what integrates its speed gets its position.
    moved = PiecewisePolynomial.CubicHermite(design.reference.time, q.T, v.T)
    builder.AddNamedSystem("moved_joints", TrajectorySource(moved, output_derivative_order=1))
    return Device(aliases={("moved_joints", "y0"): "state"})


def add_loads(
    builder: DiagramBuilder, design: Design, loaded: bool = True
) -> tuple[JointFriction | None, Aliases]:
    """Add what the motors turn against, `true_load`: on the axis plant the load torque of the
    reference, if it is loaded; disturbance, friction, and `extra_load_torque` from outside, 0 by
    default.

    Returns:
        The friction, if there is one, and the signals of ports with other names.
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
    """What a controller acts on, alone and linear but for the plant: for linear analysis.

    From `tau_cmd` to `measured` (what the encoders are on) and `state` (of the links). Motors do
    not saturate, and of friction only the viscous part counts: the rest has no frequency response.
    The plant's state is the first in the diagram.
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

_ITERATIONS = 10  # of the angle by which gravity turns a link away from its motor


class Equilibrium(NamedTuple):
    """The steady state in which a run starts: joints turn at the speed of the start, and the
    encoders see its angles.

    Attributes:
        q, v: of the links, joint side [rad, rad/s], shape (n,).
        q_motor: of the motors, joint side [rad]; their speed is v.
        q_seen: of what the encoders are on, joint side [rad].
        tau: torque of the motors, motor side [N m].
        tau_cmd: torque asked of the drives, motor side [N m].
    """

    q: Array
    v: Array
    q_motor: Array
    q_seen: Array
    tau: Array
    tau_cmd: Array


def equilibrium(design: Design, start: Motion, loaded: bool = True) -> Equilibrium:
    """Return the steady state in which a run of a design starts.

    Args:
        design: a resolved scenario.
        start: one sample, without acceleration.
        loaded: whether axes have their load torque.
    """
    q = seen = start.q[0]
    v, wound = start.v[0], np.zeros(design.robot.n)
    if design.springs is not None:
        axes = design.springs.elastic
        for _ in range(_ITERATIONS):
            torque = design.robot.gear_ratio * _holding_torque(design, q, start, loaded)
            wound[axes] = torque[axes] / design.springs.stiffness[axes]
            q = seen if design.scenario.plant.elasticity.encoder == "link" else seen - wound
    tau = _holding_torque(design, q, start, loaded)
    error = design.drive.torque_error
    tau_cmd = tau if error is None else tau / (1 + np.array(error))
    return Equilibrium(q, v, q + wound, seen, tau, tau_cmd)


def _holding_torque(design: Design, q: Array, start: Motion, loaded: bool) -> Array:
    """Torque that keeps joints at angles q at the speed of the start, motor side [N m], (n,)."""
    robot, v = design.robot, start.v[0]
    if design.scenario.plant.kind == "axis":  # which has its load from the reference alone
        load = design.steady_load(start) if loaded else np.zeros(robot.n)
    else:
        load = torque_groups(robot, q, v, np.zeros(robot.n)).total / robot.gear_ratio
    if design.friction is None:
        return load
    return load + sliding_friction(design.friction, v) / robot.gear_ratio
