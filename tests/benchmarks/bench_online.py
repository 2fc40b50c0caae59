"""Cueing of flights as they come, beside the motion of `fly`, which knows them, in one run.

    python tests/benchmarks/bench_online.py [FLIGHT.csv ...]

The flights are those of bench_flights.py. Each cell of errors has the motion of `fly`, the online
program, and the online washout. Computing time is that of a plan over the 0.2 s between plans.
"""

import importlib.util
import sys

import numpy as np
from bench_flights import of_jsbsim, transformed
from timing import head, row

from sdt_drake.machine.cueing.flight import read_flight
from sdt_drake.machine.cueing.procedure import fly

COLUMNS = ("flight", "G error", "rotation [deg/s]", "vertical [deg]", "computing time [%]",
           "at most [%]", "plans not taken")  # fmt: skip


def compared(flight):
    """The numbers of a flight, as texts, and the median of the computing time [-]."""
    flown = fly("sdt", flight, compare=False, online=True)
    errors = np.array([one.errors(flown.felt) for one in (flown.chosen, *flown.online)])
    program = flown.numbers["online"]["program"]
    usual, most = program["computing_share_median"], program["computing_share_max"]
    digits = zip(errors.T, (3, 1, 1), strict=True)
    told = [", ".join(f"{x:.{n}f}" for x in values) for values, n in digits]
    cells = [flight.name, *told, f"{100 * usual:.0f}", f"{100 * most:.0f}"]
    return [*cells, str(program["kept_plans"])], usual


def main(*paths):
    flights = [read_flight(path) for path in paths]
    if not paths:
        flights = [*transformed(), *(of_jsbsim() if importlib.util.find_spec("jsbsim") else ())]
    head(*COLUMNS)
    shares = []
    for flight in flights:
        cells, share = compared(flight)
        row(cells)
        shares.append(share)
    return {"computing time of an online plan over its period": float(np.median(shares))}


if __name__ == "__main__":
    main(*sys.argv[1:])
