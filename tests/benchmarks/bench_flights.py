"""Flights on the shipped device, beside alignment and washout in one run: what is felt, and how.

    python tests/benchmarks/bench_flights.py [FLIGHT.csv ...]

Without files: the shipped turn, others made by transforming it, and flights of JSBSim's F-16 and
C172, if that is installed (`pip install jsbsim`). At equal G error means: on the front, at the G
error of the alignment.
"""

from __future__ import annotations

import importlib.util
import os
import sys

import numpy as np
from timing import head, row

from sdt_drake.io.errors import InputError
from sdt_drake.machine.fly.flight import make_flight, read_flight
from sdt_drake.machine.fly.procedure import fly
from sdt_drake.robot.robot import load_robot

PERIOD = 1 / 60  # s, of JSBSim
COLUMNS = ("flight", "s", "G err", "align", "wash", "rot err", "align", "wash", "at equal G [%]",
           "from zero", "align", "vertical", "align", "hor. force felt [%]", "torque [%]",
           "starts [%]", "cpu s")  # fmt: skip


def transformed():
    """The shipped turn, as it is, to the other side, at half and at 1.5 times its pace."""
    flight = read_flight("turn")
    t, f, w = flight.time, flight.specific_force, flight.angular_rate
    yield flight
    yield make_flight(t, f * [1, -1, 1], w * [-1, 1, -1], "turn to the left")
    yield make_flight(2 * t, f, w / 2, "turn at half its pace")
    yield make_flight(t / 1.5, f, 1.5 * w, "turn at 1.5 times its pace")


def flown(name, model, knots, bank, pull, seconds=50.0):
    """A flight of JSBSim: bank [deg] and elevator over time, from level trim."""
    import jsbsim

    plane = jsbsim.FGFDMExec(os.path.dirname(jsbsim.__file__))
    plane.set_debug_level(0)
    plane.load_model(model)
    plane.set_dt(PERIOD / 2)
    for place, value in {"h-sl-ft": 8000, "vc-kts": knots, "gamma-deg": 0}.items():
        plane[f"ic/{place}"] = value
    plane.run_ic()
    plane["propulsion/set-running"] = -1
    plane.do_trim(1)
    level = plane["fcs/elevator-cmd-norm"]
    rows = []
    for i in range(round(2 * seconds / PERIOD)):
        t = i * PERIOD / 2
        off = np.interp(t, *zip(*bank, strict=True)) - plane["attitude/phi-deg"]
        roll = np.degrees(plane["velocities/p-rad_sec"])
        plane["fcs/aileron-cmd-norm"] = float(np.clip(0.02 * off - 0.01 * roll, -0.4, 0.4))
        plane["fcs/elevator-cmd-norm"] = level + float(np.interp(t, *zip(*pull, strict=True)))
        plane.run()
        if i % 2 == 0:
            force = [plane[f"accelerations/a-pilot-{x}-ft_sec2"] for x in "xyz"]
            rows.append([t, *force, *(plane[f"velocities/{x}-rad_sec"] for x in "pqr")])
    rows, down = np.array(rows), [1, -1, -1]
    return make_flight(rows[:, 0], rows[:, 1:4] * 0.3048 * down, rows[:, 4:] * down, name)


def of_jsbsim():
    """Flights that are made here."""
    pull = [(5, 0), (7, -0.12), (14, -0.12), (16, 0)]
    yield flown("F-16 pull-up", "f16", 350, [(0, 0.0)], pull)
    bank = [(3, 0), (8, 45), (16, -45), (24, 45), (32, 0)]
    yield flown("F-16 weave", "f16", 350, bank, [(3, 0), (8, -0.06), (30, -0.06), (34, 0)])
    bank = [(3, 0), (9, 30), (35, 30), (41, 0)]
    yield flown("C172 circle", "c172x", 100, bank, [(3, 0), (9, -0.05), (35, -0.05), (41, 0)])


def compared(robot, flight):
    """The numbers of a flight, as texts."""
    own = fly(robot, flight, compare=True).numbers
    align, wash = own["alignment"], own["washout"]
    g, turn, up = "g_error_rms", "felt_rotation_rms_deg_s", "felt_vertical_rms_deg"
    begun = "felt_rotation_from_zero_rms_deg_s"
    front = sorted((point[g], point[turn]) for point in own["front"])
    at_equal = np.interp(align[g], *zip(*front, strict=True))
    costs = np.array([start["cost"] for start in own["starts"]])
    return [
        flight.name, f"{flight.duration:.0f}",
        *(f"{one[g]:.3f}" for one in (own, align, wash)),
        *(f"{one[turn]:.1f}" for one in (own, align, wash)),
        f"{100 * (1 - at_equal / align[turn]):.0f}",
        *(f"{one[begun]:.1f}" for one in (own, align)),
        *("-" if one[up] is None else f"{one[up]:.1f}" for one in (own, align)),
        f"{100 * own['horizontal_force_felt_share']:.1f}",
        f"{100 * own['torque_share_max']:.2f}",
        " ".join(f"{100 * x:.0f}" for x in costs / costs.min() - 1), f"{own['cpu_s']:.0f}",
    ]  # fmt: skip


def main(*paths):
    robot, flights = load_robot(), list(map(read_flight, paths))
    if not flights:
        flights = [*transformed(), *(of_jsbsim() if importlib.util.find_spec("jsbsim") else ())]
    head(*COLUMNS)
    for flight in flights:
        try:
            row(compared(robot, flight))
        except InputError as error:
            row([flight.name, error])


if __name__ == "__main__":
    main(*sys.argv[1:])
