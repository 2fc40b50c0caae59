"""The three control loops of the paper, as Drake diagrams of the same blocks.

Each can be built for two uses: `boxed=False` to simulate, with all systems side by side and logs;
`boxed=True` to export, with one box for each block of the paper's figures and no logs. The wiring
is the same.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from pydrake.systems.framework import Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import ConstantVectorSource

from sdt_drake.control import SpeedGains
from sdt_drake.design import Design
from sdt_drake.errors import checked_number
from sdt_drake.systems import (
    Block,
    add_logs,
    axis_process_block,
    ctc_feedforward_block,
    disturbance_block,
    dynamic_saturation_block,
    load_torque_block,
    load_torque_table_block,
    pi_speed_controller_block,
    place_boxed,
    place_flat,
    reference_source_block,
    robot_plant_block,
    true_load_block,
    zero_order_hold_block,
)

PLANT_NAME = {"axis": "axis_process", "coupled": "multibody_plant"}
"""Name of the system (where not boxed) whose continuous state is [q, v], by kind of plant."""


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
        InputError: for values that are not > 0.
    """
    checked_number(log_period, "log_period", minimum=0, exclusive=True)
    builder, place = _start(boxed)
    reference = builder.AddNamedSystem(
        "step_reference",
        ConstantVectorSource([0.0, step, 0.0]),  # q_ref, v_ref, vd_ref
    )
    controller = place(
        "pi_speed_controller",
        pi_speed_controller_block,
        gains=gains,
        gear_ratio=[1.0],
        structure=structure,
    )
    process = place(PLANT_NAME["axis"], axis_process_block, i_eff=[i_eff], gear_ratio=[1.0])
    no_load = builder.AddNamedSystem("no_load", ConstantVectorSource([0.0]))

    state = process.outputs["state"]
    builder.Connect(reference.get_output_port(), controller.inputs["reference"])
    builder.Connect(state, controller.inputs["state"])
    builder.Connect(controller.outputs["tau_fb"], process.inputs["tau"])
    builder.Connect(no_load.get_output_port(), process.inputs["load_torque"])
    return _finish(builder, "step_loop", boxed, {"state": state}, log_period)


def make_axis_loop(design: Design, *, boxed: bool = False) -> Diagram:
    """The paper's simulation models, all axes in one diagram (Figures 3, 5 and 6).

    Each motor turns its own constant inertia against the load torque of the reference, with its
    limits widened by the alleviating torque. With "pi_ctc" the load torque is fed forward, and the
    disturbance makes the true load differ from it.
    """
    robot = design.robot
    builder, place = _start(boxed)
    reference, loads = _place_reference_and_loads(builder, place, design)
    load_torque = loads.outputs["load_torque"]
    process = place(
        PLANT_NAME["axis"], axis_process_block, i_eff=design.i_eff, gear_ratio=robot.gear_ratio
    )
    state = process.outputs["state"]

    tau_cmd, tau = _place_controller(
        builder, place, design, reference, state, load_torque, loads.outputs["alleviating_torque"]
    )
    builder.Connect(tau, process.inputs["tau"])
    true_load = load_torque
    disturbance = _place_disturbance(builder, place, design, load_torque)
    if disturbance is not None:
        total = place("true_load", true_load_block, n=robot.n)
        builder.Connect(load_torque, total.inputs["modelled_load"])
        builder.Connect(disturbance, total.inputs["disturbance"])
        true_load = total.outputs["load_torque"]
    builder.Connect(true_load, process.inputs["load_torque"])

    logs = {"state": state, "tau_cmd": tau_cmd, "tau": tau, "load_torque": load_torque}
    return _finish(builder, "axis_loop", boxed, logs, design.motion.period)


