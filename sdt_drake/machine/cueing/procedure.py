"""Search for a motion of a device near a flight in force and felt rotation: `fly`."""

import math
import time as clock
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
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
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, within
from sdt_drake.io.progress import work
from sdt_drake.machine.cueing.alignment import Start, aligned, angles, washed_out
from sdt_drake.machine.cueing.candidate import Candidate, percept_of
from sdt_drake.machine.cueing.flight import Flight, FlightColumns, read_flight
from sdt_drake.machine.cueing.program import MAX_STEPS, Problem, Trajectory, fitted, rated, solve
from sdt_drake.machine.cueing.result import CueingResult
from sdt_drake.motion.plan import INTERPOLATION_PERIOD, checked_torque
from sdt_drake.motion.retiming import torque_of_periods
from sdt_drake.pilot.head import GRAVITY, check_head
from sdt_drake.pilot.observer import PerceptionModel, load_perception
from sdt_drake.robot.lacks import PLANNING
from sdt_drake.robot.robot import Robot, load_robot

SMOOTH = (1.0, 2.0)
"""Smoothing times of alignments [s]; the search starts from the first."""

_WEIGHT_BESIDE = 0.05  # weight of errors before and after the flight
_SEARCH_SHARE = 0.6  # share of the search in the work, with comparisons
_SENSED_PERIOD = 0.02  # sample period for the perception model [s]
_WASHED_SMOOTH = 0.2  # smoothing time of a washout [s]
_WEIGHINGS, _EXPONENT = 4, 3.0  # changes of the weight; weight over G error, as a power
_CHANGES = 0.1, 10.0  # factor of a change
_GOAL, _TOLERANCE = 0.97, 0.05  # G error to aim at, over that of alignment
_POLISHES, _POLISH_STEPS, _FRONT_STEPS = 5, 6, 10
_OVERSHOOT = 0.002  # torque between knots that may exceed the limit, over the limit
_MAX_TILT = 1e-6  # of a vertical axis [rad]


@dataclass(frozen=True)
class Effort:
    """The extent of the search for a motion."""

    seats: tuple[float, ...] = (0.0, np.pi / 2, -np.pi / 2)
    """First angles of the last joint [rad]; the search starts from each."""
    front: tuple[float, ...] = (0.1, 0.3, 3.0, 10.0)
    """Weights of the G error on the Pareto front over the chosen weight [-]."""
    g_weight: float = 1.5
    """First weight of the G error where none is given [-]."""


WHOLE = Effort()


def _columns(value: FlightColumns | str | Path, name: str) -> object:
    """Check columns of a flight: an object or a file."""
    return value if isinstance(value, FlightColumns) else a_path(value, name)


def _resultant(value: float, name: str) -> float:
    """Check a resultant before and after the flight [G]."""
    if not 1 <= finite_number(value, name) <= 10:
        raise InputError(f"{value:g} G, expected 1 to 10 G", place=name)
    return float(value)


