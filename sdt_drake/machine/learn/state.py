"""The state of learning from recordings of a real machine, kept in a folder between trials.

The folder contains the scenario and two files for each trial, numbered from 1. They are its
reference (`reference_02.csv`; the first trial follows the planned motion) and its result
(`flight_01.yaml`, written last). Files are never changed. A learning process locks the folder.
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sdt_drake.io import fields
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.files import replacing_files
from sdt_drake.io.yaml_files import load_yaml, write_yaml
from sdt_drake.machine.diagnose import constants as c
from sdt_drake.machine.diagnose.finding import Finding, finding
from sdt_drake.machine.diagnose.spikes import without_spikes
from sdt_drake.machine.learn.filter import LearningFilter
from sdt_drake.machine.learn.matching import Matched, match
from sdt_drake.machine.learn.trials import Step, next_step
from sdt_drake.machine.recordings.recorded import Recorded, check_different
from sdt_drake.motion import LearnedReference, load_learned
from sdt_drake.run.design import Design
from sdt_drake.run.scenario import save_scenario

SCENARIO = "scenario.yaml"


@dataclass(frozen=True, kw_only=True)
class TrialRecord(fields.Input):
    """The result of a real trial from its recordings: one file in the folder of the learning."""

    reference: fields.Integer = fields.field(1, ge=1)
    """Number of the flown reference; 1 is the planned motion."""
    recordings: fields.Integer = fields.field(1, ge=1)
    """Number of recordings of the trial."""
    largest: fields.EachJoint[fields.NotNegative] = fields.field(unit="rad", side="joint")
    """Largest |error| of the recordings' mean."""
    rms: fields.EachJoint[fields.NotNegative] = fields.field(unit="rad", side="joint")
    """RMS error that repeats: that of the mean, less the remaining noise."""
    floor: fields.EachJointOrNone[fields.NotNegative] = fields.field((), unit="rad", side="joint")
    """RMS error that does not repeat; only with several recordings."""
    shifts: fields.Values[fields.Number] = fields.field((), unit="s")
    """Start of the motion in each recording."""

    @property
    def score(self) -> float:
        """RMS of the repeating error of all joints [rad]; less is better."""
        return math.sqrt(sum(x * x for x in self.rms) / max(1, len(self.rms)))

    def flown(self, folder: Path) -> Path | str:
        """Return "the planned motion", or the file of the flown reference in a folder."""
        is_planned = self.reference == 1
        return "the planned motion" if is_planned else reference_file(folder, self.reference)

    @property
    def noise(self) -> float:
        """RMS noise of the recordings' mean over all joints [rad]; 0 for a single recording."""
        mean = sum(x * x for x in self.floor) / max(1, len(self.floor))
        return math.sqrt(mean / self.recordings)


class State(NamedTuple):
    """The state of a learning: the trials so far, and the references that may be flown next."""

    trials: list[TrialRecord]
    """Results of the trials."""
    references: list[LearnedReference]
    """References of all trials and of the next one; the first is the planned motion."""

    @property
    def best(self) -> TrialRecord:
        """The trial with the smallest repeating error."""
        return min(self.trials, key=lambda trial: trial.score)


def read_state(folder: Path, design: Design) -> State:
    """Read the state of a learning from its folder, which may be empty.

    Raises:
        InputError: with the file, if it is missing or belongs to another motion.
    """
    references = [LearnedReference(design.reference.tracked, design.reference.torque)]
    trials: list[TrialRecord] = []
    for number in range(1, 1 + count_trials(folder)):
        file = trial_file(folder, number)
        trial, _ = load_yaml(TrialRecord, file)
        fields.check_joints(trial, file, design.device.simulated.n)
        if trial.reference > len(references):
            raise InputError(
                f"{file}: reference: {trial.reference}, expected 1 to {len(references)}"
            )
        trials.append(trial)
        path = reference_file(folder, number + 1)
        margin = design.scenario.torque_margin
        references.append(
            load_learned(
                path, design.reference.planned, design.device.nominal, torque_margin=margin
            )
        )
    return State(trials, references)


def count_trials(folder: Path) -> int:
    """Return the number of trials in a folder."""
    return next(i for i in itertools.count() if not trial_file(folder, i + 1).exists())


def trial_file(folder: Path, number: int) -> Path:
    """Return the path of a trial's result."""
    return folder / f"flight_{number:02d}.yaml"


def reference_file(folder: Path, number: int) -> Path:
    """Return the path of a trial's reference. The first trial has none: it is planned."""
    return folder / f"reference_{number:02d}.csv"


class Update(NamedTuple):
    """The result of learning from the recordings of a trial."""

    trial: TrialRecord
    """Result of the trial."""
    step: Step
    """Learning step to the next trial."""
    findings: list[Finding]
    """Findings in the recordings, and assumptions."""


