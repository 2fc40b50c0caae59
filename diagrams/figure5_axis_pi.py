"""PI speed control of the four axes: the paper's Simulink models with feedback alone (Figure 5).

    python diagrams/figure5_axis_pi.py [FOLDER]

Each axis is a motor that turns a constant inertia. The other links act on it by the load torque of
Algorithm 1, and widen its limit by the alleviating torque (Figure 3).
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import VectorLogSink, ZeroOrderHold

from sdt_drake import load_robot, plan, systems
from sdt_drake.run.simulate import make_simulator
from sdt_drake.show.block_diagrams import write_diagram
from sdt_drake.systems.wiring import set_state

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
    limits = add("dynamic_saturation", systems.dynamic_saturation(motor_torque_limit=tau_max))
    axes = add("axis_process", systems.axis_process(i_eff=I_EFF, gear_ratio=r))
    log = add("log", VectorLogSink(2 * n, motion.period))

    connect(planner.GetOutputPort("reference"), hold.get_input_port())
    connect(hold.get_output_port(), links.GetInputPort("reference"))
    connect(hold.get_output_port(), pi.GetInputPort("reference"))
    connect(axes.GetOutputPort("state"), pi.GetInputPort("measured"))
    connect(pi.GetOutputPort("tau_fb"), limits.GetInputPort("tau_cmd"))
    connect(links.GetOutputPort("alleviating_torque"), limits.GetInputPort("alleviating_torque"))
    connect(limits.GetOutputPort("tau_limited"), axes.GetInputPort("tau"))
    connect(links.GetOutputPort("load_torque"), axes.GetInputPort("load_torque"))
    connect(axes.GetOutputPort("state"), log.get_input_port())
    diagram = builder.Build()

    simulator = make_simulator(diagram, period=motion.period, accuracy=5e-6)
    context = simulator.get_mutable_context()
    q, v = motion.q[0], motion.v[0]  # in steady motion the integral carries the load
    set_state(diagram, context, "zero_order_hold", np.hstack([q, v, 0 * v]))
    load = links.GetOutputPort("load_torque").Eval(links.GetMyContextFromRoot(context))
    set_state(diagram, context, "pi_speed_controller/integral", (load + K_PS * r * v) / K_IS)
    set_state(diagram, context, "axis_process/motors", np.hstack([q, v]))
    simulator.AdvanceTo(motion.duration)

    error = log.FindLog(context).data()[n:].T - motion.v
    print("largest speed error of joints 1 to 4 [rad/s]:", *abs(error).max(axis=0).round(4))
    write_diagram(diagram, folder / "figure5_axis_pi_drake.dot", max_depth=1, drake=True)
    figure = Figure(figsize=(7, 7), layout="constrained")
    for k, ax in enumerate(figure.subplots(n, sharex=True)):
        ax.plot(motion.time, error[:, k])
        ax.set(title=f"joint {k + 1}", xlabel="time [s]", ylabel="speed error [rad/s]")
    figure.savefig(folder / "figure5_axis_pi.png")
    return figure, error


if __name__ == "__main__":
    main(Path(*sys.argv[1:]))
