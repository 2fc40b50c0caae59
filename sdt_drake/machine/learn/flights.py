"""Flights of a simulated device, each with what the ones before have taught."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from sdt_drake.analysis.tracking import motor_use, track_head
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.shown import Shown, Summary, formatted
from sdt_drake.machine.learn.filter import LearningFilter
from sdt_drake.motion import LearnedReference, Motion
from sdt_drake.robot.head import has_head
from sdt_drake.robot.motors import as_driven
from sdt_drake.run.design import Design
from sdt_drake.run.simulate import simulate

_HALVINGS = 12  # until the share of a step is found
_GAIN = 0.05  # of the error, which a flight must take off for another one
_NEAR = 0.5  # of a step; where no more of it is left a limit is near


@dataclass(frozen=True, eq=False)
class Flight:
    """What came of a flight.

    Attributes:
        number: from 1, which is of the planned motion.
        learned: what it was given.
        error: achieved less wanted positions, of links, joint side [rad], shape (N + 1, n).
        seen: the same as the encoders see it, which is what is learned from [rad].
        largest: |error| [rad], shape (n,).
        rms: of the error [rad], shape (n,).
        felt: share of time in which the error could be felt [-]; NaN without a head.
        peak: largest torque of the motors over what they can give [-], shape (n,).
        saturated: share of the time in which a motor gives less than is asked [-], shape (n,).
    """

    number: int
    learned: LearnedReference
    error: Array
    seen: Array
    largest: Array
    rms: Array
    felt: float
    peak: Array
    saturated: Array

    @property
    def score(self) -> float:
        """RMS error of all joints [rad]: less is better."""
        return float(np.sqrt(np.mean(self.rms**2)))


def fly(design: Design, number: int) -> Flight:
    """Run a design along its motion."""
    recording, wanted = simulate(design), design.wanted.q
    error = recording.q - wanted
    felt = track_head(recording, design.robot).felt.share if has_head(design.robot) else np.nan
    return Flight(
        number=number,
        learned=LearnedReference(design.motion, design.learned_torque),
        error=error,
        seen=error if recording.q_measured is None else recording.q_measured - wanted,
        largest=np.abs(error).max(axis=0),
        rms=np.sqrt(np.mean(error**2, axis=0)),
        felt=felt,
        peak=motor_use(recording, design.robot).peak_share,
        saturated=recording.saturated[1:].mean(axis=0),
    )


class Step(NamedTuple):
    """What is learned from one flight for the next.

    Attributes:
        learned: what the next one gets.
        share: of the step that is taken [-]; torques are cut off instead.
        limit: which is in the way of all of it; "" for none.
    """

    learned: LearnedReference
    share: float
    limit: str

    @property
    def note(self) -> str:
        """What was not taken of it, and why; "" for nothing."""
        if self.share < 1:
            return f"scaled back to {int(100 * self.share)} % of the step, {self.limit}"
        return f"torque cut off, {self.limit}" if self.limit else ""


def next_step(design: Design, filter_: LearningFilter, error: Array) -> Step:
    """What the next flight gets, as much of it as keeps the planner's limits.

    Args:
        design: of the flight.
        filter_: for its loop.
        error: achieved less wanted positions, as the encoders see them [rad], shape (N + 1, n).
    """
    if filter_.of == "torque":
        before = np.zeros_like(error) if design.learned_torque is None else design.learned_torque
        return _torque_step(design, filter_.next(before, error))
    before = design.motion.q - design.wanted.q
    change = filter_.next(before, error) - before

    scenario = design.scenario

    def part(share: float) -> LearnedReference:
        """With a share of the step, where that is within all limits."""
        motion = _beside(design.wanted, before + share * change, filter_)
        learned = LearnedReference(motion, design.learned_torque)
        learned.check(design.wanted, design.nominal, torque_margin=scenario.torque_margin)
        return learned

    step = Step(LearnedReference(design.motion, design.learned_torque), 0.0, "")
    share, high = 1.0, 1.0
    for _ in range(1 + _HALVINGS):
        try:
            step = step._replace(learned=part(share), share=share)
        except InputError as problem:
            step, high = step._replace(limit=step.limit or str(problem)), share
        if step.share == 1:
            break
        share = (step.share + high) / 2
    return step


def _beside(wanted: Motion, change: Array, filter_: LearningFilter) -> Motion:
    """A motion with a change of its positions [rad] that starts at 0 and ends at rest."""
    ends = np.vstack([change[:1], change, change[-1:]])
    speed = (ends[2:] - ends[:-2]) / (2 * wanted.period)
    speed[0] = 0.0
    speed *= filter_.onset(len(change))[::-1]
    return Motion.from_speeds(wanted.period, wanted.q[0], wanted.v + speed)


def _torque_step(design: Design, torque: Array) -> Step:
    """A torque [N m], motor side, cut off where a motor has no more."""
    robot = as_driven(design.nominal, design.scenario.drive)
    available = robot.torque_range(design.motion.v, design.scenario.torque_margin)
    least, most = (limit / robot.gear_ratio for limit in available)
    within, limit = np.clip(torque, least, most), ""
    if np.any(within != torque):
        i, k = np.argwhere(within != torque)[0]
        limit = (
            f"joint {k + 1} at {design.motion.time[i]:.3f} s: {torque[i, k]:.6g} N m, motor side, "
            f"available {least[i, k]:.6g} to {most[i, k]:.6g} N m"
        )
    return Step(LearnedReference(design.motion, within), 1.0, limit)


def learn(
    design: Design,
    filter_: LearningFilter,
    count: int,
    *,
    stops: bool = True,
    report: Callable[[Lessons], None] = lambda lessons: None,
) -> Lessons:
    """Fly, learn, fly again.

    Args:
        design: of the first flight, with what was learned before, if anything.
        filter_: for its loop.
        count: of flights, at most.
        stops: whether to stop where another flight is not worth it; see `reason_to_stop`.
        report: called after each flight, with all so far.
    """
    lessons = Lessons((fly(design, 1),), (), "")
    while True:
        report(lessons)
        flights, steps = lessons.flights, lessons.steps
        reason = reason_to_stop(flights, steps) if stops else ""
        if reason or len(flights) >= count:
            return replace(lessons, reason=reason)
        step = next_step(design, filter_, flights[-1].seen)
        design = design.given(step.learned)
        flight = fly(design, len(flights) + 1)
        lessons = Lessons((*flights, flight), (*steps, step), "")


def reason_to_stop(flights: Sequence[Flight], steps: Sequence[Step]) -> str:
    """Why another flight is not worth it; "" if it is."""
    last = flights[-1]
    if last.felt == 0:
        return "nobody feels what is left of the error"
    if len(flights) > 1:
        best = min(flight.score for flight in flights[:-1])
        if last.score > best:
            return "the error has grown; what the best flight had is kept"
        if last.score > (1 - _GAIN) * best:
            return f"the last flight took less than {100 * _GAIN:g} % off the error"
    if steps and steps[-1].share < _NEAR:
        return f"a limit is near: {steps[-1].limit}"
    return ""


@dataclass(frozen=True, eq=False, repr=False)
class Lessons(Shown):
    """Flights one after the other, and what was learned.

    Attributes:
        flights: in their order.
        steps: to each flight but the first.
        reason: why they ended before their count; "" if they did not.
    """

    flights: tuple[Flight, ...]
    steps: tuple[Step, ...]
    reason: str

    def summary(self) -> Summary:
        rows = [
            [
                f"{flight.number}",
                f"{np.degrees(flight.largest.max()):.4f}",
                f"{np.degrees(flight.score):.5f}",
                formatted(100 * flight.felt, ".1f"),
            ]
            for flight in self.flights
        ]
        header = ("flight", "largest error [deg]", "RMS error [deg]", "felt [% of time]")
        end = f", stopped: {self.reason}" if self.reason else ""
        return Summary(f"of {len(rows)} flight(s), best: {self.best.number}{end}", header, rows)

    @property
    def best(self) -> Flight:
        """The flight with the least error."""
        return min(self.flights, key=lambda flight: flight.score)
