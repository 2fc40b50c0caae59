"""Flights on the shipped device, beside rest, alignment and washout in one run: what is felt.

    python tests/benchmarks/bench_flights.py [FLIGHT.csv ... | MOTION ...]

Without files: the shipped turn, others made by transforming it, a launch by catapult, and flights
of JSBSim's F-16 and C172, if that is installed (`pip install jsbsim`). At the alignment's G means:
rotation and vertical on the front, at the G error of the alignment. Shipped training motions, by
their names, are found again from their own motion of the head.
"""

import importlib.util
import os
import sys
from functools import partial

import numpy as np
from timing import head, row

from sdt_drake.io.errors import InputError
from sdt_drake.machine.cueing.flight import make_flight, read_flight
from sdt_drake.machine.cueing.problem import RATE
from sdt_drake.machine.cueing.procedure import Effort, fly
from sdt_drake.motion import load_plan, shipped_motions
from sdt_drake.pilot.head import GRAVITY, head_motion
from sdt_drake.pilot.thresholds import LINEAR
from sdt_drake.robot.robot import load_robot

PERIOD = 1 / 60  # s, of JSBSim
COLUMNS = ("flight", "s", "G error", "rotation [deg/s]", "vertical [deg]", "at the alignment's G",
           "from zero", "hor. force felt [%]", "torque [%]", "starts [%]", "cpu s")  # fmt: skip


def transformed():
    """The shipped turn, as it is, to the other side, at half and at 1.5 times its pace."""
    flight = read_flight("turn")
    t, f, w = flight.time, flight.specific_force, flight.angular_rate
    yield flight
    yield make_flight(t, f * [1, -1, 1], w * [-1, 1, -1], "turn to the left")
    yield make_flight(2 * t, f, w / 2, "turn at half its pace")
    yield make_flight(t / 1.5, f, 1.5 * w, "turn at 1.5 times its pace")


def catapult():
    """A launch with 2.6 G forward for 2 s, a climb at 10 deg, and a push-over to level flight."""
    t = np.arange(0, 50.0, 0.1)
    f, w = np.zeros((len(t), 3)), np.zeros((len(t), 3))
    f[:, 0] = GRAVITY * np.interp(
        t, [12, 12.2, 14.1, 14.3, 17.5, 40, 44, 50], [0, 2.6, 2.6, 0.37, 0.51, 0.36, 0.19, 0.15]
    )
    f[:, 2] = GRAVITY * np.interp(
        t, [14, 14.6, 17, 17.6, 39.6, 40.3, 43.7, 44.3], [1, 1.38, 1.38, 0.99, 0.99, 0.54, 0.53, 1]
    )
    turns = [14, 14.6, 17, 17.6, 39.7, 40.3, 43.7, 44.3], [0, -3.3, -3.3, 0, 0, 2, 2, 0]  # deg/s
    w[:, 1] = np.radians(np.interp(t, *turns))
    yield make_flight(t, f, w, "launch by catapult")


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
    pull = [(3, 0), (5, -0.35), (20, -0.35), (22, 0)]
    yield flown("F-16 pull of 4.3 G", "f16", 450, [(0, 0.0)], pull, 25.0)
    bank = [(3, 0), (8, 45), (16, -45), (24, 45), (32, 0)]
    yield flown("F-16 weave", "f16", 350, bank, [(3, 0), (8, -0.06), (30, -0.06), (34, 0)])
    bank = [(3, 0), (9, 30), (35, 30), (41, 0)]
    yield flown("C172 circle", "c172x", 100, bank, [(3, 0), (9, -0.05), (35, -0.05), (41, 0)])


def compared(robot, flight):
    """The numbers of a flight, as texts: those of the motion, at rest, aligned, washed out."""
    own = fly(robot, flight, compare=True).numbers
    four = own, own["rest"], own["alignment"], own["washout"]
    g, turn, up = "g_error_rms", "felt_rotation_rms_deg_s", "felt_vertical_rms_deg"
    searched = [point for point in own["front"] if np.isfinite(point["g_weight"])]
    front = np.array([[point[name] or 0 for name in (g, turn, up)] for point in searched])
    at_equal = [np.interp(own["alignment"][g], front[:, 0], front[:, k]) for k in (1, 2)]
    costs = np.array([start["cost"] for start in own["starts"]])
    return [
        flight.name, f"{flight.duration:.0f}",
        ", ".join(f"{one[g]:.3f}" for one in four),
        ", ".join(f"{one[turn]:.1f}" for one in four),
        ", ".join("-" if one[up] is None else f"{one[up]:.1f}" for one in four),
        ", ".join(f"{x:.1f}" for x in at_equal),
        f"{own['felt_rotation_from_zero_rms_deg_s']:.1f}",
        f"{100 * own['horizontal_force_felt_share']:.1f}",
        f"{100 * own['torque_share_max']:.2f}",
        " ".join(f"{100 * x:.0f}" for x in costs / costs.min() - 1), f"{own['cpu_s']:.0f}",
    ]  # fmt: skip


def found_again(robot, name):
    """Errors over thresholds of a training motion that is found from its motion of the head."""
    motion = load_plan(name, robot).motion
    felt = head_motion(robot, motion.q, motion.v, motion.vd)
    flight = make_flight(motion.time, felt.specific_force, felt.angular_velocity, name)
    own = {"approach": 2.0, "departure": 2.0, "knot": 0.05, "torque_margin": 1.0}
    as_shipped = Effort(seats=(0.0,))
    chosen = fly(robot, flight, **own, compare=False, effort=as_shipped).chosen
    own = chosen.within
    errors = chosen.force_error[own] / np.array(LINEAR), chosen.felt_rate_error[own] / RATE
    force, rotation = (np.abs(error).max(axis=1) for error in errors)
    largest = np.maximum(force, rotation)
    return [name, f"{force.max():.3f}", f"{rotation.max():.3f}", f"{np.median(largest):.4f}",
            f"{100 * (largest > 0.1).mean():.1f}"]  # fmt: skip


def main(*asked):
    robot = load_robot()
    motions = [name for name in asked if name in shipped_motions()]
    flights = [read_flight(path) for path in asked if path not in motions]
    if not asked:
        flights = [
            *transformed(),
            *catapult(),
            *(of_jsbsim() if importlib.util.find_spec("jsbsim") else ()),
        ]
    tables = [(COLUMNS, flight.name, partial(compared, robot, flight)) for flight in flights]
    if motions:
        header = ("motion", "force / threshold", "rotation", "median", "above 0.1 [% of time]")
        tables += [(header, name, partial(found_again, robot, name)) for name in motions]
    shown = None
    for columns, name, cells in tables:
        if columns != shown:
            head(*columns)
            shown = columns
        try:
            row(cells())
        except InputError as error:
            row([name, error])


if __name__ == "__main__":
    main(*sys.argv[1:])
