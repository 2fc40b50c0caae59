"""A search from several starts and by several weights that keeps all it finds."""

import math
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.machine.cueing.problem import Problem, Trajectory, torque_and_speed
from sdt_drake.machine.cueing.program import fitted, rated, solve
from sdt_drake.motion.trajectory import Motion
from sdt_drake.robot.robot import Robot

Released = Callable[[], AbstractContextManager[None]]
"""Maker of a context in which interrupts arrive; they are held off elsewhere."""

Errors = tuple[float, ...]
"""Errors of a motion; smaller ones are better."""

START, SEARCH = "end of a start", "search"
"""Origins of motions: the search with twice the time between knots, and that by a weight."""

_POLISHES, _POLISH_STEPS = 8, 8
_ALLOWED = 0.002  # torque between knots that may exceed the limit, over the limit
_AIMED = 0.003  # distance from the limits to aim at
_NEAR_COST = 1.03  # over the best cost
_SAME = 1e-4  # difference of costs of mirror images, over the cost
_SHRUNK = (0.99, 0.97, 0.95, 0.9, 0.8, 0.6, 0.4, 0.2)  # shares of a motion


@dataclass(frozen=True, eq=False)
class Ended:
    """The end of a search from one start."""

    start: Trajectory
    """The start, with twice the time between knots."""
    trajectory: Trajectory
    """The end, whose limits hold at knots alone."""
    found: int
    """Index in `Search.found` of the motion that keeps the limits, made of it."""


class Search:
    """A search that keeps all motions within the limits that it finds, also on an interrupt.

    Args:
        problem: The flight and the device.
        rest: The device at rest.
        report: Function of the completed share of the work.
        count: Number of searches in the work.
        released: Maker of contexts in which interrupts arrive.
    """

    def __init__(
        self, problem: Problem, rest: Trajectory, report: Callable[[float], None], count: int,
        released: Released = nullcontext,
    ) -> None:  # fmt: skip
        self._problem, self._rest, self._report, self._count = problem, rest, report, count
        self._released = released
        self._rough = replace(
            problem, knot=2 * problem.knot,
            **{name: getattr(problem, name)[::2] for name in ("head", "felt", "weight")},
        )  # fmt: skip
        self._done = 0
        self._unfinished: list[Trajectory] = []
        self._searched: dict[int, float] = {}  # factors by index of `found`
        self.ends: list[Ended] = []
        """Ends of the search from the starts, without an interrupted one."""
        self.found: list[tuple[str, float, Trajectory]] = [("at rest", 0.0, rest)]
        """Origins, factors on the weight of the G error, and motions within the limits. The first
        is at rest."""
        self.interrupted = False

    def run(self, starts: Sequence[Array]) -> None:
        """Search from the angles of each start, with twice the time between knots.

        A start of the same cost as one before is its mirror image, and gives the same end.
        """

        def search(q: Array) -> None:
            begun = rated(self._rough, fitted(self._rough, q))
            twins = (x for x in self.ends if abs(x.start.merit / begun.merit - 1) < _SAME)
            ended = next(twins, None)
            if ended is None:
                self._unfinished = [begun]
                self._solve(self._rough, self._unfinished)
                ended = Ended(begun, self._unfinished[0], len(self.found))
                within = self._polished(self._rough, self._unfinished)
                self.found.append((START, 1.0, rated(self._problem, within.refined())))
            self.ends.append(ended)

        for q in starts:
            if not self.interrupted:
                self.keep(partial(search, q))

    def offer(self, name: str, trajectory: Trajectory) -> None:
        """Add a baseline to the motions found, if it keeps the limits."""
        one = rated(self._problem, trajectory)
        if _keeps(self._problem, one):
            self.found.append((name, math.nan, one))

    def find(self, factor: float) -> int:
        """Find a motion with `Weights.times` of a factor, and return its index.

        The search starts from the motion of all known ones that has the smallest cost; one that was
        found by this factor is returned. After an interrupt it is only made to keep the limits.
        """
        problem = replace(self._problem, weights=self._problem.weights.times(factor))
        known = [one for _, _, one in self.found]
        if self.interrupted and self._unfinished:
            known += [
                one if one.knot == problem.knot else one.refined() for one in self._unfinished
            ]
        costs = [rated(problem, one).merit for one in known]
        best = int(np.argmin(costs))
        if self._searched.get(best) != factor:
            self._unfinished = [rated(problem, known[best])]
            if not self.interrupted:
                self.keep(lambda: self._solve(problem, self._unfinished))
            best = len(self.found)
            self._searched[best] = factor
            self.found.append((SEARCH, factor, self._polished(problem, self._unfinished)))
            self._unfinished = []
        return best

    def without_torque_limits(self, index: int) -> Trajectory | None:
        """Find a motion near a found one without limits of torque; None if interrupted."""
        problem = replace(self._problem, torque_share=math.inf)
        found = [rated(problem, self.found[index][-1])]
        if not self.interrupted:
            self.keep(lambda: self._solve(problem, found))
        return None if self.interrupted else found[0]

    def _polished(self, problem: Problem, found: list[Trajectory]) -> Trajectory:
        """Return the last trajectory of a list, changed to keep the limits between knots."""

        def keep_limits() -> None:
            shifted = problem
            for _ in range(_POLISHES):
                shift = _shift(shifted, found[-1])
                if shift is None:
                    break
                shifted = replace(problem, shift=shift)
                solve(
                    shifted, found[-1], lambda best, _: found.__setitem__(-1, best), _POLISH_STEPS
                )

        self.keep(keep_limits)
        return shrunk(problem, found[-1], self._rest.q[0])

    def _solve(self, problem: Problem, found: list[Trajectory]) -> None:
        """Improve the last trajectory of a list in its place."""

        def watch(best: Trajectory, done: float) -> None:
            found[-1] = best
            self._report(min((self._done + done) / self._count, 1.0))

        solve(problem, found[-1], watch)
        self._done += 1

    def keep(self, work: Callable[[], None]) -> None:
        """Do work that an interrupt may end; what it has found so far is kept."""
        try:
            with self._released():
                work()
        except KeyboardInterrupt:
            self.interrupted = True


