"""How much faster the axis engine runs a variant than the Drake axis loop, as a ratio.

    python tests/benchmarks/bench_axis_engine.py [--variants V] [--runs N] [--drawn SEED]

Variants of the shipped axis run (30 s of motion): inertia, gains, disturbance and motor torque
differ, so that some saturate. The first N of them run in Drake too, one by one, half of them before
and half after the engine; what is timed is the loop alone, built and run, not planning and tuning.
"""

from __future__ import annotations

import argparse
import copy
import dataclasses
import resource
import time

import numpy as np

from sdt_drake.design import Design, make_design
from sdt_drake.scenario import load_scenario
from sdt_drake.simulate import simulate
from sdt_drake.studies.axis_engine import simulate_axes, variants_of

TARGET = 60.0
SCENARIO = "package://sdt/scenarios/axis_pi_ctc.yaml"


def draw_designs(count: int, seed: int) -> list[Design]:
    """Designs that share robot file, motion and torques."""
    base = make_design(load_scenario(SCENARIO))
    random = np.random.default_rng(seed)
    n, designs = base.robot.n, []
    for _ in range(count):
        scenario = copy.deepcopy(base.scenario)
        scenario.plant.i_eff = list(base.i_eff * random.uniform(0.6, 1.5, n))
        scenario.controller.kind = str(random.choice(["pi", "pi_ctc", "pi_id"]))
        scenario.controller.kp = list(base.gains.kp * random.uniform(0.7, 1.5, n))
        scenario.controller.ki = list(base.gains.ki * random.uniform(0.7, 1.5, n))
        scenario.disturbance.amplitude = random.uniform(0, 0.3)
        scenario.disturbance.omega_d = random.uniform(1, 30)
        limit = base.robot.effort_limit * random.uniform(0.8, 1.2)
        robot = dataclasses.replace(base.robot, effort_limit=limit)
        designs.append(make_design(scenario, robot=robot, motion=base.motion, torques=base.torques))
    return designs


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--variants", type=int, default=1000)
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--drawn", type=int, default=0, metavar="SEED")
    options = parser.parse_args()
    designs = draw_designs(options.variants, options.drawn)
    variants = variants_of(designs)

    def drake(some: list[Design]) -> float:
        start = time.perf_counter()
        for design in some:
            simulate(design)
        return time.perf_counter() - start

    some, half = designs[: options.runs], options.runs // 2
    in_drake = drake(some[:half])
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start = time.perf_counter()
    outcomes = simulate_axes(variants)
    in_engine = time.perf_counter() - start
    after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    in_drake += drake(some[half:])

    per_run, per_variant = in_drake / len(some), in_engine / len(designs)
    saturates = np.mean(outcomes.saturated_fraction.max(axis=1) > 0)
    print(f"{len(designs)} variants, {100 * saturates:.0f} % of them saturate somewhere")
    print(f"Drake   {1e3 * per_run:8.2f} ms per variant ({len(some)} runs)")
    print(f"engine  {1e3 * per_variant:8.2f} ms per variant, {in_engine:.2f} s for all")
    print(f"engine's memory beyond the designs: {(after - before) / 1024:.0f} MB")
    print(f"ratio {per_run / per_variant:.0f}, target {TARGET:.0f}")


if __name__ == "__main__":
    main()
