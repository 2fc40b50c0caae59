"""How long all that the pilot feels of a recording of 30 s takes, against the target.

    python tests/benchmarks/bench_pilot.py [--rounds N]

The motion of the head for the reference and for what was achieved, canals and felt orientation of
both, the false sensation after the stop, and the felt difference, also by the joint angles alone.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from sdt_drake.analysis.illusions import feel
from sdt_drake.analysis.perception import canals, false_sensation_after_stop
from sdt_drake.analysis.tracking import track_head
from sdt_drake.robot.robot import Robot, load_robot
from sdt_drake.run.design import make_design
from sdt_drake.run.scenario import load_scenario
from sdt_drake.run.simulate import Recording, simulate

TARGET = 0.6


def everything(recording: Recording, robot: Robot) -> None:
    """All quantities of `sdt-drake pilot`."""
    head = track_head(recording, robot)
    period = float(recording.time[1] - recording.time[0])
    for motion in (head.reference, head.achieved):
        _ = motion.resultant_g
        canals(motion.angular_velocity, period)
        feel(motion, period, "clark2019")
        false_sensation_after_stop(motion.angular_velocity, period)
    for felt in (head.felt, head.felt_from_angles):
        _ = felt.share, felt.channel_share, felt.largest


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=9)
    rounds = parser.parse_args().rounds

    robot = load_robot()
    recording = simulate(make_design(load_scenario("package://sdt/scenarios/coupled_pi.yaml")))
    times = []
    for _ in range(rounds + 1):
        start = time.perf_counter()
        everything(recording, robot)
        times.append(time.perf_counter() - start)
    seconds = np.array(times[1:])  # the first round warms up
    print(
        f"pilot of {recording.time[-1]:g} s, {len(recording.time)} samples: "
        f"{np.median(seconds):.3f} s ({seconds.min():.3f} to {seconds.max():.3f}), "
        f"target {TARGET} s"
    )


if __name__ == "__main__":
    main()
