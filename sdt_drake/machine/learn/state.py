"""Learning from recordings of a real machine, a flight at a time: what is known between flights.

A folder holds the scenario, and of each flight, numbered from 1, what it was given
(`reference_02.csv`; the first flies the planned motion) and what came of it (`flight_01.yaml`,
written last). Nothing in it is ever changed. Who learns has it alone meanwhile.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.fields import (
    EachJoint,
    EachJointOrNone,
    Input,
    NotNegative,
    Number,
    check,
    setting,
)
from sdt_drake.io.files import replacing_files
from sdt_drake.io.yaml_files import load_yaml, write_yaml
from sdt_drake.machine.learn.filter import LearningFilter
from sdt_drake.machine.learn.flights import Step, next_step
from sdt_drake.machine.learn.matching import match
from sdt_drake.machine.recordings import Recorded, check_different
from sdt_drake.motion import LearnedReference, load_learned
from sdt_drake.run.design import Design
from sdt_drake.run.scenario import save_scenario

SCENARIO = "scenario.yaml"
_GROWN = 1.05  # of the error of the best flight
_GAIN = 0.95


@dataclass(kw_only=True)
class FlightRecord(Input):
    """What came of a real flight, by its recordings; a file of it lies in the folder of the
    learning.
    """

    reference: int = setting(1, ge=1)
    """Number of the reference that was flown; 1 is the planned motion."""
    recordings: int = setting(1, ge=1)
    """How many there are of it."""
    largest: EachJoint[NotNegative] = setting(unit="rad", side="joint")
    """|error| of their mean."""
    rms: EachJoint[NotNegative] = setting(unit="rad", side="joint")
    """RMS error that repeats, of the mean without what noise leaves in it."""
    floor: EachJointOrNone[NotNegative] = setting([], unit="rad", side="joint")
    """RMS error that does not repeat, with several recordings."""
    shifts: list[Number] = setting([], unit="s")
    """When the motion begins in each recording."""

    @property
    def score(self) -> float:
        """RMS error of all joints that repeats [rad]: less is better."""
        return math.sqrt(sum(x * x for x in self.rms) / max(1, len(self.rms)))

    def flown(self, folder: Path) -> Path | str:
        """The reference that was flown, for people; folder: of the learning."""
        is_planned = self.reference == 1
        return "the planned motion" if is_planned else reference_file(folder, self.reference)

    @property
    def noise(self) -> float:
        """Noise of the mean of the recordings, RMS of all joints [rad]; 0 where it is not known."""
        mean = sum(x * x for x in self.floor) / max(1, len(self.floor))
        return math.sqrt(mean / self.recordings)


class State(NamedTuple):
    """What a folder knows: flights so far, and what may be flown next."""

    flights: list[FlightRecord]
    references: list[LearnedReference]

    @property
    def best(self) -> FlightRecord:
        """The flight with the least error that repeats."""
        return min(self.flights, key=lambda flight: flight.score)


def read_state(folder: Path, design: Design) -> State:
    """The state of a learning that a folder holds, which may still be empty.

    Raises:
        InputError: naming a file that is missing, or was learned of another motion.
    """
    references = [LearnedReference(design.motion, design.learned_torque)]
    flights: list[FlightRecord] = []
    for number in range(1, 1 + count_flights(folder)):
        file = flight_file(folder, number)
        flight, _ = load_yaml(FlightRecord, file)
        check(flight, str(file), design.robot.n)
        if flight.reference > len(references):
            raise InputError(f"{file}: reference: {flight.reference}, there is none yet")
        flights.append(flight)
        path = reference_file(folder, number + 1)
        margin = design.scenario.torque_margin
        references.append(load_learned(path, design.wanted, design.nominal, torque_margin=margin))
    return State(flights, references)


def count_flights(folder: Path) -> int:
    """How many flights a folder knows."""
    return next(i for i in itertools.count() if not flight_file(folder, i + 1).exists())


def flight_file(folder: Path, number: int) -> Path:
    """The file of what came of a flight."""
    return folder / f"flight_{number:02d}.yaml"


def reference_file(folder: Path, number: int) -> Path:
    """The file of the reference that a flight is given; the first flies the planned motion."""
    return folder / f"reference_{number:02d}.csv"


class Taught(NamedTuple):
    """What recordings of a flight have taught.

    Attributes:
        flight: what came of it.
        step: to the next one.
        notes: for people.
    """

    flight: FlightRecord
    step: Step
    notes: list[str]


def teach(
    design: Design,
    filter_: LearningFilter,
    state: State,
    recordings: Sequence[Recorded],
    known: int | None = None,
) -> Taught:
    """Learn from recordings of the flight that comes next, or of an earlier one again.

    Args:
        design: of the loop.
        filter_: for it.
        state: so far.
        recordings: of one flight each, all of the same reference.
        known: how many flights the state had when they were there already; by default all. No
            later reference was flown, and the last one before is expected.

    Raises:
        InputError: naming the file: what `match` refuses; a recording that is there twice;
            recordings of different references; an error that has grown.
    """
    check_different(recordings)
    references = state.references if known is None else state.references[: known + 1]
    motions = [reference.motion for reference in references]
    found = [match(recorded, design, filter_, motions) for recorded in recordings]
    flown = {one.reference % len(motions) for one in found}
    if len(flown) > 1:
        raise InputError(
            f"{recordings[-1].path}: is of another reference than {recordings[0].path}, expected "
            "recordings of one reference"
        )
    number = flown.pop()
    flight = _record(design.wanted.q, [one.q for one in found], number + 1)
    flight.shifts = [one.shift for one in found]
    _refuse_growth(flight, state, recordings[0].path)
    error = np.mean([one.q for one in found], axis=0) - design.wanted.q
    given = design if number == 0 else design.given(state.references[number])
    step = next_step(given, filter_, error)
    notes = _notes(flight, step, state)
    for one, recorded in zip(found, recordings, strict=True):
        if one.reference < 0:
            planned = "its q_ref is that of the plan, as `simulate` writes it"
            why = planned if recorded.of_links else "it holds no q_ref"
            trust = "that the reference to be flown was flown is taken on trust"
            notes.append(f"{recorded.path}: {why}: {trust}")
    return Taught(flight, step, notes)


def _record(wanted: Array, flown: Sequence[Array], reference: int) -> FlightRecord:
    """Separate what repeats from what does not: the spread of m recordings has m - 1 degrees of
    freedom, and 1/m of its square is left in their mean."""
    count = len(flown)
    error = np.mean(flown, axis=0) - wanted
    square, floor = np.mean(error**2, axis=0), np.zeros(0)
    if count > 1:
        variance = np.mean(np.var(flown, axis=0, ddof=1), axis=0)
        square, floor = np.maximum(square - variance / count, 0), np.sqrt(variance)
    return FlightRecord(
        reference=reference,
        recordings=count,
        largest=np.abs(error).max(axis=0).tolist(),
        rms=np.sqrt(square).tolist(),
        floor=floor.tolist(),
    )


def _refuse_growth(flight: FlightRecord, state: State, path: Path) -> None:
    best = State([*state.flights, flight], []).best
    if flight.score > _GROWN * best.score + flight.noise + best.noise:
        raise InputError(
            f"{path}: the error has grown, from {np.degrees(best.score):.4g} to "
            f"{np.degrees(flight.score):.4g} deg (RMS of all joints): nothing is learned of it; "
            f"the best so far is {best.flown(Path())}"
        )


def _notes(flight: FlightRecord, step: Step, state: State) -> list[str]:
    notes = []
    left = np.array(flight.floor) / math.sqrt(flight.recordings)
    if flight.floor and np.all(flight.rms < left):
        notes.append("what repeats is within what noise leaves of it: no more can be learned")
    elif state.flights and flight.score > _GAIN * state.best.score:
        notes.append(
            "it took less than 5 % off the error that repeats: another one is not worth it"
        )
    return [*notes, step.note] if step.note else notes


def write_step(folder: Path, design: Design, state: State, taught: Taught) -> Path:
    """Write what the next flight gets, and what came of this one; all or none; the former's
    file."""
    number = len(state.flights) + 1
    with replacing_files(folder, last=flight_file(folder, number).name) as new:
        if number == 1:
            save_scenario(design.scenario, new / SCENARIO)
        taught.step.learned.to_csv(reference_file(new, number + 1), design.wanted)
        write_yaml(flight_file(new, number), taught.flight)
    return reference_file(folder, number + 1)
