"""How long identification takes: four joints at 200 Hz for 30 s, seven at 1 kHz for 20 and 100 s.

python tests/benchmarks/bench_identify.py

The ratio is CPU time over that of the regressor at as many samples, which depends less on the
machine; the program ends with 1 where it or the memory of the last case is more than MOST.
"""
# ruff: noqa: E402

from __future__ import annotations

import resource
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[1] / "robot")]

from robots import chain_sdf

from sdt_drake.machine.identify.procedure import identify
from sdt_drake.machine.identify.regressor import regressor
from sdt_drake.machine.recordings import Recorded
from sdt_drake.robot.dynamics import inverse_dynamics
from sdt_drake.robot.robot import Robot, load_robot

MOST = 8.0, 0.8  # times the regressor's CPU time; GB


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


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        chain = Path(folder) / "chain.sdf"
        chain.write_text(chain_sdf(7))
        seven = load_robot(chain)
        cases = (
            ("device", load_robot(), 30.0, 200.0),
            ("7 joints", seven, 20.0, 1e3),
            ("7 joints", seven, 100.0, 1e3),
        )
    for name, robot, seconds, rate in cases:
        recorded = recording(robot, seconds, rate)
        q = recorded.signals["q"]
        begin = time.perf_counter(), time.process_time()
        for part in np.array_split(q, 1 + len(q) // 20_000):  # all at once is 0.4 GB
            regressor(robot, part, part, part)
        middle = time.perf_counter(), time.process_time()
        found = identify(robot, [recorded])
        end = time.perf_counter(), time.process_time()
        left = 100 * found.left(found.predicted, held_out=True).max()
        ratio = (end[1] - middle[1]) / (middle[1] - begin[1])
        print(
            f"{name}, {len(q)} samples: regressor {middle[0] - begin[0]:.2f} s (CPU "
            f"{middle[1] - begin[1]:.2f}), identify {end[0] - middle[0]:.2f} s (CPU "
            f"{end[1] - middle[1]:.2f}, ratio {ratio:.2f}), at most {left:.2f} % held out are left"
        )
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(f"memory: {memory:.2f} GB")
    sys.exit(ratio > MOST[0] or memory > MOST[1])


if __name__ == "__main__":
    main()
