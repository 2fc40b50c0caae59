"""The device as one diagram, its encoders, and the equilibrium at the start of a run."""

from dataclasses import replace
from functools import partial
from typing import NamedTuple, cast

import numpy as np
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort, System
from pydrake.systems.primitives import Adder, PassThrough, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from sdt_drake import systems
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.motion import Motion
from sdt_drake.robot.device import Friction, sliding_friction
from sdt_drake.robot.dynamics import torque_groups
from sdt_drake.robot.stops import Stops
from sdt_drake.run.design import Design
from sdt_drake.systems.elastic_joints import set_motor_state
from sdt_drake.systems.encoder import set_measured
from sdt_drake.systems.friction import set_sliding
from sdt_drake.systems.gear_loss import driving_torque
from sdt_drake.systems.robot_plant import PlantPorts, add_robot_plant
from sdt_drake.systems.torque_loop import set_motor_torque
from sdt_drake.systems.torque_ripple import ripple_at
from sdt_drake.systems.wiring import build, nested, set_state


def make_device(design: Design, *, of_bodies: bool = False) -> Diagram:
    """Make the device: drives, motors, springs, links, friction and disturbance.

    Inputs: `tau_limited`, the torque that the drives are to give; `extra_load_torque`, a further
    load; and `load_torque`, if the axis plant or a disturbance need that of the reference. Outputs:
    `state` of the links, `motor_state`, and `tau` of the motors. Torques are motor side [N m],
    states joint side [rad, rad/s]. With `of_bodies` also poses, velocities and accelerations of all
    bodies of the coupled plant, as its Drake system has them. With rigid joints motors have the
    state of their links. The plant's state is the first in the diagram.

    The plant "axis" is the paper's: each motor turns a constant inertia against the load torque of
    the reference. The plant "coupled" is the MultibodyPlant, where coupling torques act physically.
    Disturbance and friction act as generalised forces.
    """
    if design.assumptions.prescribed_motion is not None:
        return _prescribed(design, *design.assumptions.prescribed_motion)
    builder, robot, n = DiagramBuilder(), design.device.simulated, design.nominal.n
    add, connect, springs = builder.AddNamedSystem, builder.Connect, design.springs
    is_axis = design.scenario.plant.kind == "axis"

    apart = np.zeros(n, dtype=bool) if springs is None else springs.elastic  # rotors
    if is_axis:
        i_eff = design.i_eff - np.where(apart, robot.motor_inertia, 0.0)
        axes = add("axis_process", systems.axis_process(i_eff=i_eff, gear_ratio=robot.gear_ratio))
        driven, load_torque = map(axes.GetInputPort, ("tau", "load_torque"))
        plant = PlantPorts(driven, load_torque, axes.get_output_port())
    else:
        plant = add_robot_plant(builder, robot=robot, without_rotor=apart)
    motor_state = plant.state

    tau, ripple = _add_motors(builder, design)
    through = tau
    if springs is not None:
        joints = add("elastic_joints", systems.elastic_joints(
            springs=springs,
            rotor_inertia=robot.motor_inertia,
            gear_ratio=robot.gear_ratio,
            shared_inertia=0.0 if is_axis else robot.shared_inertia,
        ))  # fmt: skip
        connect(tau, joints.GetInputPort("tau"))
        connect(plant.state, joints.GetInputPort("state"))
        through = joints.GetOutputPort("tau_link")
        connect(through, plant.tau)
        motor_state = joints.GetOutputPort("motor_state")
    elif design.drive.is_ideal_torque:
        builder.ConnectInput("tau_limited", plant.tau)
    else:
        connect(tau, plant.tau)
    if ripple is not None:
        connect(motor_state, ripple.get_input_port())

    loads = _add_loads(builder, design, plant.state, through)
    if loads:
        total = add("true_load", Adder(len(loads) + 1, n))
        for i, load in enumerate(loads):
            connect(load.get_output_port(), total.get_input_port(i + 1))
        builder.ExportInput(total.get_input_port(0), "extra_load_torque")
        connect(total.get_output_port(), plant.load_torque)
    else:
        builder.ExportInput(plant.load_torque, "extra_load_torque")

    if of_bodies:
        links = cast(System, plant.state.get_system())
        for name in ("body_poses", "body_spatial_velocities", "body_spatial_accelerations"):
            builder.ExportOutput(links.GetOutputPort(name), name)
    builder.ExportOutput(plant.state, "state")
    builder.ExportOutput(motor_state, "motor_state")
    builder.ExportOutput(tau, "tau")
    return build(builder, "device")


