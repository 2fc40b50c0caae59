"""Step responses of a speed loop with both structures of the PI controller (Figures 4 and 5).

    python diagrams/figure4_step_response.py [FOLDER]

The motor turns the largest inertia of axis 1. Its speed is not limited, and nothing loads it.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, VectorLogSink

from sdt_drake import systems
from sdt_drake.analysis.step import step_metrics
from sdt_drake.run.simulate import make_simulator
from sdt_drake.show.block_diagrams import write_diagram

I_EFF_1, OMEGA_R = 4.26, 65.991  # Table 1, motor side [kg m²]; of the structure [rad/s]
ZETA = {"pi": 1.0, "p_in_feedback": 0.95}  # by structure (Section 3.3)
PUBLISHED = {"pi": "0.022 s, 0.16 s, 13.53 %", "p_in_feedback": "0.094 s, 0.159 s, 0 %"}


def simulate(gains, i_eff, v_ref=1.0, load_torque=0.0):
    """Simulate n motors, at rest until their speed reference and load step at time 0.

    Args:
        gains: gains of the motors by structure.
        i_eff: inertia of the motors [kg m²], shape (n,).
        v_ref: speed after the step [rad/s].
        load_torque: load after the step [N m].

    Returns:
        The diagram, the time [s], (N,), and speeds of the motors by structure [rad/s], (N, n).
    """
    n, r = len(i_eff), np.ones(len(i_eff))  # all on the motors' side
    builder, logs = DiagramBuilder(), {}
    add, connect = builder.AddNamedSystem, builder.Connect
    reference = add("reference", ConstantVectorSource(np.hstack([0 * r, v_ref * r, 0 * r])))
    load = add("load_torque", ConstantVectorSource(load_torque * r))
    for name, own in gains.items():
        b = {"pi": 1.0, "p_in_feedback": 0.0}[name]  # weight of the set point, by structure
        controller = systems.pi_speed_controller(gains=own, gear_ratio=r, setpoint_weight=b)
        pi = add(f"{name}.controller", controller)
        motors = add(f"{name}.motors", systems.axis_process(i_eff=i_eff, gear_ratio=r))
        logs[name] = add(f"{name}.log", VectorLogSink(2 * n, 1e-4))
        connect(reference.get_output_port(), pi.GetInputPort("reference"))
        connect(motors.GetOutputPort("state"), pi.GetInputPort("measured"))
        connect(pi.GetOutputPort("tau_fb"), motors.GetInputPort("tau"))
        connect(load.get_output_port(), motors.GetInputPort("load_torque"))
        connect(motors.GetOutputPort("state"), logs[name].get_input_port())
    diagram = builder.Build()
    simulator = make_simulator(diagram, period=1e-4, accuracy=1e-9)
    simulator.AdvanceTo(0.6)
    found = {name: log.FindLog(simulator.get_context()) for name, log in logs.items()}
    return diagram, found["pi"].sample_times(), {x: log.data()[n:].T for x, log in found.items()}


def main(folder):
    """Simulate both structures, write figure and diagram, and return figure and speeds."""
    gains = {name: systems.gains.tune([I_EFF_1], OMEGA_R, zeta) for name, zeta in ZETA.items()}
    diagram, t, speeds = simulate(gains, [I_EFF_1])
    write_diagram(diagram, folder / "figure4_step_response_drake.dot", max_depth=1, drake=True)
    figure = Figure(figsize=(7, 4), layout="constrained")
    ax = figure.subplots()
    for name, v in speeds.items():
        m = step_metrics(t, v[:, 0], y0=0, y_final=1)
        found = f"{m.rise_time:.4f} s, {m.settling_time:.4f} s, {m.overshoot_percent:.3f} %"
        print(f"{name}: rise, settling, overshoot {found}; published {PUBLISHED[name]}")
        ax.plot(t, v, label=f"{name}, ζ = {ZETA[name]}")
    ax.set(xlabel="time [s]", ylabel="motor speed [rad/s]", xlim=(0, 0.3))
    ax.legend()
    figure.savefig(folder / "figure4_step_response.png")
    return figure, speeds


if __name__ == "__main__":
    main(Path(*sys.argv[1:]))
