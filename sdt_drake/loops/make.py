"""The loops."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import Diagram, OutputPort
from pydrake.systems.primitives import PassThrough

from sdt_drake.control import SpeedGains
from sdt_drake.design import Design
from sdt_drake.errors import checked_number, checked_type
from sdt_drake.loops.builder import DesignLoopBuilder, LoopBuilder
from sdt_drake.loops.control import (
    Torques,
    place_control,
    place_feedback,
    place_load_torque,
    place_reference,
    place_torque_loop,
)
from sdt_drake.loops.feedback.speed import PI_NAME
from sdt_drake.loops.plant import PLANT_NAME, Device, has_extra_load, place_device, place_loads
from sdt_drake.systems import (
    Block,
    axis_process_block,
    constant_block,
    pi_speed_controller_block,
)


def make_loop(design: Design, *, boxed: bool = False) -> Diagram:
    """The loop of the scenario's plant: `make_axis_loop` or `make_coupled_loop`."""
    checked_type(design, Design, "design")
    make = {"axis": make_axis_loop, "coupled": make_coupled_loop}[design.scenario.plant.kind]
    return make(design, boxed=boxed)


def make_step_loop(
    *,
    gains: SpeedGains,
    i_eff: float,
    structure: str,
    step: float = 1.0,
    log_period: float = 1e-4,
    boxed: bool = False,
) -> Diagram:
    """One linear speed loop without load or limit (Figures 4 and 5): a step of its reference.

    Args:
        gains: of one controller, motor side; arrays of length 1.
        i_eff: inertia, motor side [kg m²].
        structure: "pi" or "p_in_feedback".
        step: motor speed asked for from time 0 on [rad/s].
        log_period: of the state [s].
        boxed: for export, see the package.

    Raises:
        InputError: for a step that is not finite, or other values that are not > 0.
    """
    checked_number(step, "step")
    checked_number(log_period, "log_period", minimum=0, exclusive=True)
    loop = LoopBuilder(boxed=boxed)
    reference = loop.place(
        "step_reference",
        constant_block,
        signal="reference",
        value=[0.0, step, 0.0],  # q_ref, v_ref, vd_ref
    )
    controller = loop.place_open(
        PI_NAME,
        pi_speed_controller_block,
        gains=gains,
        gear_ratio=[1.0],
        structure=structure,
        elements=boxed,
    )
    process = loop.place(PLANT_NAME["axis"], axis_process_block, i_eff=[i_eff], gear_ratio=[1.0])
    no_load = loop.place("no_load", constant_block, signal="load_torque", value=[0.0])

    state = process.outputs["state"]
    loop.connect(reference.outputs["reference"], controller.inputs["reference"])
    loop.connect(state, controller.inputs["state"])
    loop.connect(controller.outputs["tau_fb"], process.inputs["tau"])
    loop.connect(no_load.outputs["load_torque"], process.inputs["load_torque"])
    loop.log({"state": state}, log_period)
    return loop.build("step_loop")


def make_axis_loop(design: Design, *, boxed: bool = False) -> Diagram:
    """The paper's simulation models, all axes in one diagram (Figures 3, 5 and 6).

    Each motor turns its own constant inertia against the load torque of the reference, with its
    limits widened by the alleviating torque. With "pi_ctc" the load torque is fed forward, and the
    disturbance makes the true load differ from it.
    """
    loop = DesignLoopBuilder(design, boxed=boxed)
    reference = place_reference(loop)
    loads = place_load_torque(loop, reference)
    load_torque = loads.outputs["load_torque"]
    device = place_device(loop, loaded=True)
    torques = place_control(
        loop, reference, device, load_torque, loads.outputs["alleviating_torque"]
    )
    place_loads(loop, device, load_torque, {"modelled_load": load_torque})
    return _finish(loop, "axis_loop", device, torques, load_torque)


def make_coupled_loop(
    design: Design, *, boxed: bool = False, widen_limits: bool = False
) -> Diagram:
    """The MultibodyPlant under the same controllers: all joints at once, coupled by their dynamics.

    The coupling torques act physically, so the motors' limits are not widened and nothing loads
    the motors but the plant; the disturbance and friction act as generalised forces.

    Args:
        design: a resolved scenario.
        boxed: for export, see the package.
        widen_limits: widen the limits by the alleviating torque all the same, as in the axis loop.
    """
    loop = DesignLoopBuilder(design, boxed=boxed)
    reference = place_reference(loop)
    loads = place_load_torque(loop, reference)
    load_torque = loads.outputs["load_torque"]
    device = place_device(loop, loaded=has_extra_load(loop))
    alleviating_torque = loads.outputs["alleviating_torque"]
    if not widen_limits:
        alleviating_torque = _nothing(loop, "no_widening", "alleviating_torque")
    torques = place_control(loop, reference, device, load_torque, alleviating_torque)
    place_loads(loop, device, load_torque, {})
    return _finish(loop, "coupled_loop", device, torques, load_torque)


def make_process(design: Design) -> Diagram:
    """What a controller acts on, alone and linear but for the plant: for linear analysis.

    From `tau_cmd` to `measured` (what the encoders see) and `state` (of the links). Motors do not
    saturate, and friction is left out: neither has a frequency response.
    """
    loop = DesignLoopBuilder(design)
    device = place_device(loop, loaded=False)
    tau_cmd = device.tau
    if design.scenario.drive is not None:
        torque_loop = place_torque_loop(loop)
        loop.connect(torque_loop.outputs["tau"], device.tau)
        tau_cmd = torque_loop.inputs["tau_limited"]
    if device.load_torque is not None:
        loop.connect(_nothing(loop, "no_load", "load_torque"), device.load_torque)
    outputs = {"measured": device.measured, "state": device.state}
    return loop.export("process", {"tau_cmd": tau_cmd}, outputs)


def make_feedback(design: Design, sample: int = 0) -> Diagram:
    """A controller's feedback alone, from `reference` and `measured` to `tau_fb`.

    Its speed loop is sampled where the drive has a period. Encoders are ideal and never late.

    Args:
        design: a resolved scenario.
        sample: of the motion, whose inertia scheduled gains follow.
    """
    loop = DesignLoopBuilder(design, frozen_at=sample)
    n = design.robot.n
    reference = loop.place("reference", _pass_through, size=3 * n)
    measured = loop.place("measured", _pass_through, size=2 * n)
    controller = place_feedback(loop, reference.outputs["y"], measured.outputs["y"])
    inputs = {"reference": reference.inputs["u"], "measured": measured.inputs["u"]}
    return loop.export("feedback", inputs, {"tau_fb": controller.outputs["tau_fb"]})


def _pass_through(block: Block, *, size: int) -> None:
    """One input for several blocks."""
    system = block.add(PassThrough(size))
    block.inputs["u"] = system.get_input_port()
    block.outputs["y"] = system.get_output_port()


def _nothing(loop: DesignLoopBuilder, name: str, signal: str) -> OutputPort:
    block = loop.place(name, constant_block, signal=signal, value=np.zeros(loop.design.robot.n))
    return block.outputs[signal]


def _finish(
    loop: DesignLoopBuilder,
    name: str,
    device: Device,
    torques: Torques,
    load_torque: OutputPort,
) -> Diagram:
    period = loop.motion.period
    loop.log({"state": device.state, "load_torque": load_torque}, period)
    if device.measured is not device.state:
        loop.log({"measured": device.measured}, period)
    asked_and_given = {"tau_cmd": torques.tau_cmd, "tau": torques.tau}
    loop.log(asked_and_given | {"tau_limited": torques.tau_limited}, loop.drive.period or period)
    return loop.build(name)
