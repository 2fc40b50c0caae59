"""The three control loops of the paper, as Drake diagrams of the same blocks."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import Diagram, DiagramBuilder, OutputPort, System
from pydrake.systems.primitives import Adder, ConstantVectorSource, Gain

from sdt_drake.control import SpeedGains
from sdt_drake.design import Design
from sdt_drake.errors import checked_number
from sdt_drake.systems import (
    LoadTorque,
    add_logs,
    make_axis_process,
    make_ctc_feedforward,
    make_disturbance,
    make_dynamic_saturation,
    make_load_torque_table,
    make_pi_speed_controller,
    make_reference_source,
    make_zero_order_hold,
)

PLANT = "plant"
"""Name of the system, in every loop, whose continuous state is q and v."""


def make_loop(design: Design, *, log: bool = True) -> Diagram:
    """The loop of the scenario's plant: `make_axis_loop` or `make_coupled_loop`."""
    make = {"axis": make_axis_loop, "coupled": make_coupled_loop}[design.scenario.plant.kind]
    return make(design, log=log)


def make_step_loop(
    *, gains: SpeedGains, i_eff: float, structure: str, step: float = 1.0, log_period: float = 1e-4
) -> Diagram:
    """One linear speed loop without load or limit (Figures 4 and 5): a step of its reference.

    Args:
        gains: of one controller, motor side; arrays of length 1.
        i_eff: inertia, motor side [kg m²].
        structure: "pi" or "p_in_feedback".
        step: motor speed asked for from time 0 on [rad/s].
        log_period: of v_ref and state [s].

    Raises:
        InputError: for values that are not > 0.
    """
    checked_number(log_period, "log_period", minimum=0, exclusive=True)
    builder = DiagramBuilder()
    reference = builder.AddNamedSystem("step_reference", ConstantVectorSource([step]))
    controller = builder.AddSystem(
        make_pi_speed_controller(gains=gains, gear_ratio=[1.0], structure=structure)
    )
    process = builder.AddSystem(make_axis_process(i_eff=[i_eff], gear_ratio=[1.0]))
    no_load = builder.AddNamedSystem("no_load", ConstantVectorSource([0.0]))

    v_ref, state = reference.get_output_port(), process.GetOutputPort("state")
    builder.Connect(v_ref, controller.GetInputPort("v_ref"))
    builder.Connect(state, controller.GetInputPort("state"))
    builder.Connect(controller.GetOutputPort("tau_fb"), process.GetInputPort("tau"))
    builder.Connect(no_load.get_output_port(), process.GetInputPort("load_torque"))
    add_logs(builder, {"v_ref": v_ref, "state": state}, log_period)
    return _named(builder, "step_loop")


def make_axis_loop(design: Design, *, log: bool = True) -> Diagram:
    """The paper's simulation models, all axes in one diagram (Figures 3, 5 and 6).

    Each motor turns its own constant inertia against the load torque of the reference, with its
    limits widened by the alleviating torque. With "pi_ctc" the load torque is fed forward, and the
    disturbance makes the true load differ from it.
    """
    builder = DiagramBuilder()
    source, held, loads = _add_reference_and_loads(builder, design)
    controller = _add_controller(builder, design)
    saturation = builder.AddSystem(make_dynamic_saturation(design.robot.motor_torque_limit))
    process = builder.AddNamedSystem(
        PLANT, make_axis_process(i_eff=design.i_eff, gear_ratio=design.robot.gear_ratio)
    )
    state, tau = process.GetOutputPort("state"), saturation.GetOutputPort("tau")
    load_torque = loads.GetOutputPort("load_torque")

    builder.Connect(held.GetOutputPort("v_ref"), controller.GetInputPort("v_ref"))
    builder.Connect(state, controller.GetInputPort("state"))
    tau_cmd = _add_feedforward(builder, design, controller.GetOutputPort("tau_fb"), load_torque)
    builder.Connect(tau_cmd, saturation.GetInputPort("tau_cmd"))
    builder.Connect(
        loads.GetOutputPort("alleviating_torque"), saturation.GetInputPort("alleviating_torque")
    )
    builder.Connect(tau, process.GetInputPort("tau"))
    true_load = load_torque
    disturbance = _add_disturbance(builder, design, load_torque)
    if disturbance is not None:
        total = builder.AddNamedSystem("true_load_torque", Adder(2, design.robot.n))
        builder.Connect(load_torque, total.get_input_port(0))
        builder.Connect(disturbance, total.get_input_port(1))
        true_load = total.get_output_port()
    builder.Connect(true_load, process.GetInputPort("load_torque"))

    if log:
        _add_logs(builder, design, source, state, tau_cmd, tau, load_torque)
    return _named(builder, "axis_loop")


