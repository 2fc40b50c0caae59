"""The plant of a loop with what its joints add, and the loads that act on it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from pydrake.systems.framework import InputPort, OutputPort

from sdt_drake.device import friction_parameters
from sdt_drake.loops.builder import DesignLoopBuilder
from sdt_drake.systems import (
    Block,
    axis_process_block,
    disturbance_block,
    elastic_joints_block,
    friction_block,
    robot_plant_block,
    true_load_block,
)

PLANT_NAME = {"axis": "axis_process", "coupled": "multibody_plant"}
"""Name of the system (where not boxed) whose continuous state is [q, v], by kind of plant."""


class Device(NamedTuple):
    """A plant with its joints: where torque goes in, and what comes out."""

    tau: InputPort
    load_torque: InputPort | None
    state: OutputPort
    motor_state: OutputPort
    measured: OutputPort


def place_device(loop: DesignLoopBuilder, *, loaded: bool) -> Device:
    """The plant of the scenario, and its elastic joints if it has any.

    Args:
        loop: where.
        loaded: whether a load torque acts on the coupled plant; it does on the axis plant.
    """
    design, elasticity = loop.design, loop.design.scenario.plant.elasticity
    process = _place_process(loop, loaded)
    tau, load_torque = process.inputs["tau"], process.inputs.get("load_torque")
    state = process.outputs["state"]
    if design.elastic is None or elasticity is None:
        return Device(tau, load_torque, state, motor_state=state, measured=state)
    joints = loop.place(
        "elastic_joints",
        elastic_joints_block,
        springs=design.elastic,
        rotor_inertia=design.robot.rotor_inertia,
        gear_ratio=design.robot.gear_ratio,
    )
    loop.connect(state, joints.inputs["state"])
    loop.connect(joints.outputs["tau_link"], tau)
    motor_state = joints.outputs["motor_state"]
    measured = motor_state if elasticity.encoder == "motor" else state
    return Device(joints.inputs["tau"], load_torque, state, motor_state, measured)


def _place_process(loop: DesignLoopBuilder, loaded: bool) -> Block:
    """The links; behind elastic joints without the inertia of their motors."""
    robot, elastic = loop.design.robot, loop.design.elastic
    if loop.design.scenario.plant.kind == "coupled":
        return loop.place(
            PLANT_NAME["coupled"],
            robot_plant_block,
            robot=robot,
            loaded=loaded,
            without_rotor=None if elastic is None else elastic.elastic,
        )
    i_eff = loop.design.i_eff
    if elastic is not None:
        i_eff = i_eff - np.where(elastic.elastic, robot.rotor_inertia, 0.0)
    return loop.place(
        PLANT_NAME["axis"], axis_process_block, i_eff=i_eff, gear_ratio=robot.gear_ratio
    )


def has_extra_load(loop: DesignLoopBuilder) -> bool:
    """Whether disturbance or friction act beside the plant's own dynamics."""
    scenario = loop.design.scenario
    return scenario.disturbance.amplitude > 0 or scenario.plant.friction is not None


def place_loads(
    loop: DesignLoopBuilder,
    device: Device,
    load_torque: OutputPort,
    acting: Mapping[str, OutputPort],
) -> None:
    """What the motors turn against beside the plant's own dynamics.

    Args:
        loop: where.
        device: what is loaded.
        load_torque: of the reference, which the disturbance is a share of.
        acting: loads beside disturbance and friction, by name.
    """
    design, loads = loop.design, dict(acting)
    disturbance, friction = design.scenario.disturbance, design.scenario.plant.friction
    if disturbance.amplitude > 0:
        block = loop.place(
            "disturbance",
            disturbance_block,
            n=design.robot.n,
            amplitude=disturbance.amplitude,
            omega_d=disturbance.omega_d,
        )
        loop.connect(load_torque, block.inputs["load_torque"])
        loads["disturbance"] = block.outputs["disturbance"]
    if friction is not None:
        block = loop.place(
            "friction",
            friction_block,
            friction=friction_parameters(friction, design.robot.n),
            gear_ratio=design.robot.gear_ratio,
        )
        loop.connect(device.state, block.inputs["state"])
        loads["friction"] = block.outputs["friction"]
    if len(loads) > 1:
        total = loop.place("true_load", true_load_block, n=design.robot.n, parts=list(loads))
        for name, port in loads.items():
            loop.connect(port, total.inputs[name])
        loads = {"load_torque": total.outputs["load_torque"]}
    for port in loads.values():
        loop.connect(port, device.load_torque)
