"""How long it takes to plan 60 s of motion, on one core.

    python tests/benchmarks/bench_planning.py [ROUNDS]

The motion is the reference motion, twice. "limiter" and "retiming, as commanded" plan it as it is;
with a margin of 0.9 the limiter is at work; the retiming is that of 2.95 rad/s on the planetary
axis, which the limiter has to refuse.
"""

from __future__ import annotations

import sys

import numpy as np
from timing import one_core, report_time

from sdt_drake.motion import Command, Motion, load_command, plan_motion, retime
from sdt_drake.robot.robot import load_robot


def twice(robot, planetary: float) -> Command:
    """60 s: the reference motion two times, with a planetary speed [rad/s]."""
    once = load_command("reference", robot)
    v = once.speeds(0.005 * np.arange(6001))
    v[:, 0] *= planetary / v[:, 0].max()
    v = np.vstack([v, v[1:]])
    return Command.of_motion("twice", Motion.from_speeds(0.005, once.q0, v))


if __name__ == "__main__":
    one_core()
    robot, rounds = load_robot(), int([*sys.argv, 5][1])
    reference, fast = twice(robot, 2.4), twice(robot, 2.95)
    for name, plan, command, margin, target in (
        ("limiter", plan_motion, reference, 1.0, 0.5),
        ("limiter, margin 0.9", plan_motion, reference, 0.9, 0.5),
        ("retiming, as commanded", retime, reference, 1.0, 3.0),
        ("retiming, 2.95 rad/s", retime, fast, 1.0, 3.0),
        ("retiming, 2.95 rad/s, margin 0.8", retime, fast, 0.8, 3.0),
    ):
        report_time(name, lambda: plan(robot, command, torque_margin=margin), target, rounds)  # noqa: B023
