"""How long the coupled loop steps, as a ratio to a floor of Drake's own blocks, and how well.

    python tests/benchmarks/bench_coupled_loop.py [--rounds N] [--exact SECONDS]

All loops run the reference motion (30 s, logs at 5 ms) with the same integrator. They take turns,
and the ratio is taken round by round, so a machine that drifts does not matter. The floor is what a
Drake user would wire by hand: PI + CTC from integrator, gains and adders, a feedforward tabulated
beforehand, constant limits, nothing in Python. "table" and "online" are PI + CTC with time-varying
limits; the others are the controllers by name, and the last one a drive and friction.

Beside that: evaluations of the derivatives, the time of one, and the largest error of a speed in
the first seconds (--exact, 0 to leave it out) against a run with the accuracy 1e-8.
"""

from __future__ import annotations

import argparse
import copy
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

from sdt_drake.analysis.comparison import design_with
from sdt_drake.robot.device import Drive
from sdt_drake.run.design import Design, make_design
from sdt_drake.run.loop import Loop, make_loop
from sdt_drake.run.scenario import Scenario, load_scenario
from sdt_drake.run.simulate import make_simulator

Array = NDArray[np.float64]

TARGETS = {"table": 1.1, "online": 1.5}
CONTROLLERS = dict.fromkeys(
    ("pi", "pi_id", "p_pi", "p_pi+id", "pi_scheduled", "inverse_dynamics"), 1.6
)
REAL_DEVICE = {"1 ms drive, friction": 8.0}


def make_floor(design: Design) -> Diagram:
    """PI + CTC on the MultibodyPlant from Drake's primitives alone, constant limits."""
    robot, motion, gains, n = design.robot, design.motion, design.gains, design.robot.n
    builder = DiagramBuilder()
    add, connect = builder.AddNamedSystem, builder.Connect

    def held(name, samples):
        table = PiecewisePolynomial.FirstOrderHold(motion.time, samples.T)
        source = add(f"{name}_source", TrajectorySource(table))
        hold = add(name, ZeroOrderHold(motion.period, n))
        connect(source.get_output_port(), hold.get_input_port())
        return hold.get_output_port()

    v_ref = held("v_ref", motion.v)
    tau_ff = held("tau_ff", design.loads.load_torque)
    plant = add("plant", robot.make_plant())
    split = add("split", Demultiplexer([n, n]))
    connect(plant.get_state_output_port(), split.get_input_port())
    v = split.get_output_port(1)

    ref_motor = add("ref_motor", Gain(robot.gear_ratio))
    minus_v_motor = add("minus_v_motor", Gain(-robot.gear_ratio))
    error = add("error", Adder(2, n))
    integral = add("integral", Integrator(n))
    ki, kp = add("ki", Gain(gains.ki)), add("kp", Gain(gains.kp))
    tau_fb, tau_cmd = add("tau_fb", Adder(2, n)), add("tau_cmd", Adder(2, n))
    limit = robot.motor_torque_limit
    saturation = add("saturation", Saturation(-limit, limit))
    gears = add("gears", Gain(robot.gear_ratio))
    connect(v_ref, ref_motor.get_input_port())
    connect(v, minus_v_motor.get_input_port())
    connect(ref_motor.get_output_port(), error.get_input_port(0))
    connect(minus_v_motor.get_output_port(), error.get_input_port(1))
    connect(error.get_output_port(), integral.get_input_port())
    connect(integral.get_output_port(), ki.get_input_port())
    connect(minus_v_motor.get_output_port(), kp.get_input_port())
    connect(ki.get_output_port(), tau_fb.get_input_port(0))
    connect(kp.get_output_port(), tau_fb.get_input_port(1))
    connect(tau_fb.get_output_port(), tau_cmd.get_input_port(0))
    connect(tau_ff, tau_cmd.get_input_port(1))
    connect(tau_cmd.get_output_port(), saturation.get_input_port())
    connect(saturation.get_output_port(), gears.get_input_port())
    connect(gears.get_output_port(), plant.get_actuation_input_port())

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


def _real_device() -> Scenario:
    """PI + CTC with the shipped friction, and a drive of which only the sampling counts."""
    scenario = load_scenario("package://sdt/scenarios/coupled_pi_ctc.yaml")
    scenario.plant.friction = load_scenario(
        "package://sdt/scenarios/real_device.yaml"
    ).plant.friction
    scenario.drive = Drive(period=0.001)
    return scenario


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--exact", type=float, default=12.0)
    options = parser.parse_args()

    scenario = load_scenario("package://sdt/scenarios/coupled_pi_ctc.yaml")
    designs = {}
    for mode in TARGETS:
        scenario = copy.deepcopy(scenario)
        scenario.inverse_dynamics = mode
        designs[mode] = make_design(scenario)
    motion = designs["table"].motion
    loops = {"floor": make_floor(designs["table"])}
    for mode, design in designs.items():
        loops[mode] = make_loop(design, widened=True)

    for label in CONTROLLERS:
        loops[label] = make_loop(design_with(designs["table"], label))
    loops["1 ms drive, friction"] = make_loop(make_design(_real_device()))

    period, accuracy = motion.period, scenario.accuracy
    runs = {name: [] for name in loops}
    for _ in range(options.rounds + 1):
        for name, loop in loops.items():
            runs[name].append(run(loop, motion.duration, period, accuracy))
    times = {name: np.array([r.time for r in runs[name][1:]]) for name in loops}  # one warms up
    targets = {"floor": 1.0, **TARGETS, **CONTROLLERS, **REAL_DEVICE}
    print(f"floor: {np.median(times['floor']):.3f} s for {motion.duration:g} s of motion")
    print(f"{'':20s} {'times the floor':>22s} target evaluations us each error [rad/s]")
    for name, target in targets.items():
        ratio, last = times[name] / times["floor"], runs[name][-1]
        spread = f"{np.median(ratio):.3f} ({ratio.min():.3f} to {ratio.max():.3f})"
        each = 1e6 * np.median(times[name]) / last.evaluations
        error = "-"
        if options.exact:
            exact = run(loops[name], options.exact, period, 1e-8).speeds
            error = f"{np.abs(last.speeds[: len(exact)] - exact).max():.1e}"
        print(
            f"{name:20s} {spread:>22s} {target:6g} {last.evaluations:11d} {each:7.1f} {error:>13s}"
        )


if __name__ == "__main__":
    main()
