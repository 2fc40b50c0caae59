"""How long identification takes: four joints at 200 Hz for 30 s, seven at 1 kHz for 20 and 100 s.

python tests/benchmarks/bench_identify.py

The ratio is CPU time over that of the regressor at as many samples, which depends less on the
machine.
"""
# ruff: noqa: E402

import resource
import sys
import time
from pathlib import Path

import numpy as np
from timing import head, row

sys.path[:0] = [str(Path(__file__).parents[1])]

from helpers.robots import chain_sdf, loaded

from sdt_drake.machine.identify.procedure import identify
from sdt_drake.machine.identify.regressor import regressor
from sdt_drake.machine.recordings.recorded import Recorded
from sdt_drake.robot.dynamics import inverse_dynamics
from sdt_drake.robot.robot import Robot, load_robot


def recording(robot: Robot, seconds: float, rate: float) -> Recorded:
    """Sines in all joints, with Coulomb friction and noise of 1 %."""
    rng = np.random.default_rng(0)
    clock = np.arange(0, seconds, 1 / rate)
    omega = 2 * np.pi * np.array([0.1, 0.2, 0.3, 0.5, 0.7])
    angle = omega * clock[:, None, None] + rng.uniform(0, 6, (robot.n, 5))
    size = rng.uniform(0.2, 0.5, (robot.n, 5)) / omega
    waves = (np.sin(angle), omega * np.cos(angle), -(omega**2) * np.sin(angle))
    q, v, vd = (np.sum(size * wave, axis=2) for wave in waves)
    tau = inverse_dynamics(robot, q, v, vd)
    size = np.sqrt(np.mean(tau**2, axis=0))
    tau = tau + size * (0.1 * np.sign(v) + 0.01 * rng.normal(size=tau.shape))
    return Recorded(Path("bench.csv"), clock, {"q": q, "tau": tau})


def main() -> dict[str, float]:
    """Print the table, and return the ratio of the last case."""
    device, seven = load_robot(), loaded(chain_sdf(7))
    head("joints", "samples", "identify [CPU s]", "times the regressor", "left held out [%]")
    for robot, seconds, rate in ((device, 30.0, 200.0), (seven, 20.0, 1e3), (seven, 100.0, 1e3)):
        recorded = recording(robot, seconds, rate)
        q = recorded.signals["q"]
        begin = time.process_time()
        for part in np.array_split(q, 1 + len(q) // 20_000):  # all at once is 0.4 GB
            regressor(robot, part, part, part)
        middle = time.process_time()
        found = identify(robot, [recorded])
        taken = time.process_time() - middle
        left, ratio = found.left(found.predicted, held_out=True).max(), taken / (middle - begin)
        row([robot.n, len(q), f"{taken:.2f}", f"{ratio:.2f}", f"{100 * left:.2f}"])
    return {f"{robot.n} joints, {len(q)} samples": ratio}


if __name__ == "__main__":
    main()
    print(f"memory: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6:.2f} GB")
