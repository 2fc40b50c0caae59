"""A recorded flight through `OnlineCueing`, and what not knowing the flight to come costs."""

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.progress import work
from sdt_drake.machine.cueing.candidate import Candidate
from sdt_drake.machine.cueing.flight import Flight
from sdt_drake.machine.cueing.online import HORIZON, LAWS, STOPS, OnlineCueing
from sdt_drake.machine.cueing.problem import Weights
from sdt_drake.machine.cueing.result import CueingResult
from sdt_drake.motion.trajectory import Motion
from sdt_drake.systems.reference import sample_source

_MOVING = 1e-9  # rad/s


@dataclass(frozen=True, eq=False)
class OnlineRun:
    """The motion of an `OnlineCueing` along a recorded flight, and what its plans cost."""

    motion: Motion
    """The motion from the start of the flight to a stop after its end."""
    computing_share: Array
    """Computing time of each plan over the time between plans [-], shape (plans,)."""
    is_kept: NDArray[np.bool_]
    """True where the plan before went on, shape (plans,)."""


def run_online(cueing: OnlineCueing, flight: Flight) -> OnlineRun:
    """Run a cueing along a recorded flight, without a loop and as fast as it computes.

    After the end of the flight the input is not finite, so the device stops.
    """
    builder, knot, period = DiagramBuilder(), cueing.knot, cueing.period
    longest = flight.duration + HORIZON + max(STOPS) + 2 * knot
    samples = np.hstack([flight.specific_force, flight.angular_rate])
    times = np.concatenate([flight.time, [flight.duration + period / 2, longest]])
    samples = np.vstack([samples, np.full((2, 6), np.nan)])
    source = builder.AddSystem(sample_source(times, samples))
    builder.AddSystem(cueing)
    builder.Connect(source.get_output_port(), cueing.get_input_port())
    logs = [
        LogVectorOutput(cueing.get_output_port(k), builder, every)
        for k, every in enumerate((period, knot, knot))
    ]
    simulator = Simulator(builder.Build())
    n, context = len(cueing.start[0]), cueing.GetMyContextFromRoot(simulator.get_context())
    with work() as report:
        for time in np.append(np.arange(0.0, longest, 1.0), longest):
            simulator.AdvanceTo(time)
            report(min(time / flight.duration, 1.0))
            now: Any = cueing.get_output_port(0).Eval(context)
            if time > flight.duration + knot and np.abs(now[n : 2 * n]).max() < _MOVING:
                break
    # Logs have the values before the update at their time.
    reference, computing_share, is_kept = (
        log.FindLog(simulator.get_context()).data().T[1:] for log in logs
    )
    q, v, _ = np.split(reference, 3, axis=1)
    moves = np.flatnonzero((np.abs(v) > _MOVING).any(axis=1)).max(initial=0)
    v = v[: max(int(moves), round(flight.duration / period)) + 2].copy()
    v[-1] = 0.0
    plans = slice(1, max(2, math.ceil(flight.duration / knot)))
    return OnlineRun(
        Motion.from_speeds(period, q[0], v), computing_share[plans, 0], is_kept[plans, 0] > 0
    )


def with_online(flown: CueingResult, idle_g: float | None) -> CueingResult:
    """Add to a result the motions of both laws of `OnlineCueing`, which do not know what comes.

    They have the device, flight, pilot, weights and torque margin of the result, and begin with the
    sense of the arm and the seat of its best start that they can hold.
    """
    best, flight = flown.chosen, flown.chosen.flight
    weights, margin = flown.numbers["weights"], flown.numbers["torque_share_allowed"]
    starts = flown.numbers["starts"]
    assert isinstance(weights, dict) and isinstance(margin, float) and isinstance(starts, list)
    ordered = sorted(starts, key=lambda one: one["cost"])
    begins = [*((one["sense"], math.radians(one["seat_deg"])) for one in ordered), (1, 0.0)]
    online, told = [], {}
    for law in LAWS:
        cueing = _begun(
            begins, robot=best.robot, law=law, idle_g=idle_g, up=flight.specific_force[0],
            perception=best.model, weights=Weights(**weights), torque_margin=margin,
        )  # fmt: skip
        run = run_online(cueing, flight)
        online.append(Candidate(f"online, {law}", best.robot, run.motion, flight, 0.0, best.model))
        told[law] = {
            **online[-1].figures(flown.felt),
            "idle_g": cueing.idle_g,
            "period_s": cueing.knot,
            "computing_share_median": float(np.median(run.computing_share)),
            "computing_share_max": float(run.computing_share.max()),
            "kept_plans": int(run.is_kept.sum()),
        }
    numbers = {**flown.numbers, "online": told}
    return replace(flown, online=tuple(online), numbers=numbers)


def _begun(begins: Sequence[tuple[int, float]], **options: Any) -> OnlineCueing:
    """Return the block with the first sense and seat of some that it can begin with."""
    for sense, seat in begins[:-1]:
        with suppress(InputError):
            return OnlineCueing(sense=sense, seat=seat, **options)
    sense, seat = begins[-1]
    return OnlineCueing(sense=sense, seat=seat, **options)