def update(
    design: Design,
    filter_: LearningFilter,
    state: State,
    recordings: Sequence[Recorded],
    known: int | None = None,
) -> Update:
    """Learn from recordings of the next trial, or of an earlier reference flown again.

    Args:
        design: design of the loop.
        filter_: learning filter for the loop.
        state: state before the trial.
        recordings: recordings of one trial each, all of the same reference.
        known: number of trials in the state when the recordings were made; all by default. Later
            references are left out, and the last one before is expected.

    Raises:
        InputError: with the file: as in `match`; for a repeated recording, recordings of different
            references, or an error that has grown.
    """
    check_different(recordings)
    recordings = [without_spikes(recorded, design.device.simulated) for recorded in recordings]
    references = state.references if known is None else state.references[: known + 1]
    motions = [reference.motion for reference in references]
    found = [match(recorded, design, filter_, motions) for recorded in recordings]
    flown = {one.reference % len(motions) for one in found}
    if len(flown) > 1:
        raise InputError(
            f"{recordings[-1].path}: has another reference than {recordings[0].path}, expected "
            "recordings of one reference"
        )
    number = flown.pop()
    trial = _record(design.reference.planned.q, found, number + 1)
    _refuse_growth(trial, state, recordings[0].path)
    error = np.mean([one.q for one in found], axis=0) - design.reference.planned.q
    given = design if number == 0 else design.given(state.references[number])
    step = next_step(given, filter_, error)
    findings = [
        Finding("reading", note, source=f"{recorded.path}")
        for recorded in recordings
        for note in recorded.notes
    ]
    findings += _checked(trial, step, state)
    for one, recorded in zip(found, recordings, strict=True):
        if one.reference < 0:
            planned = "its q_ref is the planned motion, as in files of `simulate`"
            why = planned if recorded.of_links else "it has no q_ref"
            text = f"{why}; the expected reference is assumed"
            findings.append(Finding("assumed", text, source=f"{recorded.path}"))
    return Update(trial, step, findings)


def _record(planned: Array, found: Sequence[Matched], reference: int) -> TrialRecord:
    """Return the result of a trial, with repeating error and noise separated.

    The variance of m recordings has m - 1 degrees of freedom. Their mean has 1/m of it.
    """
    flown, count = [one.q for one in found], len(found)
    error = np.mean(flown, axis=0) - planned
    square, floor = np.mean(error**2, axis=0), np.zeros(0)
    if count > 1:
        variance = np.mean(np.var(flown, axis=0, ddof=1), axis=0)
        square, floor = np.maximum(square - variance / count, 0), np.sqrt(variance)
    return TrialRecord(
        reference=reference,
        recordings=count,
        largest=np.abs(error).max(axis=0).tolist(),
        rms=np.sqrt(square).tolist(),
        floor=floor.tolist(),
        shifts=[one.shift for one in found],
    )


def _refuse_growth(trial: TrialRecord, state: State, path: Path) -> None:
    """Raise InputError if the repeating error is clearly larger than that of the best trial."""
    best = State([*state.trials, trial], []).best
    if trial.score > c.MAX_GROWTH * best.score + trial.noise + best.noise:
        raise InputError(
            f"{path}: the error has grown from {np.degrees(best.score):.4g} to "
            f"{np.degrees(trial.score):.4g} deg (RMS of all joints), so nothing is learned; fly "
            f"the best so far: {best.flown(Path())}"
        )


def _checked(trial: TrialRecord, step: Step, state: State) -> Iterator[Finding]:
    """Yield what a trial shows beside those before, and the limit of the step to the next one."""
    noise = np.array(trial.floor) / math.sqrt(trial.recordings)
    if trial.floor and np.all(trial.rms < noise):
        yield finding("noise", error_rad=trial.score, noise_rad=trial.noise)
    elif state.trials and trial.score > (1 - c.MIN_GAIN) * state.best.score:
        errors = {"error_rad": trial.score, "before_rad": state.best.score}
        yield finding("converged", less=c.MIN_GAIN, **errors)
    if step.note:
        yield Finding("limited", step.note, (), {"share": step.share})


def write_step(folder: Path, design: Design, state: State, made: Update) -> Path:
    """Write the result of a trial and the next one's reference; return the path of the latter."""
    number = len(state.trials) + 1
    with replacing_files(folder, last=trial_file(folder, number).name) as new:
        if number == 1:
            save_scenario(design.scenario, new / SCENARIO)
        made.step.learned.to_csv(reference_file(new, number + 1), design.reference.planned)
        write_yaml(trial_file(new, number), made.trial)
    return reference_file(folder, number + 1)