@takes(
    columns=_columns, approach=positive, departure=positive, idle_g=_resultant, knot=positive,
    torque_margin=share, g_weight=positive, effort=instance_of(Effort),
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
    g_weight: float | None = None,
    perception: str | PerceptionModel = "slow_yaw",
    compare: bool = True,
    effort: Effort = WHOLE,
) -> CueingResult:
    """Search for a motion of a device whose force and felt rotation come near those of a flight.

        >>> import numpy as np, sdt_drake as sdt
        >>> from sdt_drake.machine.cueing.flight import make_flight
        >>> time = np.arange(0, 2.01, 0.05)
        >>> pull = 1 + 0.1 * np.sin(np.pi * time / 2) ** 2  # G
        >>> flight = make_flight(time, np.outer(pull, [0, 0, 9.81]), np.zeros((41, 3)))
        >>> quick = {"approach": 1, "departure": 1, "knot": 0.5, "compare": False}
        >>> flown = sdt.fly("sdt", flight, **quick)
        >>> chosen, alignment, *_ = flown.candidates
        >>> print(chosen.felt_rotation < 0.5 * alignment.felt_rotation)
        True
        >>> flown.motion.to_csv("motion.csv")

    `sdt.fly("sdt", "turn.csv")` reads a recording. `print(flown)` compares the candidates.

    The same input gives the same motion. An interrupt (Ctrl-C) ends the search. The best motion so
    far is then changed to keep the limits.

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
        g_weight: Weight of the G error over that of the felt rotation error [-]. A larger weight
            gives a smaller G error. By default 1.5, changed if alignment has a smaller error.
        perception: Perception model for the felt vertical, or its name.
        compare: True to find the motion without limits of torque and the Pareto front, too.
        effort: Starts of the search, weights of the Pareto front, and the first weight.

    Raises:
        InputError: The flight or the device cannot be used, or no motion keeps the limits.
    """
    robot = robot if isinstance(robot, Robot) else load_robot(robot)
    flight = flight if isinstance(flight, Flight) else read_flight(flight, columns)
    model = perception if isinstance(perception, PerceptionModel) else load_perception(perception)
    _check(robot, knot, approach)
    began = clock.process_time()
    ends = (approach, departure)
    weight = g_weight or effort.g_weight
    problem = _problem_of(robot, flight, ends, idle_g, knot, torque_margin, weight)
    rough = replace(problem, knot=2 * knot, **{
        name: getattr(problem, name)[::2] for name in ("force", "rate", "weight")
    })  # fmt: skip
    candidate = partial(Candidate, robot=robot, flight=flight, starts_at=approach, model=model)
    every = np.linspace(0.0, flight.duration, math.ceil(flight.duration / _SENSED_PERIOD) + 1)
    felt = percept_of(model, every, *flight.at(every))

    def shown(name: str, trajectory: Trajectory) -> Candidate:
        return candidate(name, motion=trajectory.motion(INTERPOLATION_PERIOD))

    with work() as report:
        senses = (1, -1) if problem.arm else (1,)
        starts = [(sense, seat) for sense in senses for seat in effort.seats]
        x = aligned(problem, starts)
        alignments = [
            shown(f"alignment, seat at {np.degrees(starts[k][1]):.0f} deg, smoothed {smooth:g} s",
                  fitted(problem, angles(problem, x[k], smooth, *ends)))
            for k in range(len(effort.seats)) for smooth in SMOOTH
        ]  # fmt: skip
        aligned_best = min(alignments, key=lambda one: one.felt_rotation)
        washout = fitted(problem, angles(problem, washed_out(problem, x[0]), _WASHED_SMOOTH, *ends))
        part = _SEARCH_SHARE if compare else 1.0
        search = _Search(lambda done: report(part * done), len(starts) + 1)
        search.run(rough, [angles(rough, one[::2], SMOOTH[0], *ends) for one in x])
        search.refine(problem)
        if g_weight is None:
            search.weigh(lambda trajectory: shown("", trajectory).beside(aligned_best))
        search.polish()
        problem, chosen = search.best
        cpu = clock.process_time() - began
        unlimited, front = None, [(1.0, chosen)]
        with search.keeping():
            if compare and not search.interrupted:
                free = replace(problem, torque_share=np.inf)
                unlimited = shown("without limits of torque", solve(free, chosen, lambda *_: None))
                for point in _front(problem, chosen, effort.front):
                    report(part + (1 - part) * len(front) / (len(effort.front) + 1))
                    front.append(point)
    best = shown("this motion", chosen)
    with within("no motion keeps the limits; the best one found"):
        checked_torque(robot, best.motion)
    points = tuple(
        (w, best if trajectory is chosen else shown(f"weight of G {w:g}", trajectory))
        for w, trajectory in sorted(front, key=lambda point: point[0])
    )
    washed = shown("classical washout", washout)
    numbers: dict[str, object] = {
        "flight": flight.name,
        "robot": robot.name,
        "flight_starts_at": approach,
        "flight_duration": flight.duration,
        **best.figures(felt),
        "torque_share_allowed": torque_margin,
        "perception": model.source,
        "perception_gains": {k: getattr(model, k) for k in ("k_w", "k_fw", "k_fg", "k_a")},
        "alignment": {"name": aligned_best.name, **aligned_best.figures(felt)},
        "washout": washed.figures(felt),
        "without_torque_limits": unlimited and unlimited.figures(felt),
        "front": [{"g_weight": w * problem.g_weight, **one.figures(None)} for w, one in points],
        "g_weight": problem.g_weight,
        "starts": search.ends(starts, shown),
        "interrupted": search.interrupted,
        "cpu_s": cpu,
    }
    return CueingResult(best, aligned_best, washed, unlimited, points, felt, numbers)


