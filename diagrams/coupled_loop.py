"""Computed torque control of the whole device: a MultibodyPlant in place of the paper's axes.

    python diagrams/coupled_loop.py [FOLDER]

Reference, controller, feedforward and disturbance are those of Figure 6. The joints are coupled in
the plant, so the loop adds no load torque, and widens no limits.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Adder, Saturation, VectorLogSink, ZeroOrderHold

from sdt_drake import load_robot, plan, systems
from sdt_drake.robot.dynamics import effective_inertia, torque_groups
from sdt_drake.run.simulate import make_simulator
from sdt_drake.show.block_diagrams import write_diagram
from sdt_drake.systems.wiring import set_state

A, OMEGA_D = 0.05, 2 * np.pi  # disturbance [-], [rad/s]; the paper gives no omega_D
OMEGA_R, ZETA = 65.991, [0.95, 0.98, 0.99, 0.95]  # of the structure [rad/s]; Table 1 [-]


def main(folder):
    """Simulate the loop, write figure and diagram, and return figure and errors (N + 1, n)."""
    robot, motion = load_robot(), plan("reference").motion
    n, r, tau_max = robot.n, robot.gear_ratio, robot.motor_torque_limit
    i_eff = effective_inertia(robot, torque_groups(robot, motion.q, motion.v, motion.vd).d_kk)
    gains = systems.gains.tune(i_eff.max(axis=0), OMEGA_R, ZETA)  # Section 3.3
    builder = DiagramBuilder()
    add, connect = builder.AddNamedSystem, builder.Connect
    planner = add("reference_source", systems.reference_source(motion=motion))
    hold = add("zero_order_hold", ZeroOrderHold(motion.period, 3 * n))
    links = add("load_torque", systems.LoadTorque(robot=robot, algorithm="consistent"))
    pi = add("pi_speed_controller", systems.pi_speed_controller(gains=gains, gear_ratio=r))
    tau_cmd = add("tau_cmd", Adder(2, n))
    limits = add("saturation", Saturation(-tau_max, tau_max))
    sine = add("disturbance", systems.disturbance(n=n, amplitude=A, omega_d=OMEGA_D))
    device = add("device", systems.robot_plant(robot=robot))
    log = add("log", VectorLogSink(2 * n, motion.period))

    connect(planner.GetOutputPort("reference"), hold.get_input_port())
    connect(hold.get_output_port(), links.GetInputPort("reference"))
    connect(hold.get_output_port(), pi.GetInputPort("reference"))
    connect(device.GetOutputPort("state"), pi.GetInputPort("measured"))
    connect(pi.GetOutputPort("tau_fb"), tau_cmd.get_input_port(0))
    connect(links.GetOutputPort("load_torque"), tau_cmd.get_input_port(1))
    connect(tau_cmd.get_output_port(), limits.get_input_port())
    connect(limits.get_output_port(), device.GetInputPort("tau"))
    connect(links.GetOutputPort("load_torque"), sine.GetInputPort("load_torque"))
    connect(sine.GetOutputPort("disturbance"), device.GetInputPort("load_torque"))
    connect(device.GetOutputPort("state"), log.get_input_port())
    diagram = builder.Build()

    simulator = make_simulator(diagram, period=motion.period, accuracy=1e-4)
    context = simulator.get_mutable_context()
    q, v = motion.q[0], motion.v[0]  # in steady motion the integral gives what tau_ff lacks
    set_state(diagram, context, "zero_order_hold", np.hstack([q, v, 0 * v]))
    tau_ff = links.GetOutputPort("load_torque").Eval(links.GetMyContextFromRoot(context))
    integral = torque_groups(robot, q, v, 0 * v).total / r - tau_ff + gains.kp * r * v
    set_state(diagram, context, "pi_speed_controller/integral", integral / gains.ki)
    set_state(diagram, context, "device/multibody_plant", np.hstack([q, v]))
    simulator.AdvanceTo(motion.duration)

    error = log.FindLog(context).data()[n:].T - motion.v
    print("largest speed error of joints 1 to 4 [rad/s]:", *abs(error).max(axis=0).round(4))
    write_diagram(diagram, folder / "coupled_loop_drake.dot", max_depth=1, drake=True)
    figure = Figure(figsize=(7, 7), layout="constrained")
    for k, ax in enumerate(figure.subplots(n, sharex=True)):
        ax.plot(motion.time, error[:, k])
        ax.set(title=f"joint {k + 1}", xlabel="time [s]", ylabel="speed error [rad/s]")
    figure.savefig(folder / "coupled_loop.png")
    return figure, error


if __name__ == "__main__":
    main(Path(*sys.argv[1:]))
