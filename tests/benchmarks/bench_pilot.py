"""How long all that the pilot feels of a recording of 30 s takes, against the target.

    python tests/benchmarks/bench_pilot.py [ROUNDS]

The motion of the head for the reference and for what was achieved, canals and felt orientation of
both, the false sensation after the stop, and the felt difference, also by the joint angles alone.
"""

from __future__ import annotations

import sys

from timing import report_time

from sdt_drake.analysis.illusions import feel
from sdt_drake.analysis.perception import canals, false_sensation_after_stop
from sdt_drake.analysis.tracking import track_head
from sdt_drake.robot.robot import Robot, load_robot
from sdt_drake.run.design import make_design
from sdt_drake.run.scenario import load_scenario
from sdt_drake.run.simulate import Recording, simulate


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


if __name__ == "__main__":
    robot = load_robot()
    recording = simulate(make_design(load_scenario("coupled_pi")))
    name = f"pilot of {recording.time[-1]:g} s, {len(recording.time)} samples"
    report_time(name, lambda: everything(recording, robot), 0.6, int([*sys.argv, 9][1]))
