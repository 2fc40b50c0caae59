"""How long the coupled loop steps, as a ratio to a floor of Drake's own blocks, and how well.

    python tests/benchmarks/bench_coupled_loop.py [ROUNDS]

All loops run the reference motion (30 s, logs at 5 ms) with the same integrator. They take turns,
and the ratio is taken round by round, so a machine that drifts does not matter. The floor is what a
Drake user would wire by hand: PI + CTC from integrator, gains and adders, a feedforward tabulated
beforehand, constant limits, nothing in Python. "table" and "online" are PI + CTC with time-varying
limits; the others are the controllers by name, and the last one a drive and friction.

Beside that: evaluations of the derivatives, the time of one, and the largest error of a speed in
the first 12 s against a run with the accuracy 1e-8.
"""

from __future__ import annotations

import sys
import time
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import (
    Adder,
    Demultiplexer,
    Gain,
    Integrator,
    LogVectorOutput,
    Saturation,
    TrajectorySource,
    ZeroOrderHold,
)
from pydrake.trajectories import PiecewisePolynomial
from timing import head, row, spread

from sdt_drake.analysis.comparison import design_with
from sdt_drake.robot.device import Drive
from sdt_drake.run.design import Design, make_design
from sdt_drake.run.loop import Loop, make_loop
from sdt_drake.run.scenario import load_scenario, with_fields
from sdt_drake.run.simulate import make_simulator

Array = NDArray[np.float64]

CONTROLLERS = ("pi", "pi_id", "p_pi", "p_pi+id", "pi_scheduled", "inverse_dynamics")
TARGETS = {"floor": 1.0, "table": 1.1, "online": 1.5, **dict.fromkeys(CONTROLLERS, 1.6)}
TARGETS["1 ms drive, friction"] = 8.0
EXACT = 12.0  # s


def make_floor(design: Design) -> Diagram:
    """PI + CTC on the MultibodyPlant from Drake's primitives alone, constant limits."""
    robot, motion, gains, n = design.robot, design.motion, design.gains, design.robot.n
    builder = DiagramBuilder()
    add = builder.AddNamedSystem

    def held(name, samples):
        table = PiecewisePolynomial.FirstOrderHold(motion.time, samples.T)
        source = add(f"{name}_source", TrajectorySource(table))
        hold = add(name, ZeroOrderHold(motion.period, n))
        builder.Connect(source.get_output_port(), hold.get_input_port())
        return hold.get_output_port()

    def wire(port, *systems_and_port):
        *systems, last = systems_and_port
        for system in systems:
            builder.Connect(port, system.get_input_port())
            port = system.get_output_port()
        builder.Connect(port, last)

    v_ref, tau_ff = held("v_ref", motion.v), held("tau_ff", design.loads.load_torque)
    limit, ratio = robot.motor_torque_limit, robot.gear_ratio
    plant, split = add("plant", robot.make_plant()), add("split", Demultiplexer([n, n]))
    minus_v_motor, kp = add("minus_v_motor", Gain(-ratio)), add("kp", Gain(gains.kp))
    error, integral = add("error", Adder(2, n)), add("integral", Integrator(n))
    tau_fb, tau_cmd = add("tau_fb", Adder(2, n)), add("tau_cmd", Adder(2, n))
    saturation, gears = add("saturation", Saturation(-limit, limit)), add("gears", Gain(ratio))
    wire(plant.get_state_output_port(), split.get_input_port())
    wire(v_ref, add("ref_motor", Gain(ratio)), error.get_input_port(0))
    wire(split.get_output_port(1), minus_v_motor, error.get_input_port(1))
    ki = add("ki", Gain(gains.ki))
    wire(error.get_output_port(), integral, ki, tau_fb.get_input_port(0))
    wire(minus_v_motor.get_output_port(), kp, tau_fb.get_input_port(1))
    wire(tau_fb.get_output_port(), tau_cmd.get_input_port(0))
    wire(tau_ff, tau_cmd.get_input_port(1))
    wire(tau_cmd.get_output_port(), saturation, gears, plant.get_actuation_input_port())
    ports = {
        "state": plant.get_state_output_port(),
        "tau_cmd": tau_cmd.get_output_port(),
        "tau": saturation.get_output_port(),
        "tau_ff": tau_ff,
    }
    for name, port in ports.items():
        LogVectorOutput(port, builder, publish_period=motion.period).set_name(f"log.{name}")
    return builder.Build()


class Run(NamedTuple):
    """CPU time of stepping [s], evaluations of the derivatives, and the speeds, (samples, n)."""

    time: float
    evaluations: int
    speeds: Array


def run(diagram: Diagram, duration: float, period: float, accuracy: float) -> Run:
    """Advance a fresh simulator over `duration` [s]."""
    simulator = make_simulator(diagram, period=period, accuracy=accuracy)
    context = simulator.get_mutable_context()
    if isinstance(diagram, Loop):
        diagram.rest(context)
    simulator.Initialize()
    start = time.process_time()
    simulator.AdvanceTo(duration)
    taken = time.process_time() - start
    states = diagram.GetSubsystemByName("log.state").FindLog(context).data()
    evaluations = simulator.get_integrator().get_num_derivative_evaluations()
    return Run(taken, evaluations, states[len(states) // 2 :].T.copy())


def loops_of_all() -> tuple[Design, dict[str, Diagram]]:
    """The loops by name, and the design of the first one."""
    scenario = load_scenario("coupled_pi_ctc")
    table = make_design(scenario)
    online = make_design(with_fields(scenario, {"inverse_dynamics": "online"}))
    friction = load_scenario("real_device").plant.friction  # of the drive, the sampling alone
    device = {"plant.friction": friction, "drive": Drive(period=0.001)}
    loops = {"floor": make_floor(table)}
    loops |= {"table": make_loop(table, widened=True), "online": make_loop(online, widened=True)}
    loops |= {label: make_loop(design_with(table, label)) for label in CONTROLLERS}
    loops["1 ms drive, friction"] = make_loop(make_design(with_fields(scenario, device)))
    return table, loops


def main(rounds: int) -> None:
    design, loops = loops_of_all()
    motion, accuracy = design.motion, design.scenario.accuracy
    runs = {name: [] for name in loops}
    for _ in range(rounds + 1):
        for name, loop in loops.items():
            runs[name].append(run(loop, motion.duration, motion.period, accuracy))
    times = {name: np.array([r.time for r in runs[name][1:]]) for name in loops}  # one warms up
    print(f"floor: {np.median(times['floor']):.3f} s for {motion.duration:g} s of motion")
    head("loop", "times the floor", "target", "evaluations", "us each", "error [rad/s]")
    for name, target in TARGETS.items():
        last = runs[name][-1]
        each = 1e6 * np.median(times[name]) / last.evaluations
        exact = run(loops[name], EXACT, motion.period, 1e-8).speeds
        error = np.abs(last.speeds[: len(exact)] - exact).max()
        ratio = spread(times[name] / times["floor"])
        row([name, ratio, target, last.evaluations, f"{each:.1f}", f"{error:.1e}"])


if __name__ == "__main__":
    main(int([*sys.argv, 9][1]))
