"""The three control loops of the paper, as Drake diagrams of the same blocks.

Each can be built for two uses: `boxed=False` to simulate, with all systems side by side and logs;
`boxed=True` to export, with one box for each block of the paper's figures and no logs. The wiring
is the same.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from pydrake.systems.framework import Diagram, DiagramBuilder, InputPort, OutputPort

from sdt_drake.control import SpeedGains
from sdt_drake.design import Design
from sdt_drake.errors import checked_number
from sdt_drake.systems import (
    Block,
    add_logs,
    axis_process_block,
    constant_block,
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
        "pi_speed_controller",
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
    robot = design.robot
    loop = _Loop(boxed)
    reference, loads = _place_reference_and_loads(loop, design)
    load_torque = loads.outputs["load_torque"]
    process = loop.place(
        PLANT_NAME["axis"], axis_process_block, i_eff=design.i_eff, gear_ratio=robot.gear_ratio
    )
    state = process.outputs["state"]

    tau_cmd, tau = _place_controller(
        loop, design, reference, state, load_torque, loads.outputs["alleviating_torque"]
    )
    loop.connect(tau, process.inputs["tau"])
    true_load = load_torque
    disturbance = _place_disturbance(loop, design, load_torque)
    if disturbance is not None:
        total = loop.place("true_load", true_load_block, n=robot.n)
        loop.connect(load_torque, total.inputs["modelled_load"])
        loop.connect(disturbance, total.inputs["disturbance"])
        true_load = total.outputs["load_torque"]
    loop.connect(true_load, process.inputs["load_torque"])

    logs = {"state": state, "tau_cmd": tau_cmd, "tau": tau, "load_torque": load_torque}
    return loop.finish("axis_loop", logs, design.motion.period)


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
    loop = _Loop(boxed)
    reference, loads = _place_reference_and_loads(loop, design)
    load_torque = loads.outputs["load_torque"]
    disturbance = _place_disturbance(loop, design, load_torque)
    plant = loop.place(
        PLANT_NAME["coupled"],
        robot_plant_block,
        robot=robot,
        disturbed=disturbance is not None,
    )
    state = plant.outputs["state"]
    if widen_limits:
        alleviating_torque = loads.outputs["alleviating_torque"]
    else:
        none = loop.place(
            "no_widening", constant_block, signal="alleviating_torque", value=np.zeros(robot.n)
        )
        alleviating_torque = none.outputs["alleviating_torque"]

    tau_cmd, tau = _place_controller(
        loop, design, reference, state, load_torque, alleviating_torque
    )
    loop.connect(tau, plant.inputs["tau"])
    if disturbance is not None:
        loop.connect(disturbance, plant.inputs["disturbance"])

    logs = {"state": state, "tau_cmd": tau_cmd, "tau": tau, "load_torque": load_torque}
    return loop.finish("coupled_loop", logs, design.motion.period)


# --- what they have in common ----------------------------------------------------------------


class _Loop:
    """A loop being built: its blocks, flat or boxed, its wires, and its logs if it is flat."""

    def __init__(self, boxed: bool) -> None:
        self.boxed = boxed
        self._builder = DiagramBuilder()
        self._place_in = place_boxed if boxed else place_flat

    def place(self, name: str, describe: Callable[..., None], **arguments) -> Block:
        return self._place_in(self._builder, name, describe, **arguments)

    def place_open(self, name: str, describe: Callable[..., None], **arguments) -> Block:
        """A block whose inside is to be seen in an export too."""
        return place_flat(self._builder, name, describe, **arguments)

    def connect(self, output: OutputPort, target: InputPort) -> None:
        self._builder.Connect(output, target)

    def finish(self, name: str, logs: dict[str, OutputPort], log_period: float) -> Diagram:
        if not self.boxed:
            add_logs(self._builder, logs, log_period)
        diagram = self._builder.Build()
        diagram.set_name(name)
        return diagram


def _place_reference_and_loads(loop: _Loop, design: Design) -> tuple[OutputPort, Block]:
    """The held reference, and the block of the load torque: a table, or on line."""
    motion = design.motion
    source = loop.place("reference_source", reference_source_block, motion=motion)
    hold = loop.place(
        "zero_order_hold", zero_order_hold_block, size=3 * motion.n, period=motion.period
    )
    loop.connect(source.outputs["reference"], hold.inputs["reference"])
    reference = hold.outputs["reference"]
    if design.scenario.inverse_dynamics == "table":
        loads = loop.place(
            "load_torque_table", load_torque_table_block, motion=motion, loads=design.loads
        )
    else:
        loads = loop.place(
            "load_torque", load_torque_block, robot=design.robot, sign=design.scenario.algorithm
        )
        loop.connect(reference, loads.inputs["reference"])
    return reference, loads


def _place_controller(
    loop: _Loop,
    design: Design,
    reference: OutputPort,
    state: OutputPort,
    load_torque: OutputPort,
    alleviating_torque: OutputPort,
) -> tuple[OutputPort, OutputPort]:
    """PI, feedforward if the controller has one, and saturation: tau_cmd and tau."""
    controller = loop.place(
        "pi_speed_controller",
        pi_speed_controller_block,
        gains=design.gains,
        gear_ratio=design.robot.gear_ratio,
        structure=design.scenario.controller.structure,
        elements=loop.boxed,
    )
    loop.connect(reference, controller.inputs["reference"])
    loop.connect(state, controller.inputs["state"])
    tau_cmd = controller.outputs["tau_fb"]
    if design.scenario.controller.kind == "pi_ctc":
        feedforward = loop.place("ctc_feedforward", ctc_feedforward_block, n=design.robot.n)
        loop.connect(tau_cmd, feedforward.inputs["tau_fb"])
        loop.connect(load_torque, feedforward.inputs["tau_ff"])
        tau_cmd = feedforward.outputs["tau_cmd"]
    saturation = loop.place(
        "dynamic_saturation",
        dynamic_saturation_block,
        motor_torque_limit=design.robot.motor_torque_limit,
    )
    loop.connect(tau_cmd, saturation.inputs["tau_cmd"])
    loop.connect(alleviating_torque, saturation.inputs["alleviating_torque"])
    return tau_cmd, saturation.outputs["tau"]


def _place_disturbance(loop: _Loop, design: Design, load_torque: OutputPort) -> OutputPort | None:
    choice = design.scenario.disturbance
    if choice.amplitude == 0:
        return None
    disturbance = loop.place(
        "disturbance",
        disturbance_block,
        n=design.robot.n,
        amplitude=choice.amplitude,
        omega_d=choice.omega_d,
    )
    loop.connect(load_torque, disturbance.inputs["load_torque"])
    return disturbance.outputs["disturbance"]