def reasons(arm: bool, ends: Sequence[Ended]) -> list[str]:
    """Say why each end costs more than the best, beside the nearest of the best ends.

    Args:
        arm: See `Problem.arm`.
        ends: The ends; those up to 3 percent above the best have "".
    """
    all_ends = [one.trajectory for one in ends]
    most = _NEAR_COST * min((one.merit for one in all_ends), default=0.0)
    best = [one for one in all_ends if one.merit <= most]
    return [min(_apart(arm, x, y) for y in best)[1] if x.merit > most else "" for x in all_ends]


def _apart(arm: bool, one: Trajectory, other: Trajectory) -> tuple[float, str]:
    """Return how far two trajectories are apart [deg], also in words."""
    if arm and np.sign(one.q[-1, 0] - one.q[0, 0]) != np.sign(other.q[-1, 0] - other.q[0, 0]):
        return 360.0, "the arm turns the other way"
    turned = np.abs(np.angle(np.exp(1j * (one.q - other.q)))) * (np.arange(one.q.shape[1]) >= arm)
    off = np.degrees(np.sqrt((turned**2).mean(axis=0)))
    return float(off.max()), f"joint {off.argmax() + 1} is turned by {off.max():.0f} deg"


def unexcelled(errors: Sequence[Errors]) -> list[int]:
    """Return the indices of errors that no others excel, in increasing order of the errors.

    Errors excel others if none of them is larger, and one is smaller. Of equal ones, the first
    is returned.
    """
    ordered = sorted(range(len(errors)), key=errors.__getitem__)
    kept: list[int] = []
    for k in ordered:
        own = np.array(errors[k])
        if not any(np.all(np.array(errors[j]) <= own) for j in kept):
            kept.append(k)
    return kept


def is_within(robot: Robot, motion: Motion, torque_share: float) -> bool:
    """Check if a motion keeps speeds, stops, and torque limits at both ends of every period."""
    beyond = (motion.q > robot.position_upper) | (motion.q < robot.position_lower)
    if np.any(beyond) or np.any(np.abs(motion.v) > robot.top_speed):
        return False
    torque, speed = torque_and_speed(robot, motion)
    low, high = robot.torque_range(speed, min(torque_share * (1 + _ALLOWED), 1.0))
    return bool(np.all((torque <= high) & (torque >= low)))


def _keeps(problem: Problem, trajectory: Trajectory) -> bool:
    return is_within(problem.robot, trajectory.motion, problem.torque_share)


def shrunk(problem: Problem, trajectory: Trajectory, posture: Array) -> Trajectory:
    """Return a motion within the limits: the given one, or the largest tried share of it.

    The share of nothing is the device at rest in a posture [rad], shape (n,).
    """
    one, shares = rated(problem, trajectory), iter(_SHRUNK)
    while not _keeps(problem, one):
        share = next(shares, 0.0)
        q = posture + share * (trajectory.q - posture)
        smaller = Trajectory(trajectory.knot, q, share * trajectory.v, share * trajectory.a)
        one = rated(problem, smaller)
        if share == 0:
            break
    return one


def _shift(problem: Problem, trajectory: Trajectory) -> Array | None:
    """Return the growth of the excess over limits between knots; None without any excess."""
    finer = trajectory.refined().refined().refined()
    over, _ = problem.excess(np.hstack(finer.parts))
    if over.max() <= _ALLOWED - _AIMED:
        return None
    around = np.pad(over, ((4, 4), (0, 0)), mode="edge")
    most = np.max([around[k : k + len(over) : 8] for k in range(9)], axis=0)
    with np.errstate(invalid="ignore"):  # of distances to limits that are infinite
        return np.nan_to_num(most - over[::8], nan=0.0) + _AIMED
