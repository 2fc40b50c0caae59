"""Search for a motion of a device near a flight in force and felt rotation: `fly`."""

import math
import time as clock
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from sdt_drake.io.arguments import (
    a_path,
    finite_number,
    instance_of,
    positive,
    share,
    takes,
    whole_periods,
)
from sdt_drake.io.progress import work
from sdt_drake.io.signals import holding_signals
from sdt_drake.machine.cueing.alignment import Start, aligned, angles, standing, washed_out
from sdt_drake.machine.cueing.candidate import SENSED_PERIOD, Candidate, percept_of
from sdt_drake.machine.cueing.felt import felt, followed
from sdt_drake.machine.cueing.flight import Flight, FlightColumns, read_flight
from sdt_drake.machine.cueing.objective import objective
from sdt_drake.machine.cueing.online import OnlineCueing
from sdt_drake.machine.cueing.online_flight import with_online
from sdt_drake.machine.cueing.problem import (
    Problem,
    Trajectory,
    Weights,
    check_program,
    has_arm,
    resultant,
)
from sdt_drake.machine.cueing.program import fitted
from sdt_drake.machine.cueing.reach import reach
from sdt_drake.machine.cueing.result import CueingResult
from sdt_drake.machine.cueing.search import Released, Search, reasons, unexcelled
from sdt_drake.motion.plan import INTERPOLATION_PERIOD
from sdt_drake.pilot.head import GRAVITY
from sdt_drake.pilot.observer import PerceptionModel, load_perception
from sdt_drake.pilot.orientation import Percept
from sdt_drake.robot.robot import Robot, load_robot

SMOOTH = (1.0, 2.0)
"""Smoothing times of alignments [s]; the search starts from the first."""

G_WEIGHT = 0.3
"""Weight of the G error where none is given [-]; felt rotation has 1."""

_WEIGHT_BESIDE = 0.05  # weight of errors before and after the flight
_ALIGNMENT, _WASHOUT = "alignment", "classical washout"
_WASHED_SMOOTH = 0.2  # smoothing time of a washout [s]


@dataclass(frozen=True)
class Effort:
    """The extent of the search for a motion."""

    seats: tuple[float, ...] = (0.0, np.pi / 2, np.pi, -np.pi / 2)
    """First angles of the last joint [rad]; the search starts from each."""
    front: tuple[float, ...] = (0.01, 0.1, 0.3, 3.0, 10.0, 30.0)
    """Factors of further motions on the weights, see `Weights.times` [-]."""


WHOLE = Effort()


def _columns(value: FlightColumns | str | Path, name: str) -> object:
    """Check columns of a flight: an object or a file."""
    return value if isinstance(value, FlightColumns) else a_path(value, name)


_not_negative = partial(finite_number, minimum=0.0)


