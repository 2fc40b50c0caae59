"""Do flights diverge on devices for which the check says that learning converges?

    python tests/benchmarks/bench_learning.py --devices 200 --flights 20 --out bench_learning.csv

The devices are the draws of the shipped Monte Carlo study: the payload by 20 kg and 5 cm, the links
by up to 10 %, friction, disturbed loads. Each learns from its own flights, all of them, with the
filter of the nominal model. A row for each device: the check, errors of the first, best and last
flight, peak torque. It diverges if the last flight's error is larger than the first's, or if the
error still grows at the end. 200 devices and 20 flights are 4000 runs of 30 s of motion: hours.
Devices that are in the file already are left out, so it can be stopped and go on.
"""

from __future__ import annotations

import argparse
import csv
import time
from pathlib import Path

import numpy as np

from sdt_drake.analysis.comparison import with_controller
from sdt_drake.machine.learn.filter import convergence, design_filter
from sdt_drake.machine.learn.flights import learn
from sdt_drake.machine.learn.loops import loop_set, loops_of
from sdt_drake.run.design import make_design
from sdt_drake.run.scenario import load_scenario
from sdt_drake.studies.devices import devices_of
from sdt_drake.studies.study import load_study

HEADER = (
    "device", "check", "demand", "first_rms_deg", "best_rms_deg", "best_flight", "last_rms_deg",
    "first_largest_deg", "last_largest_deg", "peak_growth", "saturated", "diverges", "seconds",
)  # fmt: skip


def flown(device, filter_, flights):
    """A device's row, without its number."""
    start = time.perf_counter()
    check = convergence(filter_, loop_set("the device", [device], "reference"))
    lessons = learn(device, filter_, flights, stops=False)
    scores = np.degrees([flight.score for flight in lessons.flights])
    first, last, best = lessons.flights[0], lessons.flights[-1], lessons.best
    growing = len(scores) > 5 and np.all(np.diff(scores[-4:]) > 0.01 * scores[-4:-1])
    return (
        check.largest, check.loops.demand.max(), scores[0], scores.min(), best.number, scores[-1],
        np.degrees(first.largest.max()), np.degrees(last.largest.max()),
        float((last.peak / first.peak)[first.peak > 0.2].max()),
        float(last.saturated.max()), bool(scores[-1] > scores[0] or growing),
        round(time.perf_counter() - start, 1),
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--devices", type=int, default=200)
    parser.add_argument("--flights", type=int, default=20)
    parser.add_argument("--out", type=Path, default=Path("bench_learning.csv"))
    options = parser.parse_args()

    study, base = load_study("monte_carlo")
    scenario = with_controller(load_scenario("uncertain"), "p_pi+id")
    scenario.accuracy = study.accuracy
    design = make_design(scenario)
    filter_ = design_filter(design, loops_of(design, "reference"), "reference")
    # Rows of all levels of the controller are left out: one row is one draw.
    devices = devices_of(design, study, base, options.devices)
    done = set()
    if options.out.exists():
        with options.out.open(encoding="utf-8") as file:
            done = {int(row["device"]) for row in csv.DictReader(file)}
    with options.out.open("a", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        if not done:
            table.writerow(HEADER)
        for number, device in enumerate(devices):
            if number not in done:
                row = (number, *flown(device, filter_, options.flights))
                table.writerow(row)
                file.flush()
                print(dict(zip(HEADER, row, strict=True)), flush=True)


if __name__ == "__main__":
    main()
