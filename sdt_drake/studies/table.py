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
"""Statuses that are a result about the device."""

RUN_COLUMNS = ("row", "status", "reason", "duration")
"""Columns that every study has beside its inputs and outcomes."""

ALL_RUNS = "all runs"


@dataclass(frozen=True)
class Row:
    """A row of a study: the result of one run."""

    number: int
    """Number of the row, from 0."""
    status: str
    """One of STATUSES."""
    reason: str
    """Reason of the status in one line; "" if it is ok."""
    duration: float
    """Computing time [s]."""
    outcomes: tuple[float, ...]
    """Outcomes in the order of `outcomes.outcome_names`; empty unless the status is ok."""


_CONTROLLER = ("controller", "controller.kind")  # inputs whose levels need no explanation
_MAX_GROUPS = 8  # groups that a figure can show


@dataclass(frozen=True, eq=False)
class StudyTable:
    """Inputs and outcomes of N runs of a study."""

    name: str
    """Name of the study."""
    row: NDArray[np.int64]
    """Number of each run's row, shape (N,)."""
    inputs: dict[str, NDArray[Any]]
    """Numbers or texts by name of the variable, shape (N,) each."""
    outcomes: dict[str, Array]
    """Outcomes by name, which ends with _k for joint k = 1..n, shape (N,) each; NaN where a run has
    none. `METRICS` has the names; angles are in rad, shares between 0 and 1."""
    status: NDArray[np.str_]
    """One of STATUSES for each run, shape (N,)."""
    reason: NDArray[Any]
    """Reason of each run's status, "" if it is ok, shape (N,)."""
    duration: Array
    """Computing times [s], shape (N,)."""
    choices: tuple[str, ...] | None = None
    """Names of the inputs that a designer chooses; the others are uncertain. None if uncertain
    inputs are drawn at random, since designs can then not be compared."""
    per_draw: int = 1
    """Number of successive rows of each draw of the random inputs."""
    missing: int = 0
    """Number of runs that are not finished."""

    def __len__(self) -> int:
        return len(self.row)

    @property
    def ok(self) -> NDArray[np.bool_]:
        """Mask of the runs that are ok, shape (N,)."""
        return self.status == "ok"

    @property
    def draw(self) -> NDArray[np.int64]:
        """Number of each run's draw, shape (N,)."""
        return self.row // self.per_draw

    @property
    def families(self) -> list[str]:
        """Names of the outcomes without numbers of joints, in the order of the table."""
        return list(dict.fromkeys(family_of(name)[0] for name in self.outcomes))

    def joints(self, family: str) -> list[int]:
        """Return the joints k = 1..n that have an outcome; [] for one of the whole device."""
        both = map(family_of, self.outcomes)
        return sorted(k for stem, k in both if stem == family and k is not None)

    def outcome(self, name: str) -> Array:
        """Return an outcome, shape (N,); for a family, the one of each run's worst joint."""
        joints = self.joints(name)
        if not joints:
            return self.outcomes[name]
        # fmax ignores NaN unless all joints have NaN.
        return np.fmax.reduce([self.outcomes[f"{name}_{k}"] for k in joints])

    def worst_joint(self, family: str) -> NDArray[np.int64]:
        """Return the joint k = 1..n with the largest value of a family in each run, shape (N,).

        The family must have joints, and every run a number for it.
        """
        joints = self.joints(family)
        values = np.stack([self.outcomes[f"{family}_{k}"] for k in joints])
        return np.array(joints)[np.argmax(np.nan_to_num(values, nan=-np.inf), axis=0)]

    def place(self, name: str) -> str:
        """Return an outcome's place: "joint 2", "worst joint" for a family, "" for the device."""
        joint = family_of(name)[1]
        if joint is not None:
            return f"joint {joint}"
        return "worst joint" if self.joints(name) else ""

    def select(self, runs: NDArray[np.bool_] | NDArray[np.int64]) -> StudyTable:
        """Return the table of some runs, given by a mask of shape (N,) or by indices."""
        return replace(
            self,
            inputs={name: values[runs] for name, values in self.inputs.items()},
            outcomes={name: values[runs] for name, values in self.outcomes.items()},
            **{name: getattr(self, name)[runs] for name in RUN_COLUMNS},
        )

    @cached_property
    def by(self) -> str | None:
        """Name of the text input that groups the runs; None if there is none.

        It is the controller, or else the first input with 2 to 8 levels.
        """
        levels = {name: levels_of(x) for name, x in self.inputs.items() if is_text(x)}
        names = (name for name, own in levels.items() if 1 < len(own) <= _MAX_GROUPS)
        return min(names, key=lambda name: not name.startswith("controller"), default=None)

    @cached_property
    def group(self) -> NDArray[np.str_]:
        """Name of each run's group, shape (N,); ALL_RUNS without `by`.

        It is the level of the input `by`, such as "pi", or "anti_windup true" for other inputs than
        the controller.
        """
        if self.by is None:
            return np.full(len(self), ALL_RUNS)
        levels, what = self.inputs[self.by].astype(str), self.by.rpartition(".")[2]
        return levels if self.by in _CONTROLLER else np.char.add(f"{what} ", levels)

    @cached_property
    def groups(self) -> dict[str, StudyTable]:
        """Tables of the groups, by name of the `group`."""
        if self.by is None:
            return {ALL_RUNS: self}
        return {name: self.select(self.group == name) for name in levels_of(self.group)}

    def designs(self, *outcomes: str) -> tuple[NDArray[np.int64], list[Array]]:
        """Return the first run of each accepted design, and the design's largest outcomes.

        A design is a combination of the inputs in `choices`. It is accepted if all of its runs are
        ok and have these outcomes.

        Args:
            outcomes: names of outcomes, or of families for the worst joint.

        Returns:
            Indices of the first runs, shape (D,), and for each outcome the largest value over a
            design's runs, shape (D,).
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
    """Return whether the results have a column of this name, which then no input may have."""
    return name in RUN_COLUMNS or family_of(name)[0] in METRICS


def is_text(values: NDArray[Any]) -> bool:
    """Return whether an input consists of texts; truth values count as texts."""
    return values.dtype.kind not in "iuf"


def levels_of(values: NDArray[Any]) -> list[str]:
    """Return the different texts of an input in the order of the runs."""
    return list(dict.fromkeys(map(str, values.tolist())))


def pareto(cost: ArrayLike, error: ArrayLike) -> NDArray[np.bool_]:
    """Return the mask of the Pareto front: points that no other point dominates, shape (N,).

    A point dominates if it has less of one quantity and not more of the other. So equal points are
    on the front together. Points with NaN are never on it and dominate nothing.

    Args:
        cost: first quantity, shape (N,).
        error: second quantity, shape (N,).

    >>> pareto([1, 2, 2, 3], [9, 4, 5, 4]).tolist()
    [True, True, False, False]
    """
    points = np.column_stack([cost, error]).astype(float)
    front = ~np.isnan(points).any(axis=1)
    # Different points, sorted by cost, then error: each against the smallest error before it.
    known, of_point = np.unique(points[front], axis=0, return_inverse=True)
    least = np.minimum.accumulate(np.append(np.inf, known[:, 1]))
    front[front] = (known[:, 1] < least[:-1])[of_point.ravel()]
    return front