def _add_motors(builder: DiagramBuilder, design: Design) -> tuple[OutputPort, System | None]:
    """Add the torque loop of the drives, with ripple; return the motors' torque, and the ripple."""
    drive, robot, n = design.drive, design.device.simulated, design.nominal.n
    add, connect = builder.AddNamedSystem, builder.Connect
    if drive.is_ideal_torque:
        motors = add("torque_loop", PassThrough(n))
    else:
        motors = add("torque_loop", systems.torque_loop(
            motor_torque_limit=robot.motor_torque_limit,
            bandwidth=drive.torque_bandwidth,
            error=drive.torque_error,
        ))  # fmt: skip
    builder.ExportInput(motors.get_input_port(), "tau_limited")
    if not drive.ripple_harmonics:
        return motors.get_output_port(), None
    ripple = add("torque_ripple", systems.torque_ripple(
        harmonics=drive.ripple_harmonics,
        amplitudes=drive.ripple_amplitude,
        gear_ratio=robot.gear_ratio,
        motor_torque_limit=robot.motor_torque_limit,
    ))  # fmt: skip
    total = add("tau", Adder(2, n))
    connect(motors.get_output_port(), total.get_input_port(0))
    connect(ripple.get_output_port(), total.get_input_port(1))
    return total.get_output_port(), ripple


def _add_loads(
    builder: DiagramBuilder, design: Design, state: OutputPort, through: OutputPort
) -> list[System]:
    """Add what loads the motors: losses, friction, stops, load of the reference, disturbance.

    Args:
        builder: builder of the device.
        design: the design of the loop.
        state: state of the links.
        through: torque through the gears, motor side [N m].
    """
    robot, n, is_axis = (
        design.device.simulated,
        design.nominal.n,
        design.scenario.plant.kind == "axis",
    )
    add, connect = builder.AddNamedSystem, builder.Connect
    loads: list[System] = []
    if (efficiency := design.scenario.plant.gear_efficiency) is not None:
        loss = systems.gear_loss(efficiency=efficiency)
        loads.append(add("gear_loss", loss))
        connect(through, loss.GetInputPort("tau"))
        connect(state, loss.GetInputPort("state"))
    if design.friction is not None:
        friction = systems.joint_friction(friction=design.friction, gear_ratio=robot.gear_ratio)
        loads.append(add("friction", friction))
        connect(state, friction.get_input_port())
    if not (stops := design.scenario.plant.stops).is_none:
        pushing = systems.joint_stops(
            stops=stops,
            lower=robot.position_lower,
            upper=robot.position_upper,
            gear_ratio=robot.gear_ratio,
        )
        loads.append(add("joint_stops", pushing))
        connect(state, pushing.get_input_port())
    if design.needs_load_torque:
        reference = add("load_torque", PassThrough(n))
        builder.ExportInput(reference.get_input_port(), "load_torque")
        loads += [reference] * is_axis
        if (error := design.scenario.disturbance).amplitude > 0:
            injected = systems.disturbance(n=n, amplitude=error.amplitude, omega_d=error.omega_d)
            loads.append(add("disturbance", injected))
            connect(reference.get_output_port(), injected.get_input_port())
    return loads


NO_LIMIT = 1e9
"""Factor on the torque limit of motors that are not limited."""


def make_saturation(design: Design) -> Diagram:
    """Make the torque limits of the motors, without limits if a design assumes so."""
    robot, limited = design.device.simulated, design.assumptions.limited
    envelope = design.envelope if limited else None
    return systems.dynamic_saturation(
        motor_torque_limit=(1.0 if limited else NO_LIMIT) * robot.motor_torque_limit,
        gear_ratio=robot.gear_ratio,
        n1=None if envelope is None else envelope.n1,
        n0=None if envelope is None else envelope.n0,
        widened=design.widens_limits,
    )


