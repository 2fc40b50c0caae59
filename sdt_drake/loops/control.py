"""From the reference to the torque of the motors: feedback, feedforward, saturation, drive."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from pydrake.systems.framework import OutputPort

from sdt_drake.control import CONTROLLERS
from sdt_drake.device import Friction, friction_parameters, sliding_friction
from sdt_drake.loops.builder import DesignLoopBuilder
from sdt_drake.loops.feedback import FEEDBACKS
from sdt_drake.loops.plant import Device
from sdt_drake.systems import (
    Block,
    Envelope,
    ctc_feedforward_block,
    dynamic_saturation_block,
    feedforward_torque_block,
    load_torque_block,
    reference_source_block,
    torque_loop_block,
    zero_order_hold_block,
)


class Torques(NamedTuple):
    """Of the motors: asked for, after saturation, as given."""

    tau_cmd: OutputPort
    tau_limited: OutputPort
    tau: OutputPort


def place_reference(loop: DesignLoopBuilder) -> OutputPort:
    """The reference, held for an interpolation period."""
    motion, delay = loop.motion, loop.drive.reference_delay
    source = loop.place("reference_source", reference_source_block, motion=motion, delay=delay)
    hold = loop.place(
        "zero_order_hold",
        zero_order_hold_block,
        size=3 * motion.n,
        period=motion.period,
        delay=delay,
    )
    loop.connect(source.outputs["reference"], hold.inputs["reference"])
    return hold.outputs["reference"]


def place_load_torque(loop: DesignLoopBuilder, reference: OutputPort) -> Block:
    """Load torque and alleviating torque of the reference: a table, or on line."""
    design = loop.design
    if design.scenario.inverse_dynamics == "table":
        return loop.place_table("load_torque_table", design.loads._asdict())
    robot = design.robot if design.scenario.plant.kind == "axis" else design.nominal
    loads = loop.place(
        "load_torque", load_torque_block, robot=robot, sign=design.scenario.algorithm
    )
    loop.connect(reference, loads.inputs["reference"])
    return loads


def place_control(
    loop: DesignLoopBuilder,
    reference: OutputPort,
    device: Device,
    load_torque: OutputPort,
    alleviating_torque: OutputPort,
) -> Torques:
    """The controller, the motors' limits and the drives, wired to the device."""
    controller = place_feedback(loop, reference, device.measured)
    tau_cmd = controller.outputs["tau_fb"]
    tau_ff = _place_feedforward_torque(loop, reference, load_torque)
    if tau_ff is not None:
        feedforward = loop.place("ctc_feedforward", ctc_feedforward_block, n=loop.design.robot.n)
        loop.connect(tau_cmd, feedforward.inputs["tau_fb"])
        loop.connect(tau_ff, feedforward.inputs["tau_ff"])
        tau_cmd = feedforward.outputs["tau_cmd"]
    tau_limited = _place_saturation(loop, tau_cmd, alleviating_torque, device.motor_state)
    if loop.design.scenario.controller.anti_windup:
        loop.connect(tau_cmd, controller.inputs["tau_cmd"])
        loop.connect(tau_limited, controller.inputs["tau"])
    tau = tau_limited
    if loop.design.scenario.drive is not None:
        torque_loop = place_torque_loop(loop)
        loop.connect(tau_limited, torque_loop.inputs["tau_limited"])
        tau = torque_loop.outputs["tau"]
    loop.connect(tau, device.tau)
    return Torques(tau_cmd, tau_limited, tau)


def place_feedback(loop: DesignLoopBuilder, reference: OutputPort, measured: OutputPort) -> Block:
    """The feedback of the scenario's controller."""
    feedback = CONTROLLERS[loop.design.scenario.controller.kind].feedback
    return FEEDBACKS[feedback](loop, reference, measured)


def place_torque_loop(loop: DesignLoopBuilder) -> Block:
    """The torque loop of the drives."""
    return loop.place(
        "torque_loop",
        torque_loop_block,
        motor_torque_limit=loop.design.robot.motor_torque_limit,
        bandwidth=loop.drive.torque_bandwidth,
        error=loop.drive.torque_error,
    )


def _place_saturation(
    loop: DesignLoopBuilder,
    tau_cmd: OutputPort,
    alleviating_torque: OutputPort,
    motor_state: OutputPort,
) -> OutputPort:
    robot, drive = loop.design.robot, loop.drive
    envelope = None
    if drive.n1 is not None and drive.n0 is not None:
        envelope = Envelope(np.array(drive.n1), np.array(drive.n0), robot.gear_ratio)
    saturation = loop.place(
        "dynamic_saturation",
        dynamic_saturation_block,
        motor_torque_limit=robot.motor_torque_limit,
        envelope=envelope,
    )
    loop.connect(tau_cmd, saturation.inputs["tau_cmd"])
    loop.connect(alleviating_torque, saturation.inputs["alleviating_torque"])
    if envelope is not None:
        loop.connect(motor_state, saturation.inputs["state"])
    return saturation.outputs["tau"]


def _place_feedforward_torque(
    loop: DesignLoopBuilder, reference: OutputPort, load_torque: OutputPort
) -> OutputPort | None:
    """The port of tau_ff, None where the controller has none."""
    design, scenario = loop.design, loop.design.scenario
    choice = scenario.controller
    if design.tau_ff is None:
        return None
    as_it_is = choice.model.exact and choice.feedforward_gain is None
    if choice.feedforward_in_use == "ctc" and as_it_is and not choice.friction_compensation:
        return load_torque
    if scenario.inverse_dynamics == "table":
        return loop.place_table("feedforward_table", {"tau_ff": design.tau_ff}).outputs["tau_ff"]
    n = design.robot.n
    friction = friction_parameters(scenario.plant.friction or Friction(), n)
    block = loop.place(
        "feedforward_torque",
        feedforward_torque_block,
        model=design.model,
        feedforward=choice.feedforward_in_use,
        sign=scenario.algorithm,
        gain=np.ones(n) if choice.feedforward_gain is None else np.array(choice.feedforward_gain),
        friction=lambda v: choice.friction_compensation * sliding_friction(friction, v),
    )
    loop.connect(reference, block.inputs["reference"])
    return block.outputs["tau_ff"]
