"""A search from several starts and by several weights that keeps all it finds."""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.machine.cueing.problem import Problem, Trajectory
from sdt_drake.machine.cueing.program import MAX_STEPS, fitted, rated, solve
from sdt_drake.motion.plan import INTERPOLATION_PERIOD
from sdt_drake.motion.retiming import torque_of_periods
from sdt_drake.motion.trajectory import Motion
from sdt_drake.robot.robot import Robot

Errors = tuple[float, ...]
"""Errors of a motion; smaller ones are better."""

_POLISHES, _POLISH_STEPS = 8, 8
_ALLOWED = 0.002  # torque between knots that may exceed the limit, over the limit
_AIMED = 0.003  # distance from the limits to aim at
_SHRUNK = (0.99, 0.97, 0.95, 0.9, 0.8, 0.6, 0.4, 0.2)  # shares of a motion


class Search:
    """A search that keeps all motions within the limits that it finds, also on an interrupt.

    Args:
        problem: The flight and the device.
        rest: The device at rest.
        report: Function of the completed share of the work.
        count: Number of searches in the work.
    """

    def __init__(
        self, problem: Problem, rest: Trajectory, report: Callable[[float], None], count: int
    ) -> None:
        self._problem, self._rest, self._report, self._count = problem, rest, report, count
        self._rough = replace(
            problem, knot=2 * problem.knot,
            **{name: getattr(problem, name)[::2] for name in ("head", "felt", "weight")},
        )  # fmt: skip
        self._done = self.started = 0
        self._unfinished: list[Trajectory] = []
        self.found: list[tuple[float, Trajectory]] = [(0.0, rest)]
        """Factors on the weight of the G error, and motions within the limits. The first is at
        rest, those of the starts come next."""
        self.interrupted = False

    def run(self, starts: Sequence[Array]) -> None:
        """Search from the angles of each start, with twice the time between knots."""
        with self._keeping():
            for q in starts:
                self._unfinished = [fitted(self._rough, q)]
                self._solve(self._rough, self._unfinished)
                within = self._polished(self._rough, self._unfinished)
                self.found.append((1.0, rated(self._problem, within.refined())))
                self.started += 1

    def offer(self, trajectory: Trajectory) -> None:
        """Add a motion to those found, if it keeps the limits."""
        if _keeps(self._problem, trajectory):
            self.found.append((1.0, rated(self._problem, trajectory)))

    def find(self, factor: float) -> int:
        """Find a motion with `Weights.times` of a factor, and return its index.

        The search starts from the motion of all known ones that has the smallest cost. After an
        interrupt that motion alone is changed to keep the limits.
        """
        problem = replace(self._problem, weights=self._problem.weights.times(factor))
        known = [one for _, one in self.found]
        if self.interrupted and self._unfinished:
            known += [
                one if one.knot == problem.knot else one.refined() for one in self._unfinished
            ]
        self._unfinished = [min((rated(problem, one) for one in known), key=lambda x: x.merit)]
        if not self.interrupted:
            with self._keeping():
                self._solve(problem, self._unfinished)
        self.found.append((factor, self._polished(problem, self._unfinished)))
        self._unfinished = []
        return len(self.found) - 1

    def without_torque_limits(self, index: int) -> Trajectory | None:
        """Find a motion near a found one without limits of torque; None if interrupted."""
        problem = replace(self._problem, torque_share=math.inf)
        found = [rated(problem, self.found[index][1])]
        if not self.interrupted:
            with self._keeping():
                self._solve(problem, found)
        return None if self.interrupted else found[0]

    def _polished(self, problem: Problem, found: list[Trajectory]) -> Trajectory:
        """Return the last trajectory of a list, changed to keep the limits between knots."""
        with self._keeping():
            for _ in range(_POLISHES):
                shift = _shift(problem, found[-1])
                if shift is None:
                    break
                problem = replace(problem, shift=shift)
                solve(
                    problem, found[-1], lambda best, _: found.__setitem__(-1, best), _POLISH_STEPS
                )
        return shrunk(problem, found[-1], self._rest.q[0])

    def _solve(self, problem: Problem, found: list[Trajectory], max_steps: int = MAX_STEPS) -> None:
        """Improve the last trajectory of a list in its place."""

        def watch(best: Trajectory, done: float) -> None:
            found[-1] = best
            self._report(min((self._done + done * (max_steps == MAX_STEPS)) / self._count, 1.0))

        solve(problem, found[-1], watch, max_steps)
        self._done += max_steps == MAX_STEPS

    @contextmanager
    def _keeping(self) -> Iterator[None]:
        """Keep the results when an interrupt ends the work in the block."""
        try:
            yield
        except KeyboardInterrupt:
            self.interrupted = True


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
    torque = np.vstack(torque_of_periods(robot, motion))
    share = min(torque_share * (1 + _ALLOWED), 1.0)
    low, high = robot.torque_range(np.vstack([motion.v[:-1], motion.v[1:]]), share)
    return bool(np.all((torque <= high) & (torque >= low)))


def _keeps(problem: Problem, trajectory: Trajectory) -> bool:
    motion = trajectory.motion(INTERPOLATION_PERIOD)
    return is_within(problem.robot, motion, problem.torque_share)


def shrunk(problem: Problem, trajectory: Trajectory, posture: Array) -> Trajectory:
    """Return a motion within the limits: the given one, or the largest tried share of it.

    The share of nothing is the device at rest in a posture [rad], shape (n,).
    """
    one, shares = trajectory, iter(_SHRUNK)
    while not _keeps(problem, one):
        share = next(shares, 0.0)
        q = posture + share * (trajectory.q - posture)
        one = Trajectory(trajectory.knot, q, share * trajectory.v, share * trajectory.a)
        if share == 0:
            break
    return rated(problem, one)


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
