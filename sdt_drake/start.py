"""Where a run starts: on the reference, in the equilibrium of what has gone on like that before."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context, Diagram
from pydrake.systems.primitives import ZeroOrderHold

from sdt_drake.control import CONTROLLERS
from sdt_drake.design import Design
from sdt_drake.device import Drive, Friction, friction_parameters, sliding_friction, sliding_stretch
from sdt_drake.dynamics import torque_groups
from sdt_drake.loops import PI_NAME, PLANT_NAME
from sdt_drake.systems import STRETCH_UNIT, torque_unit

Array = NDArray[np.float64]

_ITERATIONS = 10  # of the angle by which gravity turns a link away from its motor


def start_in_equilibrium(design: Design, diagram: Diagram, context: Context) -> None:
    """Set what a loop of `design` remembers: joints, motors, springs, friction, integrals, holds.

    What the encoders see is on the first sample of the reference, and has moved at its speed, not
    accelerated, for long: motors carry the load, springs are wound, and integrals give what the
    feedforward does not. A controller without an integral has no equilibrium there with a wrong
    model; it starts on the reference all the same.
    """
    n, v = design.motion.n, design.motion.v[0]
    scenario, drive = design.scenario, design.scenario.drive or Drive()
    systems = {system.get_name(): system for system in diagram.GetSystems()}

    def context_of(name: str) -> Context:
        return systems[name].GetMyMutableContextFromRoot(context)

    link, motor = _positions(design)
    tau = _holding_torque(design, link)
    context_of(PLANT_NAME[scenario.plant.kind]).SetContinuousState(np.concatenate([link, v]))
    if design.elastic is not None:
        axes = design.elastic.elastic
        context_of("elastic_joints").SetContinuousState(np.concatenate([motor[axes], v[axes]]))
    if scenario.plant.friction is not None:
        stretch = sliding_stretch(friction_parameters(scenario.plant.friction, n), v)
        context_of("friction").SetContinuousState(stretch / STRETCH_UNIT)
    if drive.torque_bandwidth is not None:
        unit = torque_unit(design.robot.motor_torque_limit)
        context_of("torque_loop").SetContinuousState(tau / unit)
    integral = f"{PI_NAME}.integral" if scenario.controller.anti_windup else PI_NAME
    if integral in systems:
        own, start = context_of(integral), _integral(design, drive, tau)
        if own.num_discrete_state_groups() > 0:
            own.SetDiscreteState(start)
        else:
            own.SetContinuousState(start)
    for name, system in systems.items():  # in the order of the signals, but for the encoders
        if isinstance(system, ZeroOrderHold):
            hold = context_of(name)
            hold.SetDiscreteState(system.get_input_port().Eval(hold))
    for name in systems:
        if name.endswith(".before"):  # of an encoder, which takes the speed from differences
            position = context_of(name.replace(".before", ".now")).get_discrete_state_vector()
            period = systems[name].period()
            context_of(name).SetDiscreteState(position.value() - period * v[:n])


def _holding_torque(design: Design, q: Array) -> Array:
    """What moves the joints on at the first speed, motor side [N m], shape (n,)."""
    robot, v = design.robot, design.motion.v[0]
    if design.scenario.plant.kind == "axis":  # which has its load from the reference alone
        load = design.steady_load
    else:
        load = torque_groups(robot, q, v, np.zeros(robot.n)).total / robot.gear_ratio
    friction = friction_parameters(design.scenario.plant.friction or Friction(), robot.n)
    return load + sliding_friction(friction, v) / robot.gear_ratio


def _positions(design: Design) -> tuple[Array, Array]:
    """Of links and motors, joint side [rad], each of shape (n,): apart where springs are wound."""
    seen, elastic = design.motion.q[0], design.elastic
    if elastic is None:
        return seen, seen
    sees_link = design.scenario.plant.elasticity.encoder == "link"
    link, wound, axes = seen, np.zeros(len(seen)), elastic.elastic
    for _ in range(_ITERATIONS):
        torque = design.robot.gear_ratio * _holding_torque(design, link)
        wound[axes] = torque[axes] / elastic.stiffness[axes]
        link = seen if sees_link else seen - wound
    return link, link + wound


def _integral(design: Design, drive: Drive, tau: Array) -> Array:
    """State of the PI controllers that makes the motors give `tau`, motor side [rad]."""
    choice, gains, motion = design.scenario.controller, design.gains, design.motion
    asked = tau if drive.torque_error is None else tau / (1 + np.array(drive.torque_error))
    asked = asked - design.steady_ff
    if choice.structure_in_use == "p_in_feedback":  # -K_PS v
        share = 1.0
        if CONTROLLERS[choice.kind].feedback == "scheduled":
            share = design.inertia_share[0]
        asked = asked + share * gains.kp * design.robot.gear_ratio * motion.v[0]
    return asked / gains.ki