@takes(
    columns=_columns, approach=positive, departure=positive, idle_g=resultant, knot=positive,
    torque_margin=share, g_weight=positive, vertical_weight=_not_negative,
    acceleration_weight=_not_negative, online=instance_of(bool), effort=instance_of(Effort),
)  # fmt: skip
def fly(
    robot: Robot | str | Path,
    flight: Flight | str | Path,
    *,
    columns: FlightColumns | str | Path | None = None,
    approach: float = 15.0,
    departure: float = 15.0,
    idle_g: float | None = None,
    knot: float = 0.2,
    torque_margin: float = 0.95,
    g_weight: float = G_WEIGHT,
    vertical_weight: float = 1.0,
    acceleration_weight: float = 0.1,
    perception: str | PerceptionModel = "slow_yaw",
    compare: bool = True,
    online: bool = False,
    effort: Effort = WHOLE,
) -> CueingResult:
    """Search for a motion of a device that is felt like a flight, within all limits.

        >>> import numpy as np, sdt_drake as sdt
        >>> from sdt_drake.machine.cueing.flight import make_flight
        >>> time = np.arange(0, 2.01, 0.05)
        >>> pull = 1 + 0.1 * np.sin(np.pi * time / 2) ** 2  # G
        >>> flight = make_flight(time, np.outer(pull, [0, 0, 9.81]), np.zeros((41, 3)))
        >>> quick = {"approach": 1, "departure": 1, "knot": 0.5, "compare": False}
        >>> flown = sdt.fly("sdt", flight, **quick)
        >>> chosen, rest, alignment, *_ = flown.candidates
        >>> print(chosen.felt_rotation < 0.5 * alignment.felt_rotation)
        True
        >>> flown.motion.to_csv("motion.csv")

    `sdt.fly("sdt", "turn.csv")` reads a recording. `print(flown)` compares the candidates.

    The cost has the errors of force and of felt gravity, rotation and acceleration, each
    over its threshold of perception. No motion that was found excels the chosen one: none is
    nearer in one of G, felt rotation and felt vertical, and at least as near in the others. The
    same input gives the same motion. An interrupt (Ctrl-C) ends the search and keeps the best
    motion so far.

    Args:
        robot: A device with a head and at least two joints, its file, or the name of a shipped one.
        flight: A flight, its file, or the name of a shipped one.
        columns: Names and units of the columns, a mapping file, or the name of a shipped one.
        approach: Time from rest to the start of the flight [s].
        departure: Time from the end of the flight to rest [s].
        idle_g: Resultant before and after the flight [G]; by default that of its first and last
            sample.
        knot: Time between knots of the search [s].
        torque_margin: Share of the motors' torque to use [-].
        g_weight: Weight of the squared G error over its threshold, beside 1 for the felt rotation
            [-]. A larger weight gives a smaller G error.
        vertical_weight: The same for the felt vertical [-].
        acceleration_weight: The same for the felt acceleration [-].
        perception: Perception model of the pilot, or its name.
        compare: True to find the motion without limits of torque and the Pareto front, too.
        online: True for the motions of an `OnlineCueing` too, which does not know what comes. It
            begins with `idle_g`, or its own default.
        effort: Starts of the search, and weights of the Pareto front.

    Raises:
        InputError: The flight or the device cannot be used, or no motion keeps the limits.
    """
    robot = robot if isinstance(robot, Robot) else load_robot(robot)
    flight = flight if isinstance(flight, Flight) else read_flight(flight, columns)
    model = perception if isinstance(perception, PerceptionModel) else load_perception(perception)
    _check(robot, knot, approach)
    if online:  # refused before the search
        up = flight.specific_force[0]
        OnlineCueing(robot, idle_g=idle_g, up=up, torque_margin=torque_margin)
    began = clock.process_time()
    ends = (approach, departure)
    weights = Weights(g_weight, vertical_weight, 1.0, acceleration_weight)
    result = None
    try:
        with holding_signals() as released:  # which arrive while the search keeps what it has
            problem = _problem_of(robot, flight, ends, idle_g, knot, torque_margin, model, weights)
            result = _flown(problem, flight, ends, effort, compare, released)
            result.numbers["cpu_s"] = clock.process_time() - began
        if online and not result.numbers["interrupted"]:
            return with_online(result, idle_g)
    except KeyboardInterrupt:
        if result is None:
            raise
        result.numbers["interrupted"] = True
    return result


def _flown(
    problem: Problem, flight: Flight, ends: tuple[float, float], effort: Effort, compare: bool,
    released: Released,
) -> CueingResult:  # fmt: skip
    """Search for a motion, and compare it."""
    robot, model = problem.robot, problem.model
    starts = [(s, seat) for s in ((1, -1) if problem.arm else (1,)) for seat in effort.seats]
    factors = sorted(effort.front if compare else (), key=lambda x: abs(math.log(x)))
    every = np.linspace(0.0, flight.duration, math.ceil(flight.duration / SENSED_PERIOD) + 1)
    in_flight = percept_of(model, every, *flight.at(every))
    still = _still(problem, flight, in_flight)

    def shown(name: str, trajectory: Trajectory) -> Candidate:
        return Candidate(name, robot, trajectory.motion, flight, ends[0], model)

    baselines = {name: (f"{name} left out: at rest", still) for name in (_ALIGNMENT, _WASHOUT)}
    with work() as report:
        search = Search(problem, still, report, len(starts) + 1 + compare + len(factors), released)

        def begin() -> None:
            x = aligned(problem, starts)
            simple = {
                f"alignment, seat at {np.degrees(seat):.0f} deg, smoothed {smooth:g} s":
                fitted(problem, angles(problem, x[k], smooth, *ends))
                for k, seat in enumerate(effort.seats) for smooth in SMOOTH
            }  # fmt: skip
            name = min(simple, key=lambda name: shown(name, simple[name]).felt_rotation)
            baselines[_ALIGNMENT] = name, simple[name]
            turned = angles(problem, washed_out(problem, x[0]), _WASHED_SMOOTH, *ends)
            baselines[_WASHOUT] = _WASHOUT, fitted(problem, turned)
            search.run([angles(problem, one, SMOOTH[0], *ends)[::2] for one in x])

        search.keep(begin)
        for name, baseline in baselines.values():
            if baseline is not still:
                search.offer(name, baseline)
        for factor in 2 * [1.0, *factors]:  # the second time where a better start is known by then
            if factor == 1 or not search.interrupted:
                search.find(factor)
        own = search.find(1.0)
        free = search.without_torque_limits(own) if compare else None
    found = [shown(origin, one) for origin, _, one in search.found]
    errors = [one.errors(in_flight) for one in found]
    front = unexcelled(errors)
    best = next(found[k] for k in front if np.all(np.array(errors[k]) <= errors[own]))
    result = CueingResult(
        replace(best, name="this motion"), found[0],
        shown(*baselines[_ALIGNMENT]), shown(*baselines[_WASHOUT]),
        shown("without limits of torque", free) if free else None,
        tuple((search.found[k][1] * problem.weights.g, found[k]) for k in front), in_flight, {},
    )  # fmt: skip
    result.numbers.update(_numbers(result, problem, search, found, starts))
    return result