def make_coupled_loop(design: Design, *, log: bool = True, widen_limits: bool = False) -> Diagram:
    """The MultibodyPlant under the same controllers: all joints at once, coupled by their dynamics.

    The coupling torques act physically, so the motors' limits are not widened and nothing loads
    the motors but the plant; the disturbance acts as a generalised force.

    Args:
        design: a resolved scenario.
        log: record the signals at the interpolation period.
        widen_limits: widen the limits by the alleviating torque all the same, as in the axis loop.
    """
    builder = DiagramBuilder()
    source, held, loads = _add_reference_and_loads(builder, design)
    controller = _add_controller(builder, design)
    saturation = builder.AddSystem(make_dynamic_saturation(design.robot.motor_torque_limit))
    gears = builder.AddNamedSystem("gears", Gain(design.robot.gear_ratio))
    plant = builder.AddNamedSystem(PLANT, design.robot.make_plant())
    state, tau = plant.get_state_output_port(), saturation.GetOutputPort("tau")
    load_torque = loads.GetOutputPort("load_torque")

    builder.Connect(held.GetOutputPort("v_ref"), controller.GetInputPort("v_ref"))
    builder.Connect(state, controller.GetInputPort("state"))
    tau_cmd = _add_feedforward(builder, design, controller.GetOutputPort("tau_fb"), load_torque)
    builder.Connect(tau_cmd, saturation.GetInputPort("tau_cmd"))
    if widen_limits:
        help_ = loads.GetOutputPort("alleviating_torque")
    else:
        help_ = builder.AddNamedSystem(
            "limits_not_widened", ConstantVectorSource(np.zeros(design.robot.n))
        ).get_output_port()
    builder.Connect(help_, saturation.GetInputPort("alleviating_torque"))
    builder.Connect(tau, gears.get_input_port())
    builder.Connect(gears.get_output_port(), plant.get_actuation_input_port())
    disturbance = _add_disturbance(builder, design, load_torque)
    if disturbance is not None:
        load_side = builder.AddNamedSystem("load_side", Gain(-design.robot.gear_ratio))
        builder.Connect(disturbance, load_side.get_input_port())
        builder.Connect(
            load_side.get_output_port(), plant.get_applied_generalized_force_input_port()
        )

    if log:
        _add_logs(builder, design, source, state, tau_cmd, tau, load_torque)
    return _named(builder, "coupled_loop")


# --- what both have in common ----------------------------------------------------------------


def _add_reference_and_loads(
    builder: DiagramBuilder, design: Design
) -> tuple[System, System, System]:
    """Reference source, hold, and load torque by table or on line."""
    motion = design.motion
    signals = ("q_ref", "v_ref", "vd_ref")
    source = builder.AddSystem(make_reference_source(motion))
    hold = builder.AddSystem(
        make_zero_order_hold(motion.period, dict.fromkeys(signals, motion.n))
    )
    for name in signals:
        builder.Connect(source.GetOutputPort(name), hold.GetInputPort(name))
    if design.scenario.inverse_dynamics == "table":
        return source, hold, builder.AddSystem(make_load_torque_table(motion, design.loads))
    loads = builder.AddNamedSystem(
        "load_torque", LoadTorque(robot=design.robot, sign=design.scenario.algorithm)
    )
    for name in signals:
        builder.Connect(hold.GetOutputPort(name), loads.GetInputPort(name))
    return source, hold, loads


def _add_controller(builder: DiagramBuilder, design: Design) -> System:
    return builder.AddSystem(
        make_pi_speed_controller(
            gains=design.gains,
            gear_ratio=design.robot.gear_ratio,
            structure=design.scenario.controller.structure,
        )
    )


def _add_feedforward(
    builder: DiagramBuilder, design: Design, tau_fb: OutputPort, load_torque: OutputPort
) -> OutputPort:
    """The commanded torque: the feedback, with the load torque added if the controller has CTC."""
    if design.scenario.controller.kind == "pi":
        return tau_fb
    feedforward = builder.AddSystem(make_ctc_feedforward(design.robot.n))
    builder.Connect(tau_fb, feedforward.GetInputPort("tau_fb"))
    builder.Connect(load_torque, feedforward.GetInputPort("tau_ff"))
    return feedforward.GetOutputPort("tau_cmd")


def _add_disturbance(
    builder: DiagramBuilder, design: Design, load_torque: OutputPort
) -> OutputPort | None:
    choice = design.scenario.disturbance
    if choice.amplitude == 0:
        return None
    disturbance = builder.AddSystem(
        make_disturbance(
            n=design.robot.n, amplitude=choice.amplitude, omega_d=choice.omega_d
        )
    )
    builder.Connect(load_torque, disturbance.GetInputPort("load_torque"))
    return disturbance.GetOutputPort("disturbance")


def _add_logs(
    builder: DiagramBuilder,
    design: Design,
    source: System,
    state: OutputPort,
    tau_cmd: OutputPort,
    tau: OutputPort,
    load_torque: OutputPort,
) -> None:
    # The reference is logged before its hold: there it is continuous, so that its value at an
    # instant does not depend on the side from which a log looks.
    signals = {name: source.GetOutputPort(name) for name in ("q_ref", "v_ref")}
    signals |= {"state": state, "tau_cmd": tau_cmd, "tau": tau, "load_torque": load_torque}
    add_logs(builder, signals, design.motion.period)


def _named(builder: DiagramBuilder, name: str) -> Diagram:
    diagram = builder.Build()
    diagram.set_name(name)
    return diagram