def make_coupled_loop(
    design: Design, *, boxed: bool = False, widen_limits: bool = False
) -> Diagram:
    """The MultibodyPlant under the same controllers: all joints at once, coupled by their dynamics.

    The coupling torques act physically, so the motors' limits are not widened and nothing loads
    the motors but the plant; the disturbance acts as a generalised force.

    Args:
        design: a resolved scenario.
        boxed: for export, see the module.
        widen_limits: widen the limits by the alleviating torque all the same, as in the axis loop.
    """
    robot = design.robot
    builder, place = _start(boxed)
    reference, loads = _place_reference_and_loads(builder, place, design)
    load_torque = loads.outputs["load_torque"]
    disturbance = _place_disturbance(builder, place, design, load_torque)
    plant = place(
        PLANT_NAME["coupled"],
        robot_plant_block,
        robot=robot,
        disturbed=disturbance is not None,
    )
    state = plant.outputs["state"]
    if widen_limits:
        alleviating_torque = loads.outputs["alleviating_torque"]
    else:
        nothing = ConstantVectorSource(np.zeros(robot.n))
        alleviating_torque = builder.AddNamedSystem("no_widening", nothing).get_output_port()

    tau_cmd, tau = _place_controller(
        builder, place, design, reference, state, load_torque, alleviating_torque
    )
    builder.Connect(tau, plant.inputs["tau"])
    if disturbance is not None:
        builder.Connect(disturbance, plant.inputs["disturbance"])

    logs = {"state": state, "tau_cmd": tau_cmd, "tau": tau, "load_torque": load_torque}
    return _finish(builder, "coupled_loop", boxed, logs, design.motion.period)


# --- what they have in common ----------------------------------------------------------------

Place = Callable[..., Block]


def _start(boxed: bool) -> tuple[DiagramBuilder, Place]:
    """A builder, and how blocks are placed in it."""
    builder = DiagramBuilder()
    place_in = place_boxed if boxed else place_flat

    def place(name, describe, **arguments):
        return place_in(builder, name, describe, **arguments)

    return builder, place


def _place_reference_and_loads(
    builder: DiagramBuilder, place: Place, design: Design
) -> tuple[OutputPort, Block]:
    """The held reference, and the block of the load torque: a table, or on line."""
    motion = design.motion
    source = place("reference_source", reference_source_block, motion=motion)
    hold = place("zero_order_hold", zero_order_hold_block, size=3 * motion.n, period=motion.period)
    builder.Connect(source.outputs["reference"], hold.inputs["reference"])
    reference = hold.outputs["reference"]
    if design.scenario.inverse_dynamics == "table":
        loads = place(
            "load_torque_table", load_torque_table_block, motion=motion, loads=design.loads
        )
    else:
        loads = place(
            "load_torque", load_torque_block, robot=design.robot, sign=design.scenario.algorithm
        )
        builder.Connect(reference, loads.inputs["reference"])
    return reference, loads


def _place_controller(
    builder: DiagramBuilder,
    place: Place,
    design: Design,
    reference: OutputPort,
    state: OutputPort,
    load_torque: OutputPort,
    alleviating_torque: OutputPort,
) -> tuple[OutputPort, OutputPort]:
    """PI, feedforward if the controller has one, and saturation: tau_cmd and tau."""
    controller = place(
        "pi_speed_controller",
        pi_speed_controller_block,
        gains=design.gains,
        gear_ratio=design.robot.gear_ratio,
        structure=design.scenario.controller.structure,
    )
    builder.Connect(reference, controller.inputs["reference"])
    builder.Connect(state, controller.inputs["state"])
    tau_cmd = controller.outputs["tau_fb"]
    if design.scenario.controller.kind == "pi_ctc":
        feedforward = place("ctc_feedforward", ctc_feedforward_block, n=design.robot.n)
        builder.Connect(tau_cmd, feedforward.inputs["tau_fb"])
        builder.Connect(load_torque, feedforward.inputs["tau_ff"])
        tau_cmd = feedforward.outputs["tau_cmd"]
    saturation = place(
        "dynamic_saturation",
        dynamic_saturation_block,
        motor_torque_limit=design.robot.motor_torque_limit,
    )
    builder.Connect(tau_cmd, saturation.inputs["tau_cmd"])
    builder.Connect(alleviating_torque, saturation.inputs["alleviating_torque"])
    return tau_cmd, saturation.outputs["tau"]


def _place_disturbance(
    builder: DiagramBuilder, place: Place, design: Design, load_torque: OutputPort
) -> OutputPort | None:
    choice = design.scenario.disturbance
    if choice.amplitude == 0:
        return None
    disturbance = place(
        "disturbance",
        disturbance_block,
        n=design.robot.n,
        amplitude=choice.amplitude,
        omega_d=choice.omega_d,
    )
    builder.Connect(load_torque, disturbance.inputs["load_torque"])
    return disturbance.outputs["disturbance"]


def _finish(
    builder: DiagramBuilder,
    name: str,
    boxed: bool,
    logs: dict[str, OutputPort],
    log_period: float,
) -> Diagram:
    if not boxed:
        add_logs(builder, logs, log_period)
    diagram = builder.Build()
    diagram.set_name(name)
    return diagram
