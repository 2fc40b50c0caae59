"""Do flights diverge on devices for which the check says that learning converges?

    python tests/benchmarks/bench_learning.py [DEVICES [FLIGHTS [OUT]]]

The devices, 200 by default, are the draws of the shipped Monte Carlo study: the payload by 20 kg
and 5 cm, the links by up to 10 %, friction, disturbed loads. Each learns from its own flights, all
20 of them, with the filter of the nominal model. A row of bench_learning.csv for each device: the
check, errors of the first, best and last flight, peak torque. It diverges if the last flight's
error is larger than the first's, or if the error still grows at the end: 4000 runs of 30 s of
motion are hours. Devices that are in the file already are left out, so it can be stopped and go on.
"""

import csv
import sys
from pathlib import Path

import numpy as np

from sdt_drake.analysis.comparison import with_controller
from sdt_drake.machine.learn.filter import convergence, design_filter
from sdt_drake.machine.learn.loops import loop_set, loops_of
from sdt_drake.machine.learn.trials import learn
from sdt_drake.run.design import make_design
from sdt_drake.run.scenario import load_scenario
from sdt_drake.studies.devices import devices_of
from sdt_drake.studies.study import load_study

HEADER = (
    "device", "check", "demand", "first_rms_deg", "best_rms_deg", "best_flight", "last_rms_deg",
    "first_largest_deg", "last_largest_deg", "peak_growth", "saturated", "diverges",
)  # fmt: skip


def flown(device, filter_, flights):
    """A device's row, without its number."""
    check = convergence(filter_, loop_set("the device", [device], "reference"))
    result = learn(device, filter_, flights, stops=False)
    scores = np.degrees([flight.score for flight in result.trials])
    first, last = result.trials[0], result.trials[-1]
    growing = len(scores) > 5 and np.all(np.diff(scores[-4:]) > 0.01 * scores[-4:-1])
    return (
        check.largest, check.loops.demand.max(), scores[0], scores.min(), result.best.number,
        scores[-1], np.degrees(first.largest.max()), np.degrees(last.largest.max()),
        float((last.peak / first.peak)[first.peak > 0.2].max()), float(last.saturated.max()),
        bool(scores[-1] > scores[0] or growing),
    )  # fmt: skip


def main(devices=200, flights=20, out="bench_learning.csv"):
    study, base = load_study("monte_carlo")
    scenario = load_scenario("uncertain", {"accuracy": study.accuracy})
    design = make_design(with_controller(scenario, "p_pi+id"))
    filter_ = design_filter(design, loops_of(design, "reference"), "reference")
    done = Path(out).read_text(encoding="utf-8").splitlines() if Path(out).exists() else []
    with open(out, "a", newline="", encoding="utf-8", buffering=1) as file:
        table = csv.writer(file)
        if not done:
            table.writerow(HEADER)
        # Rows of all levels of the controller are left out: one row is one draw.
        for number, device in enumerate(devices_of(design, study, base, int(devices))):
            if not any(line.startswith(f"{number},") for line in done):
                table.writerow((number, *flown(device, filter_, int(flights))))


if __name__ == "__main__":
    main(*sys.argv[1:])