def _prescribed(design: Design, q: Array, v: Array) -> Diagram:
    """Make a device whose joints move as prescribed: q [rad], v [rad/s], joint side, (N + 1, n)."""
    builder, n = DiagramBuilder(), design.device.simulated.n
    # Cubics between the samples, so that the integral of the speed is the position.
    motion = PiecewisePolynomial.CubicHermite(design.reference.held.time, q.T, v.T)
    joints = builder.AddNamedSystem(
        "prescribed_motion", TrajectorySource(motion, output_derivative_order=1)
    )
    motors, ignored = (builder.AddNamedSystem(x, PassThrough(n)) for x in ("motors", "ignored"))
    builder.ExportInput(motors.get_input_port(), "tau_limited")
    builder.ExportInput(ignored.get_input_port(), "extra_load_torque")
    builder.ExportOutput(joints.get_output_port(), "state")
    builder.ExportOutput(joints.get_output_port(), "motor_state")
    builder.ExportOutput(motors.get_output_port(), "tau")
    return build(builder, "device")


def measured_port(design: Design) -> str:
    """Return the device's output that the encoders measure: that of links, or of motors."""
    on_motor = design.springs is not None and design.scenario.plant.elasticity.encoder == "motor"
    return "motor_state" if on_motor else "state"


def make_encoder(design: Design, *, at_reference: bool, delay: float) -> System:
    """Make the encoders of a device: input `state`, output `measured`, joint side [rad, rad/s].

    `measured` is sampled if the drives sample, else continuous. With `at_reference` the output
    `sampled_state` has samples at the instants at which the reference arrives, with a delay [s].
    """
    builder, drive, n = DiagramBuilder(), design.drive, design.device.simulated.n
    ideal = PassThrough(2 * n)
    if drive.period is None and not at_reference:
        return ideal

    def sampled(period: float, offset: float = 0.0) -> Diagram:
        return systems.encoder(
            n=n,
            period=period,
            resolution=drive.encoder_resolution,
            gear_ratio=design.device.simulated.gear_ratio,
            offset=offset,
        )

    drives = builder.AddNamedSystem("drives", sampled(drive.period) if drive.period else ideal)
    builder.ExportInput(drives.get_input_port(), "state")
    builder.ExportOutput(drives.get_output_port(), "measured")
    if at_reference:
        period = design.reference.held.period
        samples = builder.AddNamedSystem("samples", sampled(period, systems.arrival(delay, period)))
        builder.ConnectInput("state", samples.get_input_port())
        builder.ExportOutput(samples.get_output_port(), "sampled_state")
    return build(builder, "encoder")


def viscous_only(design: Design) -> Design:
    """Return a design for linear analysis: no load of the reference, and viscous friction alone.

    Other friction has no frequency response, nor have stops, backlash, gear losses and ripple.
    """
    scenario, plant = design.scenario, design.scenario.plant
    plant = replace(
        plant,
        friction=Friction(viscous=plant.friction.viscous),
        stops=Stops(),
        gear_efficiency=None,
        elasticity=replace(plant.elasticity, backlash=None),
    )
    drive = replace(scenario.drive, ripple_harmonics=(), ripple_amplitude=())
    return replace(
        design.assuming(loaded=False), scenario=replace(scenario, plant=plant, drive=drive)
    )


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
    q_measured: Array
    """Positions that the encoders measure, joint side [rad]."""
    tau: Array
    """Torque of the motors, motor side [N m]."""
    tau_cmd: Array
    """Commanded torque, motor side [N m]."""


def initial_state(design: Design, q: Array | None, v: Array | None) -> Motion | None:
    """Return a given initial state as a motion of one sample; None if nothing is given.

    Raises:
        InputError: if an array has another shape than (n,).
    """
    if q is None and v is None:
        return None
    n, first = design.device.simulated.n, design.reference.tracked
    q = first.q[0] if q is None else q
    v = np.zeros(n) if v is None else v
    for name, values in (("q", q), ("v", v)):
        if values.shape != (n,):
            raise InputError(f"of shape {values.shape}, expected ({n},)", place=name)
    return Motion(first.period, q[None], v[None], np.zeros((1, n)))


