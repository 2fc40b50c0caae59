"""How long it takes to plan 60 s of motion, and to compute what the pilot feels of 30 s.

    python tests/benchmarks/bench_times.py [ROUNDS]

On one core; medians of rounds after one to warm up. The planned motion is the reference motion,
twice. "limiter" and "retiming" plan it as it is; with a margin of 0.9 the limiter is at work; the
retiming is that of 2.95 rad/s on the planetary axis, which the limiter has to refuse. "pilot" is
all that `sdt-drake pilot` computes of a recording.
"""

import os
import sys
import time
from collections.abc import Callable

import numpy as np
from timing import head, row, spread

from sdt_drake.analysis.tracking import track_head
from sdt_drake.motion import Command, Motion, load_command, plan_motion, retime
from sdt_drake.pilot.canals import sensed_rate
from sdt_drake.pilot.illusions import feel
from sdt_drake.pilot.thresholds import false_sensation_after_stop
from sdt_drake.robot.robot import Robot, load_robot
from sdt_drake.run.design import make_design
from sdt_drake.run.recording import Recording
from sdt_drake.run.scenario import load_scenario
from sdt_drake.run.simulate import simulate


def twice(robot: Robot, planetary: float) -> Command:
    """The reference motion two times, with a planetary speed [rad/s]."""
    once = load_command("reference", robot)
    v = once.speeds(0.005 * np.arange(6001))
    v[:, 0] *= planetary / v[:, 0].max()
    v = np.vstack([v, v[1:]])
    return Command.of_motion("twice", Motion.from_speeds(0.005, once.q0, v))


def pilot(recording: Recording, robot: Robot) -> None:
    felt = track_head(recording, robot)
    period = float(recording.time[1] - recording.time[0])
    for motion in (felt.reference, felt.achieved):
        _ = motion.resultant_g
        sensed_rate(motion.angular_velocity, period)
        feel(motion, period, "clark2019")
        false_sensation_after_stop(motion.angular_velocity, period)
    for difference in (felt.felt, felt.felt_from_angles):
        _ = difference.share, difference.channel_share, difference.largest


def report(name: str, call: Callable[..., object], *given, target: float, **options) -> None:
    times = []
    for _ in range(int([*sys.argv, 5][1]) + 1):
        start = time.perf_counter()
        call(*given, **options)
        times.append(time.perf_counter() - start)
    row([name, spread(times[1:]), target])


if __name__ == "__main__":
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    robot = load_robot()
    reference, fast = twice(robot, 2.4), twice(robot, 2.95)
    head("what", "time [s]", "target")
    report("limiter", plan_motion, robot, reference, target=0.5)
    report("limiter, margin 0.9", plan_motion, robot, reference, torque_margin=0.9, target=0.5)
    report("retiming", retime, robot, reference, target=3.0)
    report("retiming, 2.95 rad/s", retime, robot, fast, target=3.0)
    report("retiming, margin 0.8", retime, robot, fast, torque_margin=0.8, target=3.0)
    report("pilot", pilot, simulate(make_design(load_scenario("coupled_pi"))), robot, target=0.6)
