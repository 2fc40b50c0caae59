"""The three control loops of the paper, as Drake diagrams of the same blocks.

Each can be built for two uses: `boxed=False` to simulate, with all systems side by side and logs;
`boxed=True` to export, with one box for each block of the paper's figures and no logs. The wiring
is the same.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Diagram, DiagramBuilder, InputPort, OutputPort
from pydrake.systems.primitives import PassThrough

from sdt_drake.control import CONTROLLERS, SpeedGains, damping_ratio
from sdt_drake.design import Design
from sdt_drake.device import Drive, Friction, joint_friction, sliding_friction
from sdt_drake.errors import checked_number
from sdt_drake.systems import (
    Block,
    Envelope,
    add_logs,
    axis_process_block,
    constant_block,
    ctc_feedforward_block,
    disturbance_block,
    dynamic_saturation_block,
    elastic_joints_block,
    encoder_block,
    feedforward_torque_block,
    friction_block,
    gain_schedule_block,
    inverse_dynamics_block,
    load_torque_block,
    pi_speed_controller_block,
    place_boxed,
    place_flat,
    position_loop_block,
    reference_source_block,
    robot_plant_block,
    table_block,
    torque_loop_block,
    true_load_block,
    zero_order_hold_block,
)

Array = NDArray[np.float64]

PLANT_NAME = {"axis": "axis_process", "coupled": "multibody_plant"}
"""Name of the system (where not boxed) whose continuous state is [q, v], by kind of plant."""


PI_NAME = "pi_speed_controller"
"""Name of the system whose state is the integral of the speed error; with anti-windup its part
"integral"."""


def make_loop(design: Design, *, boxed: bool = False) -> Diagram:
    """The loop of the scenario's plant: `make_axis_loop` or `make_coupled_loop`."""
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
        boxed: for export, see the module.

    Raises:
        InputError: for a step that is not finite, or other values that are not > 0.
    """
    checked_number(step, "step")
    checked_number(log_period, "log_period", minimum=0, exclusive=True)
    loop = _Loop(boxed)
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
    return loop.finish("step_loop", {"state": state}, log_period)


def make_axis_loop(design: Design, *, boxed: bool = False) -> Diagram:
    """The paper's simulation models, all axes in one diagram (Figures 3, 5 and 6).

    Each motor turns its own constant inertia against the load torque of the reference, with its
    limits widened by the alleviating torque. With "pi_ctc" the load torque is fed forward, and the
    disturbance makes the true load differ from it.
    """
    loop = _Loop(boxed)
    reference, loads = _place_reference_and_loads(loop, design)
    process = _place_process(loop, design)
    device = _place_device(loop, design, process)
    torques = _place_control(
        loop, design, reference, device, loads, loads.outputs["alleviating_torque"]
    )
    load_torque = loads.outputs["load_torque"]
    _connect_loads(loop, design, process, device, load_torque, {"modelled_load": load_torque})
    return _finish(loop, "axis_loop", design, device, torques, load_torque)


def make_coupled_loop(
    design: Design, *, boxed: bool = False, widen_limits: bool = False
) -> Diagram:
    """The MultibodyPlant under the same controllers: all joints at once, coupled by their dynamics.

    The coupling torques act physically, so the motors' limits are not widened and nothing loads
    the motors but the plant; the disturbance and friction act as generalised forces.

    Args:
        design: a resolved scenario.
        boxed: for export, see the module.
        widen_limits: widen the limits by the alleviating torque all the same, as in the axis loop.
    """
    robot, scenario = design.robot, design.scenario
    loop = _Loop(boxed)
    reference, loads = _place_reference_and_loads(loop, design)
    process = _place_process(
        loop,
        design,
        loaded=scenario.disturbance.amplitude > 0 or scenario.plant.friction is not None,
    )
    device = _place_device(loop, design, process)
    if widen_limits:
        alleviating_torque = loads.outputs["alleviating_torque"]
    else:
        none = loop.place(
            "no_widening", constant_block, signal="alleviating_torque", value=np.zeros(robot.n)
        )
        alleviating_torque = none.outputs["alleviating_torque"]
    torques = _place_control(loop, design, reference, device, loads, alleviating_torque)
    load_torque = loads.outputs["load_torque"]
    _connect_loads(loop, design, process, device, load_torque, {})
    return _finish(loop, "coupled_loop", design, device, torques, load_torque)


def make_process(design: Design) -> Diagram:
    """What a controller acts on, alone and linear but for the plant: for linear analysis.

    From `tau_cmd` to `measured` (what the encoders see) and `state` (of the links). Motors do not
    saturate, and friction is left out: neither has a frequency response.
    """
    builder = DiagramBuilder()
    loop = _Loop(False, builder)
    process = _place_process(loop, design, loaded=False)
    device = _place_device(loop, design, process, friction=False)
    tau = device.tau
    if design.scenario.drive is not None:
        torque_loop = _place_torque_loop(loop, design)
        loop.connect(torque_loop.outputs["tau"], tau)
        tau = torque_loop.inputs["tau_limited"]
    if design.scenario.plant.kind == "axis":
        none = loop.place(
            "no_load", constant_block, signal="load_torque", value=np.zeros(design.robot.n)
        )
        loop.connect(none.outputs["load_torque"], process.inputs["load_torque"])
    builder.ExportInput(tau, "tau_cmd")
    builder.ExportOutput(device.measured, "measured")
    builder.ExportOutput(device.state, "state")
    return loop.finish("process", {}, design.motion.period)


def make_feedback(design: Design, sample: int = 0) -> Diagram:
    """A controller's feedback alone, from `reference` and `measured` to `tau_fb`.

    Its speed loop is sampled where the drive has a period. Encoders are ideal and never late.

    Args:
        design: a resolved scenario.
        sample: of the motion, whose inertia scheduled gains follow.
    """
    builder = DiagramBuilder()
    n = design.robot.n
    reference = builder.AddNamedSystem("reference", PassThrough(3 * n))
    measured = builder.AddNamedSystem("measured", PassThrough(2 * n))
    controller = _place_feedback(
        _Loop(False, builder),
        design,
        reference.get_output_port(),
        measured.get_output_port(),
        frozen_at=sample,
    )
    builder.ExportInput(reference.get_input_port(), "reference")
    builder.ExportInput(measured.get_input_port(), "measured")
    builder.ExportOutput(controller.outputs["tau_fb"], "tau_fb")
    return builder.Build()


# --- what they have in common ----------------------------------------------------------------


class _Loop:
    """A loop being built: its blocks, flat or boxed, its wires, and its logs if it is flat."""

    def __init__(self, boxed: bool, builder: DiagramBuilder | None = None) -> None:
        self.boxed = boxed
        self._builder = builder or DiagramBuilder()
        self._place_in = place_boxed if boxed else place_flat

    def place(self, name: str, describe: Callable[..., None], **arguments) -> Block:
        return self._place_in(self._builder, name, describe, **arguments)

    def place_open(self, name: str, describe: Callable[..., None], **arguments) -> Block:
        """A block whose inside is to be seen in an export too."""
        return place_flat(self._builder, name, describe, **arguments)

    def place_table(self, name: str, design: Design, signals: Mapping[str, Array]) -> Block:
        """Signals along the motion, arriving with the reference."""
        return self.place(
            name,
            table_block,
            motion=design.motion,
            signals=signals,
            delay=_drive(design).reference_delay,
        )

    def connect(self, output: OutputPort, target: InputPort) -> None:
        self._builder.Connect(output, target)

    def finish(self, name: str, logs: dict[str, OutputPort], log_period: float) -> Diagram:
        if not self.boxed and logs:
            add_logs(self._builder, logs, log_period)
        diagram = self._builder.Build()
        diagram.set_name(name)
        return diagram


class _Device(NamedTuple):
    """A plant with what its joints add: where torque goes in, and what comes out."""

    tau: InputPort
    state: OutputPort
    motor_state: OutputPort
    measured: OutputPort
    friction: OutputPort | None


class _Torques(NamedTuple):
    """Of the motors: asked for, after saturation, as given."""

    tau_cmd: OutputPort
    tau_limited: OutputPort
    tau: OutputPort


def _drive(design: Design) -> Drive:
    return design.scenario.drive or Drive()


def _place_reference_and_loads(loop: _Loop, design: Design) -> tuple[OutputPort, Block]:
    """The held reference, and the block of the load torque: a table, or on line."""
    motion, delay = design.motion, _drive(design).reference_delay
    source = loop.place("reference_source", reference_source_block, motion=motion, delay=delay)
    hold = loop.place(
        "zero_order_hold",
        zero_order_hold_block,
        size=3 * motion.n,
        period=motion.period,
        delay=delay,
    )
    loop.connect(source.outputs["reference"], hold.inputs["reference"])
    reference = hold.outputs["reference"]
    if design.scenario.inverse_dynamics == "table":
        loads = loop.place_table("load_torque_table", design, design.loads._asdict())
    else:
        loads = loop.place(
            "load_torque", load_torque_block, robot=design.robot, sign=design.scenario.algorithm
        )
        loop.connect(reference, loads.inputs["reference"])
    return reference, loads


def _place_process(loop: _Loop, design: Design, *, loaded: bool = True) -> Block:
    """The plant of the scenario; elastic joints have their motors' inertia beside it."""
    robot, elastic = design.robot, design.elastic
    if design.scenario.plant.kind == "coupled":
        return loop.place(
            PLANT_NAME["coupled"],
            robot_plant_block,
            robot=robot,
            loaded=loaded,
            without_rotor=None if elastic is None else elastic.elastic,
        )
    i_eff = design.i_eff
    if elastic is not None:
        i_eff = i_eff - np.where(elastic.elastic, robot.rotor_inertia, 0.0)
    return loop.place(
        PLANT_NAME["axis"], axis_process_block, i_eff=i_eff, gear_ratio=robot.gear_ratio
    )