def equilibrium(design: Design, start: Motion, *, of_links: bool = False) -> Equilibrium:
    """Return the steady state at which a run of a design starts.

    Args:
        design: the design of the loop.
        start: a motion of one sample without acceleration, as the encoders measure it.
        of_links: True if it is the motion of the links, wherever the encoders are.
    """
    q = measured = start.q[0]
    v, deflection = start.v[0], np.zeros(design.device.simulated.n)
    if design.springs is not None:
        axes = design.springs.elastic
        for _ in range(N_ITERATIONS):
            torque = design.device.simulated.gear_ratio * _holding_torque(design, q, start)
            play = np.sign(torque) * design.springs.backlash / 2
            deflection[axes] = torque[axes] / design.springs.stiffness[axes] + play[axes]
            on_links = of_links or measured_port(design) == "state"
            q = measured if on_links else measured - deflection
    tau = _holding_torque(design, q, start)
    drive, robot = design.drive, design.device.simulated
    tau_cmd = tau / (1 + np.array(drive.torque_error or 0.0))
    if drive.ripple_harmonics:
        angle, shares = robot.gear_ratio * (q + deflection), drive.ripple_amplitude
        ripple = robot.motor_torque_limit * ripple_at(drive.ripple_harmonics, shares, angle)
        tau_cmd = (tau - ripple) / (1 + np.array(drive.torque_error or 0.0))
    return Equilibrium(q, v, q + deflection, measured, tau, tau_cmd)


def _holding_torque(design: Design, q: Array, start: Motion) -> Array:
    """Return the torque that keeps joints at angles q at the initial speed, motor side [N m]."""
    robot, v = design.device.simulated, start.v[0]
    if design.scenario.plant.kind == "axis":  # its load depends on the reference alone
        load = np.zeros(robot.n)
        if design.assumptions.loaded:
            load = design.loads_along(start).load_torque[0]
    else:
        load = torque_groups(robot, q, v, np.zeros(robot.n)).total / robot.gear_ratio
    if design.friction is not None:
        load = load + sliding_friction(design.friction, v) / robot.gear_ratio
    if (efficiency := design.scenario.plant.gear_efficiency) is None:
        return load
    return driving_torque(np.array(efficiency), load, v)


def set_device(device: System, context: Context, design: Design, at: Equilibrium) -> None:
    """Set the state of a device, in its own context, to an equilibrium."""
    assert isinstance(device, Diagram)
    inner = partial(nested, device, context)
    if device.HasSubsystemNamed("axis_process"):
        set_state(device, context, "axis_process/motors", np.concatenate([at.q, at.v]))
    if device.HasSubsystemNamed("multibody_plant"):
        set_state(device, context, "multibody_plant", np.concatenate([at.q, at.v]))
    if design.springs is not None and device.HasSubsystemNamed("elastic_joints"):
        set_motor_state(*inner("elastic_joints"), at.q_motor, at.v, springs=design.springs)
    if design.friction is not None and device.HasSubsystemNamed("friction"):
        set_sliding(*inner("friction"), at.v, friction=design.friction)
    if design.drive.torque_bandwidth is not None and device.HasSubsystemNamed("torque_loop"):
        limit = design.device.simulated.motor_torque_limit
        given = at.tau_cmd * (1 + np.array(design.drive.torque_error or 0.0))  # without ripple
        set_motor_torque(*inner("torque_loop"), given, motor_torque_limit=limit)


def set_encoder(block: System, context: Context, design: Design, at: Equilibrium) -> None:
    """Set the samples of encoders, in their own context, to an equilibrium."""
    for part in block.GetSystems() if isinstance(block, Diagram) else ():
        if isinstance(part, Diagram):
            own = block.GetMutableSubsystemContext(part, context)
            set_measured(
                part,
                own,
                at.q_measured,
                at.v,
                resolution=design.drive.encoder_resolution,
                gear_ratio=design.device.simulated.gear_ratio,
            )
