"""Computed torque control of the four axes: the paper's Simulink models with CTC (Figure 6).

    python diagrams/figure6_axis_ctc.py [FOLDER]

The load torque of the reference is fed forward; the true load differs from it by a sine of 5 %.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Adder, VectorLogSink, ZeroOrderHold

from sdt_drake import load_robot, plan, systems
from sdt_drake.run.simulate import make_simulator
from sdt_drake.show.block_diagrams import write_diagram
from sdt_drake.systems.wiring import set_state

A, OMEGA_D = 0.05, 2 * np.pi  # disturbance [-], [rad/s]; the paper gives no omega_D
I_EFF = [4.26, 98.01, 796.3, 250.28]  # Table 1, motor side [kg m²]
K_PS = np.array([267.1, 6.34e3, 5.2e4, 1.57e4])  # Table 1, motor side [N m s/rad]
K_IS = np.array([4.64e3, 1.07e5, 8.67e5, 2.73e5])  # Table 1, motor side [N m/rad]


def main(folder):
    """Simulate the loop, write figure and diagram, and return figure and errors (N + 1, n)."""
    robot, motion = load_robot(), plan("reference").motion
    n, r, tau_max = robot.n, robot.gear_ratio, robot.motor_torque_limit
    gains = systems.gains.SpeedGains(kp=K_PS, ki=K_IS)
    builder = DiagramBuilder()
    add, connect = builder.AddNamedSystem, builder.Connect
    planner = add("reference_source", systems.reference_source(motion=motion))
    hold = add("zero_order_hold", ZeroOrderHold(motion.period, 3 * n))
    links = add("load_torque", systems.LoadTorque(robot=robot, algorithm="printed"))
    pi = add("pi_speed_controller", systems.pi_speed_controller(gains=gains, gear_ratio=r))
    tau_cmd = add("tau_cmd", Adder(2, n))
    limits = add("dynamic_saturation", systems.dynamic_saturation(motor_torque_limit=tau_max))
    sine = add("disturbance", systems.disturbance(n=n, amplitude=A, omega_d=OMEGA_D))
    true_load = add("true_load", Adder(2, n))
    axes = add("axis_process", systems.axis_process(i_eff=I_EFF, gear_ratio=r))
    log = add("log", VectorLogSink(2 * n, motion.period))

    connect(planner.GetOutputPort("reference"), hold.get_input_port())
    connect(hold.get_output_port(), links.GetInputPort("reference"))
    connect(hold.get_output_port(), pi.GetInputPort("reference"))
    connect(axes.GetOutputPort("state"), pi.GetInputPort("measured"))
    connect(pi.GetOutputPort("tau_fb"), tau_cmd.get_input_port(0))
    connect(links.GetOutputPort("load_torque"), tau_cmd.get_input_port(1))
    connect(tau_cmd.get_output_port(), limits.GetInputPort("tau_cmd"))
    connect(links.GetOutputPort("alleviating_torque"), limits.GetInputPort("alleviating_torque"))
    connect(limits.GetOutputPort("tau_limited"), axes.GetInputPort("tau"))
    connect(links.GetOutputPort("load_torque"), sine.GetInputPort("load_torque"))
    connect(links.GetOutputPort("load_torque"), true_load.get_input_port(0))
    connect(sine.GetOutputPort("disturbance"), true_load.get_input_port(1))
    connect(true_load.get_output_port(), axes.GetInputPort("load_torque"))
    connect(axes.GetOutputPort("state"), log.get_input_port())
    diagram = builder.Build()

    simulator = make_simulator(diagram, period=motion.period, accuracy=5e-6)
    context = simulator.get_mutable_context()
    q, v = motion.q[0], motion.v[0]  # in steady motion the feedforward carries the load
    set_state(diagram, context, "pi_speed_controller/integral", K_PS / K_IS * r * v)
    set_state(diagram, context, "axis_process/motors", np.hstack([q, v]))
    simulator.AdvanceTo(motion.duration)

    error = log.FindLog(context).data()[n:].T - motion.v
    print("largest speed error of joints 1 to 4 [rad/s]:", *abs(error).max(axis=0).round(4))
    write_diagram(diagram, folder / "figure6_axis_ctc_drake.dot", max_depth=1, drake=True)
    figure = Figure(figsize=(7, 7), layout="constrained")
    for k, ax in enumerate(figure.subplots(n, sharex=True)):
        ax.plot(motion.time, error[:, k])
        ax.set(title=f"joint {k + 1}", xlabel="time [s]", ylabel="speed error [rad/s]")
    figure.savefig(folder / "figure6_axis_ctc.png")
    return figure, error


if __name__ == "__main__":
    main(Path(*sys.argv[1:]))