def _place_device(loop: _Loop, design: Design, process: Block, *, friction: bool = True) -> _Device:
    """Elastic joints and friction around a plant."""
    robot, plant = design.robot, design.scenario.plant
    state = motor_state = measured = process.outputs["state"]
    tau = process.inputs["tau"]
    if design.elastic is not None and plant.elasticity is not None:
        joints = loop.place(
            "elastic_joints",
            elastic_joints_block,
            springs=design.elastic,
            rotor_inertia=robot.rotor_inertia,
            gear_ratio=robot.gear_ratio,
        )
        loop.connect(state, joints.inputs["state"])
        loop.connect(joints.outputs["tau_link"], tau)
        tau, motor_state = joints.inputs["tau"], joints.outputs["motor_state"]
        measured = motor_state if plant.elasticity.encoder == "motor" else state
    opposing = None
    if friction and plant.friction is not None:
        block = loop.place(
            "friction",
            friction_block,
            friction=joint_friction(plant.friction, robot.n),
            gear_ratio=robot.gear_ratio,
        )
        loop.connect(state, block.inputs["state"])
        opposing = block.outputs["friction"]
    return _Device(tau, state, motor_state, measured, opposing)


def _connect_loads(
    loop: _Loop,
    design: Design,
    process: Block,
    device: _Device,
    load_torque: OutputPort,
    parts: Mapping[str, OutputPort],
) -> None:
    """What the motors turn against beside the plant: `parts`, disturbance, friction."""
    parts = dict(parts)
    choice = design.scenario.disturbance
    if choice.amplitude > 0:
        disturbance = loop.place(
            "disturbance",
            disturbance_block,
            n=design.robot.n,
            amplitude=choice.amplitude,
            omega_d=choice.omega_d,
        )
        loop.connect(load_torque, disturbance.inputs["load_torque"])
        parts["disturbance"] = disturbance.outputs["disturbance"]
    if device.friction is not None:
        parts["friction"] = device.friction
    if len(parts) > 1:
        total = loop.place("true_load", true_load_block, n=design.robot.n, parts=list(parts))
        for name, port in parts.items():
            loop.connect(port, total.inputs[name])
        parts = {"load_torque": total.outputs["load_torque"]}
    for port in parts.values():
        loop.connect(port, process.inputs["load_torque"])


