"""Make, run and drop loops, and print by how much the process has grown [MB]."""

import ctypes
import gc
import sys
from pathlib import Path

import numpy as np

import sdt_drake as sdt


def resident():
    """Memory of this process [MB], after what is free was given back."""
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)
    (line,) = (x for x in Path("/proc/self/status").read_text().splitlines() if "VmRSS" in x)
    return int(line.split()[1]) / 1024


swing = np.sin(np.linspace(0, np.pi, 21)) ** 2
motion = sdt.Motion.from_speeds(0.005, np.zeros(4), np.outer(swing, [0.1] * 4))  # 0.1 s
cases = [(name, {}) for name in sys.argv[2:]] + [("coupled_pi_ctc", {"inverse_dynamics": "online"})]
designs = [sdt.design(sdt.load(*case), motion=motion) for case in cases]
before = 0.0
for runs in (3, -(-int(sys.argv[1]) // len(designs))):
    before = resident()
    for design in designs * runs:
        sdt.simulate(sdt.loop(design))
print(resident() - before)
