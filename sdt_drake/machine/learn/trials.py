"""Flights of a simulated device, each with the reference learned from earlier ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from sdt_drake.analysis.tracking import motor_use, track_head
from sdt_drake.io.arrays import Array
from sdt_drake.io.deprecated import renamed
from sdt_drake.io.errors import InputError
from sdt_drake.io.shown import Shown, Summary, formatted
from sdt_drake.machine.diagnose import constants as c
from sdt_drake.machine.learn.filter import LearningFilter
from sdt_drake.motion import LearnedReference, Motion
from sdt_drake.pilot.head import has_head
from sdt_drake.robot.motors import as_driven
from sdt_drake.run.design import Design
from sdt_drake.run.simulate import simulate

_HALVINGS = 12  # in the search for the largest share of a step


@dataclass(frozen=True, eq=False)
class Trial:
    """The result of a trial: one flight of the motion."""

    number: int
    """Number of the trial, from 1; the first one follows the planned motion."""
    learned: LearnedReference
    """Learned reference that was flown."""
    error: Array
    """Position error of the links (achieved minus planned), joint side [rad], shape (N + 1, n)."""
    seen: Array
    """Position error at the encoders, from which is learned [rad], shape (N + 1, n)."""
    largest: Array
    """Largest |error| [rad], shape (n,)."""
    rms: Array
    """RMS of the error [rad], shape (n,)."""
    felt: float
    """Share of time in which the error can be felt [-]; NaN without a head."""
    peak: Array
    """Largest motor torque over the available torque [-], shape (n,)."""
    saturated: Array
    """Share of time in which a motor is at its torque limit [-], shape (n,)."""

    @property
    def score(self) -> float:
        """RMS error of all joints [rad]; less is better."""
        return float(np.sqrt(np.mean(self.rms**2)))


def run_trial(design: Design, number: int) -> Trial:
    """Simulate a design and return the result as a trial."""
    recording, planned = simulate(design), design.reference.planned.q
    error = recording.q - planned
    felt = (
        track_head(recording, design.device.simulated).felt.share
        if has_head(design.device.simulated)
        else np.nan
    )
    return Trial(
        number=number,
        learned=LearnedReference(design.reference.tracked, design.reference.torque),
        error=error,
        seen=error if recording.q_measured is None else recording.q_measured - planned,
        largest=np.abs(error).max(axis=0),
        rms=np.sqrt(np.mean(error**2, axis=0)),
        felt=felt,
        peak=motor_use(recording, design.device.simulated).peak_share,
        saturated=recording.saturated[1:].mean(axis=0),
    )


class Step(NamedTuple):
    """A learning step from one trial to the next."""

    learned: LearnedReference
    """Learned reference of the next trial."""
    share: float
    """Share of the full step that the limits allow [-]; 1 for torques, which are clipped."""
    limit: str
    """Limit that prevents the full step; "" for none."""

    @property
    def note(self) -> str:
        """Note on a reduced step and its limit; "" for a full step."""
        if self.share < 1:
            return f"step reduced to {int(100 * self.share)} %: {self.limit}"
        return f"torque clipped: {self.limit}" if self.limit else ""


def next_step(design: Design, filter_: LearningFilter, error: Array) -> Step:
    """Return the learning step to the next trial, reduced until it is within the limits.

    Args:
        design: design of the trial.
        filter_: learning filter for its loop.
        error: position error at the encoders (achieved minus planned) [rad], shape (N + 1, n).
    """
    if filter_.of == "torque":
        before = (
            np.zeros_like(error) if design.reference.torque is None else design.reference.torque
        )
        return _torque_step(design, filter_.next(before, error))
    before = design.reference.tracked.q - design.reference.planned.q
    change = filter_.next(before, error) - before

    scenario = design.scenario

    def part(share: float) -> LearnedReference:
        """Return the reference with a share of the step; InputError beyond a limit."""
        motion = _beside(design.reference.planned, before + share * change, filter_)
        learned = LearnedReference(motion, design.reference.torque)
        learned.check(
            design.reference.planned, design.device.nominal, torque_margin=scenario.torque_margin
        )
        return learned

    step = Step(LearnedReference(design.reference.tracked, design.reference.torque), 0.0, "")
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


def _beside(planned: Motion, change: Array, filter_: LearningFilter) -> Motion:
    """Return a motion with a change of positions [rad] that starts at 0 and ends at rest."""
    ends = np.vstack([change[:1], change, change[-1:]])
    speed = (ends[2:] - ends[:-2]) / (2 * planned.period)
    speed[0] = 0.0
    speed *= filter_.onset(len(change))[::-1]
    return Motion.from_speeds(planned.period, planned.q[0], planned.v + speed)


def _torque_step(design: Design, torque: Array) -> Step:
    """Return the step to a learned torque, motor side [N m], clipped to the available torque."""
    robot = as_driven(design.device.nominal, design.scenario.drive)
    available = robot.torque_range(design.reference.tracked.v, design.scenario.torque_margin)
    least, most = (limit / robot.gear_ratio for limit in available)
    within, limit = np.clip(torque, least, most), ""
    if np.any(within != torque):
        i, k = np.argwhere(within != torque)[0]
        limit = (
            f"joint {k + 1} at {design.reference.tracked.time[i]:.3f} s: {torque[i, k]:.6g} N m, "
            f"motor side, available {least[i, k]:.6g} to {most[i, k]:.6g} N m"
        )
    return Step(LearnedReference(design.reference.tracked, within), 1.0, limit)


def learn(
    design: Design,
    filter_: LearningFilter,
    count: int,
    *,
    stops: bool = True,
    report: Callable[[LearningResult], None] = lambda result: None,
) -> LearningResult:
    """Simulate trials and learn from each for the next.

    Args:
        design: design of the first trial, with an earlier learned reference if there is one.
        filter_: learning filter for its loop.
        count: maximum number of trials.
        stops: whether to stop by `reason_to_stop`.
        report: callback after each trial, with all trials so far.
    """
    result = LearningResult((run_trial(design, 1),), (), "")
    while True:
        report(result)
        trials, steps = result.trials, result.steps
        reason = reason_to_stop(trials, steps) if stops else ""
        if reason or len(trials) >= count:
            return replace(result, reason=reason)
        step = next_step(design, filter_, trials[-1].seen)
        design = design.given(step.learned)
        trial = run_trial(design, len(trials) + 1)
        result = LearningResult((*trials, trial), (*steps, step), "")


def reason_to_stop(trials: Sequence[Trial], steps: Sequence[Step]) -> str:
    """Return the reason why another trial would not help; "" if it would."""
    last = trials[-1]
    if last.felt == 0:
        return "the remaining error cannot be felt"
    if len(trials) > 1:
        best = min(trial.score for trial in trials[:-1])
        if last.score > best:
            return "the error has grown; the reference of the best flight is kept"
        if last.score > (1 - c.MIN_GAIN) * best:
            return f"the last flight reduced the error by less than {100 * c.MIN_GAIN:g} %"
    if steps and steps[-1].share < c.MIN_STEP:
        return f"a limit is near: {steps[-1].limit}"
    return ""


@dataclass(frozen=True, eq=False, repr=False)
class LearningResult(Shown):
    """A series of trials with the learning steps between them."""

    trials: tuple[Trial, ...]
    """Flights in their order."""
    steps: tuple[Step, ...]
    """Steps to each trial but the first."""
    reason: str
    """Reason for stopping before the maximum number of trials; "" if none."""

    @property
    def flights(self) -> tuple[Trial, ...]:
        """`trials`, under the name that goes in 0.7."""
        renamed("flights", "trials")
        return self.trials

    def summary(self) -> Summary:
        rows = [
            [f"{one.number}", f"{np.degrees(one.largest.max()):.4f}",
             f"{np.degrees(one.score):.5f}", formatted(100 * one.felt, ".1f")]
            for one in self.trials
        ]  # fmt: skip
        header = ("flight", "largest error [deg]", "RMS error [deg]", "felt [% of time]")
        end = f", stopped: {self.reason}" if self.reason else ""
        return Summary(f"of {len(rows)} flight(s), best: {self.best.number}{end}", header, rows)

    @property
    def best(self) -> Trial:
        """The trial with the least error."""
        return min(self.trials, key=lambda trial: trial.score)
