"""How long it takes to plan 60 s of motion, on one core.

    python tests/benchmarks/bench_planning.py [--rounds N]

The motion is the reference motion, twice. "limiter" and "retiming, as commanded" plan it as it is;
with a margin of 0.9 the limiter is at work; the retiming is that of 2.95 rad/s on the planetary
axis, which the limiter has to refuse.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable

import numpy as np

from sdt_drake.motion import Command, Motion, load_command, plan_motion, retime
from sdt_drake.robot.robot import load_robot

TARGETS = {
    "limiter": 0.5,
    "limiter, margin 0.9": 0.5,
    "retiming, as commanded": 3.0,
    "retiming, 2.95 rad/s": 3.0,
    "retiming, 2.95 rad/s, margin 0.8": 3.0,
}


def twice(robot, planetary: float) -> Command:
    """60 s: the reference motion two times, with a planetary speed [rad/s]."""
    once = load_command("reference", robot)
    v = once.speeds(0.005 * np.arange(6001))
    v[:, 0] *= planetary / v[:, 0].max()
    v = np.vstack([v, v[1:]])
    return Command.of_motion("twice", Motion.from_speeds(0.005, once.q0, v))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5)
    rounds = parser.parse_args().rounds
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})

    robot = load_robot()
    reference, fast = twice(robot, 2.4), twice(robot, 2.95)
    runs: tuple[Callable[[], object], ...] = (
        lambda: plan_motion(robot, reference),
        lambda: plan_motion(robot, reference, torque_margin=0.9),
        lambda: retime(robot, reference),
        lambda: retime(robot, fast),
        lambda: retime(robot, fast, torque_margin=0.8),
    )
    for (name, target), run in zip(TARGETS.items(), runs, strict=True):
        times = []
        for _ in range(rounds + 1):
            start = time.perf_counter()
            run()
            times.append(time.perf_counter() - start)
        taken = np.array(times[1:])  # the first round warms up
        print(
            f"{name:34s} {np.median(taken):.3f} s "
            f"({taken.min():.3f} to {taken.max():.3f}), target {target} s"
        )


if __name__ == "__main__":
    main()
