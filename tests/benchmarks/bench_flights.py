"""Flights on the shipped device, beside alignment and washout in one run: what is felt, and how.

    python tests/benchmarks/bench_flights.py [--alone] [FLIGHT.csv ... | MOTION ...]

Without files: the shipped turn, others made by transforming it, and flights of JSBSim's F-16 and
C172 (`pip install jsbsim`). At equal G error means: on the front, at the G error of the alignment;
with `--alone`, without a front, at the motion itself, which has no more G error than that.
Shipped training motions, by their names, are recovered from their own head motion.
"""

from __future__ import annotations

import contextlib
import os
import sys
import time as clock
from functools import partial

import numpy as np
import timing

from sdt_drake.analysis.perception import LINEAR
from sdt_drake.io.errors import InputError
from sdt_drake.machine.fly import procedure
from sdt_drake.machine.fly.flight import make_flight, read_flight
from sdt_drake.machine.fly.procedure import fly
from sdt_drake.machine.fly.program import RATE
from sdt_drake.motion import load_plan, shipped_motions
from sdt_drake.robot.head import head_motion
from sdt_drake.robot.robot import load_robot

PERIOD = 1 / 60  # s, of JSBSim
KNOT = 0.05  # s, of what is recovered
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


def flown(model, knots, bank, pull, name, seconds=50.0):
    """A flight of JSBSim: bank [deg] and elevator over time, from level trim."""
    import jsbsim

    with open(os.devnull, "w") as nothing, contextlib.redirect_stdout(nothing):
        plane = jsbsim.FGFDMExec(os.path.dirname(jsbsim.__file__))
        plane.set_debug_level(0)
        plane.load_model(model)
        plane.set_dt(PERIOD / 2)
        for place, value in (("ic/h-sl-ft", 8000), ("ic/vc-kts", knots), ("ic/gamma-deg", 0)):
            plane[place] = value
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
    rows = np.array(rows)
    down = [1, -1, -1]
    return make_flight(rows[:, 0], rows[:, 1:4] * 0.3048 * down, rows[:, 4:] * down, name)


def of_jsbsim():
    """Flights that are made here."""
    still = [(0, 0.0)]
    yield flown("f16", 350, still, [(5, 0), (7, -0.12), (14, -0.12), (16, 0)], "F-16 pull-up")
    weave = [(3, 0), (8, 45), (16, -45), (24, 45), (32, 0)]
    yield flown("f16", 350, weave, [(3, 0), (8, -0.06), (30, -0.06), (34, 0)], "F-16 weave")
    circle = [(3, 0), (9, 30), (35, 30), (41, 0)]
    yield flown("c172x", 100, circle, [(3, 0), (9, -0.05), (35, -0.05), (41, 0)], "C172 circle")


def row(robot, compare, flight):
    """The numbers of a flight, as texts."""
    began = clock.process_time()
    found = fly(robot, flight, compare=compare)
    cpu = clock.process_time() - began
    own, align, wash = found.numbers, found.numbers["alignment"], found.numbers["washout"]
    front = sorted((p["g_error_rms"], p["felt_rotation_rms_deg_s"]) for p in own["front"])
    at_equal = np.interp(align["g_error_rms"], *zip(*front, strict=True))
    costs = np.array([start["cost"] for start in own["starts"]])
    g, turn, up = "g_error_rms", "felt_rotation_rms_deg_s", "felt_vertical_rms_deg"
    begun = "felt_rotation_from_zero_rms_deg_s"
    return [
        flight.name, f"{flight.duration:.0f}",
        *(f"{one[g]:.3f}" for one in (own, align, wash)),
        *(f"{one[turn]:.1f}" for one in (own, align, wash)),
        f"{100 * (1 - at_equal / align[turn]):.0f}",
        *(f"{one[begun]:.1f}" for one in (own, align)),
        *("-" if one[up] is None else f"{one[up]:.1f}" for one in (own, align)),
        f"{100 * own['horizontal_force_felt_share']:.1f}",
        f"{100 * own['torque_share_max']:.2f}",
        " ".join(f"{100 * x:.0f}" for x in costs / costs.min() - 1),
        f"{own['cpu_s']:.0f}+{cpu - own['cpu_s']:.0f}",
    ]  # fmt: skip


def recovered(robot, name):
    """A training motion from its own head motion: largest errors over thresholds, and how often
    they are above a tenth."""
    motion = load_plan(name, robot).motion
    head = head_motion(robot, motion.q, motion.v, motion.vd)
    flight = make_flight(motion.time, head.specific_force, head.angular_velocity, name)
    found = fly(robot, flight, approach=2.0, departure=2.0, knot=KNOT, torque_margin=1.0,
                compare=False)  # fmt: skip
    within = found.chosen.within
    over = np.hstack([np.abs(found.chosen.force_error[within]) / np.array(LINEAR),
                      np.abs(found.chosen.felt_rate_error[within]) / RATE])  # fmt: skip
    often = 100 * (over > 0.1).any(axis=1).mean()
    return [name, f"{motion.duration:.0f}", f"{over[:, :3].max():.3f}", f"{over[:, 3:].max():.3f}",
            f"{np.median(over.max(axis=1)):.4f}", f"{often:.1f}"]  # fmt: skip


def table(header, rows):
    """Print a table row by row."""
    timing.head(*header)
    for name, cells in rows:
        try:
            timing.row(cells())
        except InputError as error:
            timing.row([name, error])


def main():
    robot = load_robot()
    asked = [name for name in sys.argv[1:] if name != "--alone"]
    compare = len(asked) == len(sys.argv) - 1
    motions = [name for name in asked if name in shipped_motions()]
    flights = [read_flight(path) for path in asked if path not in motions]
    if not asked:
        flights = list(transformed())
        try:
            flights += of_jsbsim()
        except ImportError:
            print("without JSBSim, which is not installed")
    if flights:
        table(COLUMNS, ((flight.name, partial(row, robot, compare, flight)) for flight in flights))
    if motions:
        procedure.SEATS = (0.0,)  # as they are shipped
        header = ("motion", "s", "force / threshold", "rotation", "median", "above 0.1 [% of time]")
        table(header, ((name, partial(recovered, robot, name)) for name in motions))


if __name__ == "__main__":
    main()