_Found = tuple[Problem, Trajectory]


class _Search:
    """A search from several starts that improves the best result and keeps it on an interrupt."""

    def __init__(self, report: Callable[[float], None], count: int) -> None:
        self._report, self._count = report, count
        self._ends: list[_Found] = []  # results of the starts
        self._later: list[_Found] = []  # improvements
        self.interrupted = False

    def run(self, problem: Problem, starts: Sequence[Array]) -> None:
        """Search from the angles of each start, shape (N, n)."""
        with self.keeping():
            for q in starts:
                self._improve(self._ends, problem, fitted(problem, q))
        if not self._ends:
            raise KeyboardInterrupt

    def refine(self, problem: Problem) -> None:
        """Improve the best trajectory with half the time between knots."""
        if self.interrupted:
            return
        with self.keeping():
            self._improve(self._later, problem, self.best[1].refined())

    def weigh(self, losses: Callable[[Trajectory], tuple[float, float]]) -> None:
        """Change the weight of the G error until neither error is larger than that of alignment.

        If both cannot be reached, the G error has priority.

        Args:
            losses: Function from a trajectory to its two errors over those of alignment [-].
        """
        for _ in range(_WEIGHINGS):
            if self.interrupted:
                return
            with self.keeping():
                problem, trajectory = self.best
                g, rotation = losses(trajectory)
                if g <= 1 and (rotation <= 1 or g >= _GOAL - _TOLERANCE):
                    return
                factor = np.clip((g / _GOAL) ** _EXPONENT, *_CHANGES)
                other = replace(problem, g_weight=float(factor) * problem.g_weight)
                self._improve(self._later, other, trajectory, _FRONT_STEPS)

    def polish(self) -> None:
        """Change the best trajectory to keep the limits between knots, also after an interrupt."""
        for _ in range(_POLISHES):
            with self.keeping():
                problem, trajectory = self.best
                tighter = _tightened(problem, trajectory)
                if tighter is None:
                    return
                self._improve(self._later, tighter, trajectory, _POLISH_STEPS)

    def _improve(
        self, found: list[_Found], problem: Problem, start: Trajectory, max_steps: int = MAX_STEPS
    ) -> None:
        """Append the trajectory that a search from `start` finds."""

        def watch(best: Trajectory, done: float) -> None:
            found[-1] = problem, best
            finished = len(self._ends) + len(self._later) - 1
            self._report(min((finished + done) / self._count, 1.0))

        found.append((problem, rated(problem, start)))
        solve(problem, start, watch, max_steps)

    @contextmanager
    def keeping(self) -> Iterator[None]:
        """Keep the results when an interrupt ends the work in the block."""
        try:
            yield
        except KeyboardInterrupt:
            self.interrupted = True

    @property
    def best(self) -> _Found:
        """The last improvement, or the best result of a start, with its problem."""
        return self._later[-1] if self._later else min(self._ends, key=lambda one: one[1].merit)

    def ends(self, starts: list[Start], shown: Callable[[str, Trajectory], Candidate]) -> object:
        """Return the result of each start."""
        rows = []
        for (sense, seat), (_, trajectory) in zip(starts, self._ends, strict=False):
            figures = shown("", trajectory).figures(None)
            kept = {k: figures[k] for k in ("g_error_rms", "felt_rotation_rms_deg_s")}
            seat_deg = float(np.degrees(seat))
            rows.append({"sense": sense, "seat_deg": seat_deg, "cost": trajectory.merit, **kept})
        return rows


