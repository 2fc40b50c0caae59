"""A walk through a loop in steps of 0.1 ms.

Independent: the loop is stopped 50 times in each period, just after and just before what may happen
at an instant, its torque is read there, and peaks, means and RMS are those of straight lines
between the values. The package integrates them within the simulation, and finds peaks by
derivatives.
"""

import numpy as np

from sdt_drake.run.loop import make_loop
from sdt_drake.run.simulate import make_simulator

STEPS = 50  # in a period
HAIR = 1e-9  # s


def walked(design):
    """Peak, RMS, mean and share of time saturated of each period, (4, N, n), by small steps."""
    loop, period = make_loop(design), design.reference.held.period
    simulator = make_simulator(loop.diagram, period=period, accuracy=1e-4)
    context = simulator.get_mutable_context()
    loop.set_steady_state(context)
    simulator.Initialize()
    torques, found = loop.logs["torques"], []
    own = torques.GetMyContextFromRoot(context)
    for i in range(len(design.reference.held.time) - 1):
        torque, saturated = [], []
        for step in range(STEPS):
            ends = []
            for end in (0, 1):  # just after and just before what may happen at an instant
                simulator.AdvanceTo((i + (step + end) / STEPS) * period + (-HAIR if end else HAIR))
                tau_cmd, tau_limited, tau, _ = np.split(torques.get_input_port().Eval(own), 4)
                torque.append(tau)
                ends.append(tau_cmd != tau_limited)
            saturated.append(np.mean(ends, axis=0))
        a, b = np.array(torque[::2]), np.array(torque[1::2])
        rms = np.sqrt(np.mean((a * a + a * b + b * b) / 3, axis=0))
        mean = np.mean((a + b) / 2, axis=0)
        found.append((np.abs(torque).max(axis=0), rms, mean, np.mean(saturated, axis=0)))
    return np.moveaxis(np.array(found), 1, 0)