def _numbers(
    flown: CueingResult, problem: Problem, search: Search, found: list[Candidate],
    starts: list[Start],
) -> dict[str, object]:  # fmt: skip
    """Return the content of summary.json; `found` are the motions of `Search.found`."""
    best, flight, model, felt = flown.chosen, flown.chosen.flight, problem.model, flown.felt
    reached, why_above = reach(problem.robot, flight), reasons(problem.arm, search.ends)
    return {
        "flight": flight.name,
        "robot": problem.robot.name,
        "flight_starts_at": best.starts_at,
        "flight_duration": flight.duration,
        **best.figures(felt),
        "torque_share_allowed": problem.torque_share,
        "perception": model.source,
        "perception_gains": {k: getattr(model, k) for k in ("k_w", "k_fw", "k_fg", "k_a")},
        "rest": {"posture_deg": np.degrees(flown.rest.motion.q[0]), **flown.rest.figures(felt)},
        "alignment": {"name": flown.alignment.name, **flown.alignment.figures(felt)},
        "washout": flown.washout.figures(felt),
        "without_torque_limits": flown.unlimited and flown.unlimited.figures(felt),
        "front": [
            {"g_weight": g, "origin": one.name, **one.figures(felt)} for g, one in flown.front
        ],
        "g_weight": problem.weights.g,
        "weights": asdict(problem.weights),
        "starts": [
            {"sense": sense, "seat_deg": float(np.degrees(seat)), "cost": end.trajectory.merit,
             "reason": why, **found[end.found].figures(felt)}
            for (sense, seat), end, why in zip(starts, search.ends, why_above, strict=False)
        ],
        "reachable_g": reached.g,
        "beyond_reach_s": reached.beyond,
        "objective": objective(best),
        "interrupted": search.interrupted,
    }  # fmt: skip


def _check(robot: Robot, knot: float, approach: float) -> None:
    """Refuse options and robots without a solution."""
    check_program(robot, knot, INTERPOLATION_PERIOD)
    whole_periods(approach, INTERPOLATION_PERIOD, "approach")


def _problem_of(
    robot: Robot, flight: Flight, ends: tuple[float, float], idle_g: float | None,
    knot: float, torque_margin: float, model: PerceptionModel, weights: Weights,
) -> Problem:  # fmt: skip
    """Return the flight at knots, with approach and departure, and the limits of the robot."""
    approach, departure = ends
    count = 2 * math.ceil((approach + flight.duration + departure) / (2 * knot) - 1e-9) + 1
    time = knot * np.arange(float(count)) - approach
    force, rate = flight.means(time, knot)
    flies = (time > -1e-9) & (time < flight.duration + 1e-9)
    weight = np.repeat(np.where(flies, 1.0, _WEIGHT_BESIDE)[:, None], 2, axis=1)
    if idle_g is not None:
        idles = (time > -approach / 2) & (time < flight.duration + departure / 2) & ~flies
        weight[idles, 0] = 1.0
        size = np.linalg.norm(force[~flies], axis=1, keepdims=True)
        force[~flies] *= idle_g * GRAVITY / np.maximum(size, 1e-3)
    head = np.hstack([force, rate])
    return Problem(
        robot=robot, model=model, knot=knot, head=head,
        felt=felt(model, followed(model, head, knot), head), weight=weight, weights=weights,
        torque_share=torque_margin, lower=robot.position_lower, upper=robot.position_upper,
        arm=has_arm(robot),
    )  # fmt: skip


def _still(problem: Problem, flight: Flight, in_flight: Percept | None) -> Trajectory:
    """Return the device at rest, tilted such that gravity is felt as it is on average in flight."""
    up = flight.specific_force if in_flight is None else -in_flight.gravity
    mean = up.mean(axis=0)
    posture = standing(problem, mean / max(float(np.linalg.norm(mean)), 1e-9))
    if problem.arm:
        posture[0] = 0.0
    rest = np.zeros((problem.count, problem.robot.n))
    return Trajectory(problem.knot, posture + rest, rest, rest)
