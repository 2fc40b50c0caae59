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

import sys
import time

import numpy as np
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
from sdt_drake.run.scenario import load_scenario
from sdt_drake.run.simulate import make_simulator

CONTROLLERS = ("pi", "pi_id", "p_pi", "p_pi+id", "pi_scheduled", "inverse_dynamics")
TARGETS = {"floor": 1.0, "table": 1.1, "online": 1.5, **dict.fromkeys(CONTROLLERS, 1.6)}
TARGETS["1 ms drive, friction"] = 8.0
EXACT = 12.0  # s


def make_floor(design: Design) -> Diagram:
    """PI + CTC on the MultibodyPlant from Drake's primitives alone, constant limits."""
    robot, motion, gains, n = (
        design.device.simulated,
        design.reference.tracked,
        design.tuning.gains,
        design.device.simulated.n,
    )
    limit, ratio = robot.motor_torque_limit, robot.gear_ratio
    builder = DiagramBuilder()

    def of(system, *ports):
        """Add a system, wire its inputs, and return its last output."""
        builder.AddSystem(system)
        for k, port in enumerate(ports):
            builder.Connect(port, system.get_input_port(k))
        return system.get_output_port(system.num_output_ports() - 1)

    def held(samples):
        table = PiecewisePolynomial.FirstOrderHold(motion.time, samples.T)
        return of(ZeroOrderHold(motion.period, n), of(TrajectorySource(table)))

    plant = builder.AddSystem(robot.make_plant())
    state, tau_ff = plant.get_state_output_port(), held(design.loads.load_torque)
    minus_v = of(Gain(-ratio), of(Demultiplexer([n, n]), state))
    error = of(Adder(2, n), of(Gain(ratio), held(motion.v)), minus_v)
    integral = of(Gain(gains.ki), of(Integrator(n), error))
    tau_cmd = of(Adder(3, n), integral, of(Gain(gains.kp), minus_v), tau_ff)
    tau = of(Saturation(-limit, limit), tau_cmd)
    builder.Connect(of(Gain(ratio), tau), plant.get_actuation_input_port())
    for name, port in {"state": state, "tau_cmd": tau_cmd, "tau": tau, "tau_ff": tau_ff}.items():
        LogVectorOutput(port, builder, publish_period=motion.period).set_name(f"log.{name}")
    return builder.Build()


def run(loop: Loop | Diagram, duration: float, period: float, accuracy: float):
    """Return the CPU time of stepping [s], evaluations of the derivatives, and speeds."""
    diagram = loop.diagram if isinstance(loop, Loop) else loop
    simulator = make_simulator(diagram, period=period, accuracy=accuracy)
    context = simulator.get_mutable_context()
    if isinstance(loop, Loop):
        loop.set_steady_state(context)
    simulator.Initialize()
    start = time.process_time()
    simulator.AdvanceTo(duration)
    taken = time.process_time() - start
    states = diagram.GetSubsystemByName("log.state").FindLog(context).data()
    evaluations = simulator.get_integrator().get_num_derivative_evaluations()
    return taken, evaluations, states[len(states) // 2 :].T.copy()


def loops_of_all() -> tuple[Design, dict[str, Loop | Diagram]]:
    """The loops by name, and the design of the first one."""
    scenario = load_scenario("coupled_pi_ctc")
    table = make_design(scenario)
    online = make_design(scenario.changed({"inverse_dynamics": "online"}))
    friction = load_scenario("real_device").plant.friction  # of the drive, the sampling alone
    device = {"plant.friction": friction, "drive": Drive(period=0.001)}
    loops = {"floor": make_floor(table)}
    widened = {"table": table.assuming(widened=True), "online": online.assuming(widened=True)}
    loops |= {name: make_loop(design) for name, design in widened.items()}
    loops |= {label: make_loop(design_with(table, label)) for label in CONTROLLERS}
    loops["1 ms drive, friction"] = make_loop(make_design(scenario.changed(device)))
    return table, loops


def main(rounds: int = 9) -> dict[str, float]:
    """Print the table, and return the times as ratios to the floor."""
    design, loops = loops_of_all()
    motion, accuracy = design.reference.tracked, design.scenario.accuracy
    times, last = {name: [] for name in loops}, {}
    for _ in range(rounds + 1):
        for name, loop in loops.items():
            last[name] = run(loop, motion.duration, motion.period, accuracy)
            times[name].append(last[name][0])
    times = {name: np.array(values[1:]) for name, values in times.items()}  # one warms up
    print(f"floor: {np.median(times['floor']):.3f} s for {motion.duration:g} s of motion")
    head("loop", "times the floor", "target", "evaluations", "us each", "error [rad/s]")
    ratios = {name: values / times["floor"] for name, values in times.items()}
    for name, target in TARGETS.items():
        _, evaluations, speeds = last[name]
        each = 1e6 * np.median(times[name]) / evaluations
        _, _, exact = run(loops[name], EXACT, motion.period, 1e-8)
        error = np.abs(speeds[: len(exact)] - exact).max()
        row([name, spread(ratios[name]), target, evaluations, f"{each:.1f}", f"{error:.1e}"])
    return {name: float(np.median(ratios[name])) for name in ratios if name != "floor"}


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