def _place_control(
    loop: _Loop,
    design: Design,
    reference: OutputPort,
    device: _Device,
    loads: Block,
    alleviating_torque: OutputPort,
) -> _Torques:
    """Feedback, feedforward if the controller has one, saturation, and the drives' torque loop."""
    robot, drive = design.robot, _drive(design)
    controller = _place_feedback(loop, design, reference, device.measured)
    tau_cmd = controller.outputs["tau_fb"]
    tau_ff = _place_feedforward_torque(loop, design, reference, loads)
    if tau_ff is not None:
        feedforward = loop.place("ctc_feedforward", ctc_feedforward_block, n=robot.n)
        loop.connect(tau_cmd, feedforward.inputs["tau_fb"])
        loop.connect(tau_ff, feedforward.inputs["tau_ff"])
        tau_cmd = feedforward.outputs["tau_cmd"]

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
        loop.connect(device.motor_state, saturation.inputs["state"])
    tau = tau_limited = saturation.outputs["tau"]
    if design.scenario.controller.anti_windup:
        loop.connect(tau_cmd, controller.inputs["tau_cmd"])
        loop.connect(tau_limited, controller.inputs["tau"])

    if design.scenario.drive is not None:
        torque_loop = _place_torque_loop(loop, design)
        loop.connect(tau_limited, torque_loop.inputs["tau_limited"])
        tau = torque_loop.outputs["tau"]
    loop.connect(tau, device.tau)
    return _Torques(tau_cmd, tau_limited, tau)