def _check(robot: Robot, knot: float, approach: float) -> None:
    """Refuse options and robots without a solution."""
    check_head(robot.having(*PLANNING))
    if robot.n < 2:
        raise InputError(f"{robot.path}: 1 joint, expected at least 2")
    whole_periods(knot, INTERPOLATION_PERIOD, "knot")
    whole_periods(approach, INTERPOLATION_PERIOD, "approach")
    if knot > 1:
        raise InputError(f"{knot:g} s, expected at most 1 s", place="knot")


def _problem_of(
    robot: Robot, flight: Flight, ends: tuple[float, float], idle_g: float | None,
    knot: float, torque_margin: float, g_weight: float,
) -> Problem:  # fmt: skip
    """Return the flight at knots, with approach and departure, and the limits of the robot."""
    approach, departure = ends
    count = 2 * math.ceil((approach + flight.duration + departure) / (2 * knot) - 1e-9) + 1
    time = knot * np.arange(float(count)) - approach
    force, rate = flight.means(time, knot)
    flies = (time > -1e-9) & (time < flight.duration + 1e-9)
    weight = np.repeat(np.where(flies, 1.0, _WEIGHT_BESIDE)[:, None], 6, axis=1)
    if idle_g is not None:
        idles = (time > -approach / 2) & (time < flight.duration + departure / 2) & ~flies
        weight[idles, :3] = 1.0
        size = np.linalg.norm(force[~flies], axis=1, keepdims=True)
        force[~flies] *= idle_g * GRAVITY / np.maximum(size, 1e-3)
    axis, _ = robot.joint_at_zero(robot.joint_names[0])
    down = robot.plant.gravity_field().gravity_vector() / GRAVITY
    return Problem(
        robot=robot, knot=knot, force=force, rate=rate, weight=weight, g_weight=g_weight,
        torque_share=torque_margin, lower=robot.position_lower, upper=robot.position_upper,
        torque_less=np.zeros(robot.n),
        arm=bool(np.linalg.norm(np.cross(axis, down)) < _MAX_TILT),
    )  # fmt: skip


def _tightened(problem: Problem, trajectory: Trajectory) -> Problem | None:
    """Return the problem with limits tightened by their excess between knots; None for none."""
    robot, motion = problem.robot, trajectory.motion(INTERPOLATION_PERIOD)
    torque = np.vstack(torque_of_periods(robot, motion))
    share = min(problem.torque_share * (1 + _OVERSHOOT), 1.0)
    low, high = robot.torque_range(np.vstack([motion.v[:-1], motion.v[1:]]), share)
    over = np.maximum(np.maximum(torque - high, low - torque).max(axis=0), 0)
    beyond = np.maximum(motion.q - robot.position_upper, robot.position_lower - motion.q)
    past = np.maximum(beyond.max(axis=0), 0)
    if not over.any() and not past.any():
        return None
    return replace(
        problem,
        torque_less=problem.torque_less + 1.2 * over,
        lower=problem.lower + 1.2 * past,
        upper=problem.upper - 1.2 * past,
        penalty=10 * problem.penalty,
    )


def _front(
    problem: Problem, chosen: Trajectory, factors: Sequence[float]
) -> Iterator[tuple[float, Trajectory]]:
    """Yield trajectories with other weights of the G error, each found from its neighbour."""
    above = sorted(factor for factor in factors if factor > 1)
    below = sorted((factor for factor in factors if factor < 1), reverse=True)
    for side in (above, below):
        trajectory = chosen
        for factor in side:
            other = replace(problem, g_weight=factor * problem.g_weight)
            trajectory = solve(other, trajectory, lambda *_: None, _FRONT_STEPS)
            yield factor, trajectory
