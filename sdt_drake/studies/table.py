"""The runs of a study as a table."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sdt_drake.analysis.metrics import METRICS, family_of
from sdt_drake.io.arrays import Array

STATUSES = ("ok", "infeasible", "failed", "timed_out", "crashed")

ANSWERS = ("ok", "infeasible")
"""Of these: what says something about the device."""

RUN_COLUMNS = ("row", "status", "reason", "duration")
"""Of every study; beside its inputs and its outcomes."""

ALL_RUNS = "all runs"


@dataclass(frozen=True)
class Row:
    """What became of a run.

    Attributes:
        number: from 0.
        status: one of STATUSES.
        reason: one line; "" where it is ok.
        duration: of the computation [s].
        outcomes: in the order of `outcomes.outcome_names`; empty where it is not ok.
    """

    number: int
    status: str
    reason: str
    duration: float
    outcomes: tuple[float, ...]


_CONTROLLER = ("controller", "controller.kind")  # inputs whose levels speak for themselves
_MOST_GROUPS = 8  # that figures can tell apart


@dataclass(frozen=True, eq=False)
class StudyTable:
    """N runs: what went in, and what came out.

    Attributes:
        name: of the study.
        row: number of each run, shape (N,).
        inputs: by name of the variable: numbers or texts, shape (N,).
        outcomes: by name, joint k = 1..n at its end, shape (N,); NaN where a run has none. See
            `METRICS` for the names; angles are in rad and shares between 0 and 1.
        status: one of STATUSES, shape (N,).
        reason: why a run is not ok, "" where it is, shape (N,).
        duration: of the computation [s], shape (N,).
        choices: names of the inputs that a designer chooses; the others are what designs have to
            stand. None if these are drawn at random: then designs have met different things.
        per_draw: runs of each draw of the random inputs, one after the other by `row`.
        missing: runs of the study that are not done yet.
    """

    name: str
    row: NDArray[np.int64]
    inputs: dict[str, NDArray[Any]]
    outcomes: dict[str, Array]
    status: NDArray[np.str_]
    reason: NDArray[Any]
    duration: Array
    choices: tuple[str, ...] | None = None
    per_draw: int = 1
    missing: int = 0

    def __len__(self) -> int:
        return len(self.row)

    @property
    def ok(self) -> NDArray[np.bool_]:
        """Which runs are ok, shape (N,)."""
        return self.status == "ok"

    @property
    def draw(self) -> NDArray[np.int64]:
        """Number of the draw of each run, shape (N,)."""
        return self.row // self.per_draw

    @property
    def families(self) -> list[str]:
        """Names of the outcomes without their joints, in the order of the table."""
        return list(dict.fromkeys(family_of(name)[0] for name in self.outcomes))

    def joints(self, family: str) -> list[int]:
        """The joints k = 1..n that an outcome is there for; none for one of the whole device."""
        both = map(family_of, self.outcomes)
        return sorted(k for stem, k in both if stem == family and k is not None)

    def outcome(self, name: str) -> Array:
        """An outcome, shape (N,); for the name of a family, that of each run's worst joint."""
        joints = self.joints(name)
        if not joints:
            return self.outcomes[name]
        # fmax leaves NaN out, and gives NaN where no joint has a number.
        return np.fmax.reduce([self.outcomes[f"{name}_{k}"] for k in joints])

    def worst_joint(self, family: str) -> NDArray[np.int64]:
        """Joint k = 1..n with the largest value of a family in each run, shape (N,).

        Only for families that have joints, and runs that have a number.
        """
        joints = self.joints(family)
        values = np.stack([self.outcomes[f"{family}_{k}"] for k in joints])
        return np.array(joints)[np.argmax(np.nan_to_num(values, nan=-np.inf), axis=0)]

    def place(self, name: str) -> str:
        """Where an outcome is: "joint 2", "worst joint" for a family, "" for the whole device."""
        joint = family_of(name)[1]
        if joint is not None:
            return f"joint {joint}"
        return "worst joint" if self.joints(name) else ""

    def select(self, runs: NDArray[np.bool_] | NDArray[np.int64]) -> StudyTable:
        """The table of some runs: their mask, shape (N,), or their indices."""
        return replace(
            self,
            inputs={name: values[runs] for name, values in self.inputs.items()},
            outcomes={name: values[runs] for name, values in self.outcomes.items()},
            **{name: getattr(self, name)[runs] for name in RUN_COLUMNS},
        )

    @cached_property
    def by(self) -> str | None:
        """The text input whose levels are best told apart: the controller, or else the first of
        few levels; None if there is no such input."""
        levels = {name: levels_of(x) for name, x in self.inputs.items() if is_text(x)}
        names = (name for name, own in levels.items() if 1 < len(own) <= _MOST_GROUPS)
        return min(names, key=lambda name: not name.startswith("controller"), default=None)

    @cached_property
    def group(self) -> NDArray[np.str_]:
        """Name of the group of each run, shape (N,): its level of the input `by`, with what that is
        unless it is the controller: "anti_windup true"; ALL_RUNS without such an input."""
        if self.by is None:
            return np.full(len(self), ALL_RUNS)
        levels, what = self.inputs[self.by].astype(str), self.by.rpartition(".")[2]
        return levels if self.by in _CONTROLLER else np.char.add(f"{what} ", levels)

    @cached_property
    def groups(self) -> dict[str, StudyTable]:
        """A table for each `group`, by its name."""
        if self.by is None:
            return {ALL_RUNS: self}
        return {name: self.select(self.group == name) for name in levels_of(self.group)}

    def designs(self, *outcomes: str) -> tuple[NDArray[np.int64], list[Array]]:
        """Each design by its first run, and the largest of each outcome over its runs, shape (D,).

        Accepted designs only: all of their runs are ok, and have these outcomes.

        Args:
            outcomes: names; of a family for that of the worst joint.
        """
        runs: dict[tuple[Any, ...], list[int]] = {}
        columns = [self.inputs[name].tolist() for name in self.choices or ()]
        for i, choice in enumerate(zip(*columns, strict=True)):
            runs.setdefault(choice, []).append(i)
        values = [np.where(self.ok, self.outcome(name), np.nan) for name in outcomes]
        worst = [np.array([one[own].max() for own in runs.values()]) for one in values]
        accepted = np.isfinite(worst).all(axis=0)
        first = np.array([own[0] for own in runs.values()], dtype=np.int64)
        return first[accepted], [one[accepted] for one in worst]


def is_column(name: str) -> bool:
    """Whether a column of the results has this name, so that no input may."""
    return name in RUN_COLUMNS or family_of(name)[0] in METRICS


def is_text(values: NDArray[Any]) -> bool:
    """Whether an input is one of texts; truth values count as such."""
    return values.dtype.kind not in "iuf"


def levels_of(values: NDArray[Any]) -> list[str]:
    """The different texts of an input, in the order in which they come."""
    return list(dict.fromkeys(map(str, values.tolist())))


def pareto(cost: ArrayLike, error: ArrayLike) -> NDArray[np.bool_]:
    """Which points no other point beats: at most as much of both, and less of one (Pareto front).

    Of equal points all are kept, or none. A point with NaN is never kept and beats nothing.

    Args:
        cost, error: of each point, shape (N,).

    Returns:
        Shape (N,).
    """
    points = np.column_stack([cost, error]).astype(float)
    front = ~np.isnan(points).any(axis=1)
    # Different points by cost, then by error; each against the least error before it.
    known, of_point = np.unique(points[front], axis=0, return_inverse=True)
    least = np.minimum.accumulate(np.append(np.inf, known[:, 1]))
    front[front] = (known[:, 1] < least[:-1])[of_point.ravel()]
    return front