def _place_torque_loop(loop: _Loop, design: Design) -> Block:
    drive = _drive(design)
    return loop.place(
        "torque_loop",
        torque_loop_block,
        motor_torque_limit=design.robot.motor_torque_limit,
        bandwidth=drive.torque_bandwidth,
        error=drive.torque_error,
    )


def _place_feedback(
    loop: _Loop,
    design: Design,
    reference: OutputPort,
    measured: OutputPort,
    frozen_at: int | None = None,
) -> Block:
    """The controller's feedback; see CONTROLLERS for what each kind consists of.

    Frozen at a sample of the motion, nothing but the PI controllers is sampled, and the gains do
    not follow the motion: for linear analysis.
    """
    frozen = frozen_at is not None

    def sampled(name: str, period: float) -> OutputPort:
        return measured if frozen else _place_encoder(loop, design, name, measured, period)

    choice, drive = design.scenario.controller, _drive(design)
    feedback = CONTROLLERS[choice.kind].feedback
    if feedback == "inverse_dynamics":
        state = sampled("encoder", design.motion.period)
        i_eff_max = design.gains.ki / design.omega_n**2
        controller = loop.place(
            "inverse_dynamics",
            inverse_dynamics_block,
            model=design.model,
            omega_n=design.omega_n,
            zeta=damping_ratio(design.gains, i_eff_max),
        )
        loop.connect(reference, controller.inputs["reference"])
        loop.connect(state, controller.inputs["state"])
        return controller

    state = measured
    if drive.period is not None:
        state = sampled("encoder", drive.period)
    if feedback == "position":
        sample = sampled("position_encoder", design.motion.period)
        position_loop = loop.place(
            "position_loop", position_loop_block, position_gain=design.position_gain
        )
        loop.connect(reference, position_loop.inputs["reference"])
        loop.connect(sample, position_loop.inputs["state"])
        reference = position_loop.outputs["reference"]
    if feedback == "scheduled":
        shares = (
            loop.place(
                "inertia",
                constant_block,
                signal="inertia_share",
                value=design.inertia_share[frozen_at],
            )
            if frozen
            else loop.place_table("inertia_table", design, {"inertia_share": design.inertia_share})
        )
        schedule = loop.place("gain_schedule", gain_schedule_block, n=design.robot.n)
        loop.connect(reference, schedule.inputs["reference"])
        loop.connect(state, schedule.inputs["state"])
        loop.connect(shares.outputs["inertia_share"], schedule.inputs["inertia_share"])
        reference, state = schedule.outputs["reference"], schedule.outputs["state"]
    controller = loop.place(
        PI_NAME,
        pi_speed_controller_block,
        gains=design.gains,
        gear_ratio=design.robot.gear_ratio,
        structure=choice.structure_in_use,
        anti_windup=choice.anti_windup,
        period=drive.period,
        elements=loop.boxed,
    )
    loop.connect(reference, controller.inputs["reference"])
    loop.connect(state, controller.inputs["state"])
    return controller


def _place_encoder(
    loop: _Loop, design: Design, name: str, measured: OutputPort, period: float
) -> OutputPort:
    encoder = loop.place(
        name,
        encoder_block,
        n=design.robot.n,
        period=period,
        resolution=_drive(design).encoder_resolution,
        gear_ratio=design.robot.gear_ratio,
    )
    loop.connect(measured, encoder.inputs["state"])
    return encoder.outputs["state"]


def _place_feedforward_torque(
    loop: _Loop, design: Design, reference: OutputPort, loads: Block
) -> OutputPort | None:
    """The port of tau_ff, None where the controller has none."""
    scenario, choice = design.scenario, design.scenario.controller
    if design.tau_ff is None:
        return None
    knows_the_load = choice.model.exact and choice.feedforward_gain is None
    if choice.feedforward_in_use == "ctc" and knows_the_load and not choice.friction_compensation:
        return loads.outputs["load_torque"]
    if scenario.inverse_dynamics == "table":
        table = loop.place_table("feedforward_table", design, {"tau_ff": design.tau_ff})
        return table.outputs["tau_ff"]
    n = design.robot.n
    friction = joint_friction(scenario.plant.friction or Friction(), n)
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


def _finish(
    loop: _Loop,
    name: str,
    design: Design,
    device: _Device,
    torques: _Torques,
    load_torque: OutputPort,
) -> Diagram:
    logs = {"state": device.state, "tau_cmd": torques.tau_cmd, "tau": torques.tau}
    if torques.tau is not torques.tau_limited:
        logs["tau_limited"] = torques.tau_limited
    logs["load_torque"] = load_torque
    return loop.finish(name, logs, design.motion.period)
