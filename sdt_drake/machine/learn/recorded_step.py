"""A step of learning from recordings of the real machine: `learn update`."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sdt_drake.io.arguments import a_path, instance_of, takes
from sdt_drake.io.errors import InputError
from sdt_drake.io.files import alone_in
from sdt_drake.io.trust import trusting
from sdt_drake.machine.learn.filter import Convergence, LearningFilter, refuse_divergence
from sdt_drake.machine.learn.procedure import learning_filter
from sdt_drake.machine.learn.state import (
    SCENARIO,
    State,
    TrialRecord,
    Update,
    count_trials,
    read_state,
    update,
    write_step,
)
from sdt_drake.machine.recordings.columns import load_columns
from sdt_drake.machine.recordings.reading import read_recording
from sdt_drake.machine.recordings.recorded import Recorded
from sdt_drake.run.design import Design, make_design, plan_of
from sdt_drake.run.scenario import Scenario, load_scenario


class RecordedStep(NamedTuple):
    """A step of learning that is kept in the folder of its state."""

    reference: Path
    """File of the reference to fly next."""
    best: TrialRecord
    """The trial with the smallest repeating error so far."""
    recordings: list[Recorded]
    """The recordings that it was made from."""
    made: Update
    """Result of the trial, learning step, and findings in the recordings."""
    design: Design
    """Design of the state's scenario."""


@takes(
    state=a_path, recordings=instance_of(Sequence[str | Path]), motion=instance_of(str),
    scenario=instance_of(Scenario, "sdt_drake.load"), columns=a_path, study=a_path,
    report=instance_of(Callable), waiting=instance_of(Callable),
)  # fmt: skip
def learn_update(
    state: str | Path,
    recordings: Sequence[str | Path],
    *,
    scenario: Scenario | None = None,
    motion: str | None = None,
    columns: str | Path | None = None,
    of: str = "reference",
    bandwidth: float | None = None,
    study: str | Path | None = None,
    draws: int = 20,
    report: Callable[[Design, LearningFilter, list[Convergence]], None] = lambda *_: None,
    waiting: Callable[[], None] = lambda: None,
    trust: bool = False,
) -> RecordedStep:
    """Learn the next reference from recordings of the real machine, as `sdt-drake learn update`.

    Args:
        state: folder that keeps the learned state; other processes wait for this one to end.
        recordings: recordings of one flight each, all of the same reference.
        scenario: scenario of the first flight; the state keeps it for the next ones.
        motion: motion that was flown (shipped name or file), for a check.
        columns: file with the names of the recordings' columns.
        of, bandwidth, study, draws, trust: as those of `learn`.
        report: function that is called with the design, its learning filter and the checks of
            convergence before the recordings are used.
        waiting: function that is called if another process learns in the folder.

    Raises:
        InputError: naming the argument or the file that is wrong, if learning would not converge,
            or if the error has grown. The state stays as it was.
    """
    folder = Path(state)
    known = count_trials(folder)
    with alone_in(folder, waiting), trusting(trust):
        own = folder / SCENARIO
        if own.exists() and scenario is not None:
            raise InputError(
                f"{folder} contains {SCENARIO} already; leave it out", place="scenario"
            )
        if not own.exists() and scenario is None:
            raise InputError(
                f"missing, expected the scenario of the first flight, since {folder} is new",
                place="scenario",
            )
        design = make_design(scenario or load_scenario(own))
        if motion is not None:
            _check_motion(motion, design)
        robot, named = design.device.simulated, None if columns is None else load_columns(columns)
        read = [read_recording(path, robot, named, needs=("q",)) for path in recordings]
        filter_, checks = learning_filter(design, of, bandwidth=bandwidth, study=study, draws=draws)
        report(design, filter_, checks)
        refuse_divergence(checks, filter_)
        before = read_state(folder, design)
        made = update(design, filter_, before, read, known)
        path = write_step(folder, design, before, made)
    return RecordedStep(path, State([*before.trials, made.trial], []).best, read, made, design)


def _check_motion(name: str, design: Design) -> None:
    """Raise InputError unless `name` is the motion of the design."""
    scenario, planned = design.scenario, design.reference.planned.q
    own = plan_of(replace(scenario, motion=name), design.device.nominal).motion.q
    if own.shape != planned.shape or np.abs(own - planned).max() > 1e-6:
        raise InputError(
            f"{name}: is not the motion of the scenario, {scenario.motion}", place="motion"
        )
