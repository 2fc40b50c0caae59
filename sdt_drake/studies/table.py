"""The runs of a study as a table."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from sdt_drake.analysis.metrics import METRICS, family_of
from sdt_drake.io.arrays import Mask
from sdt_drake.io.errors import needing

if TYPE_CHECKING:
    import pandas as pd

Value = float | str
"""A value of an input."""

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


def pandas() -> Any:
    """Import pandas, which takes 0.2 s.

    Raises:
        InputError: pandas is not installed.
    """
    with needing("studies need pandas", "sdt_drake[study]"):
        import pandas
    return pandas


@dataclass(frozen=True, eq=False)
class StudyTable:
    """The finished runs of a study."""

    name: str
    """Name of the study."""
    runs: pd.DataFrame
    """A run in each row; the index `row` is its number in the study.

    The inputs come first, by name of the variable: texts, or numbers in the unit of their field.
    Then come status, one of STATUSES, reason, "" if the run is ok, and duration, the computing time
    [s]. The outcomes are last, NaN where a run has none. Their names are those of `METRICS`, with
    _k for joint k = 1..n. Speeds are in rad/s and angles in rad, joint side; shares are between 0
    and 1 [-].
    """
    input_names: tuple[str, ...]
    """Names of the columns of inputs."""
    choices: tuple[str, ...] | None = None
    """Names of the inputs that a designer chooses; the others are uncertain. None if uncertain
    inputs are drawn at random, since designs can then not be compared."""
    per_draw: int = 1
    """Number of successive rows of each draw of the random inputs."""
    missing: int = 0
    """Number of runs that are not finished."""
    units: Mapping[str, str] = field(default_factory=dict)
    """Units of inputs that have one, by name."""

    def __len__(self) -> int:
        return len(self.runs)

    def to_pandas(self) -> pd.DataFrame:
        """Return `runs`, which may be changed then."""
        return self.runs.copy()

    @property
    def inputs(self) -> pd.DataFrame:
        """The columns of inputs."""
        return self.runs[list(self.input_names)]

    @property
    def outcomes(self) -> pd.DataFrame:
        """The columns of outcomes."""
        return self.runs[self.outcome_names]

    @cached_property
    def outcome_names(self) -> list[str]:
        """Names of the columns of outcomes."""
        return [*self.runs][len(self.input_names) + len(RUN_COLUMNS) - 1 :]

    @property
    def status(self) -> pd.Series:
        """Status of each run."""
        return self.runs["status"]

    @property
    def ok(self) -> pd.Series:
        """Mask of the runs that are ok."""
        return self.status == "ok"

    @property
    def families(self) -> list[str]:
        """Names of the outcomes without numbers of joints, in the order of the table."""
        return list(dict.fromkeys(family_of(name)[0] for name in self.outcome_names))

    def joints(self, family: str) -> list[int]:
        """Return the joints k = 1..n that have an outcome; [] for one of the whole device."""
        both = map(family_of, self.outcome_names)
        return sorted(k for stem, k in both if stem == family and k is not None)

    def outcome(self, name: str) -> pd.Series:
        """Return an outcome of each run; for a family, the one of the run's worst joint."""
        members = [f"{name}_{k}" for k in self.joints(name)] or [name]
        return self.runs[members].max(axis=1)

    def worst_joint(self, family: str) -> pd.Series:
        """Return the joint k = 1..n with the largest value of a family in each run.

        The family must have joints, and every run a number for it.
        """
        joints = self.joints(family)
        members = self.runs[[f"{family}_{k}" for k in joints]].set_axis(joints, axis=1)
        return members.fillna(-math.inf).idxmax(axis=1)

    def input_label(self, name: str) -> str:
        """Return an input's name with its unit, as in "payload_mass [kg]"."""
        return f"{name} [{self.units[name]}]" if self.units.get(name) else name

    def place(self, name: str) -> str:
        """Return an outcome's place: "joint 2", "worst joint" for a family, "" for the device."""
        joint = family_of(name)[1]
        if joint is not None:
            return f"joint {joint}"
        return "worst joint" if self.joints(name) else ""

    def select(self, runs: Any) -> StudyTable:
        """Return the table of some runs, given by a mask or by their numbers."""
        return replace(self, runs=self.runs.loc[runs])

    @cached_property
    def by(self) -> str | None:
        """Name of the text input that groups the runs; None if there is none.

        It is the controller, or else the first input with 2 to 8 levels.
        """
        texts = (name for name, values in self.inputs.items() if is_text(values))
        names = (name for name in texts if 1 < self.runs[name].nunique() <= _MAX_GROUPS)
        return min(names, key=lambda name: not name.startswith("controller"), default=None)

    @cached_property
    def group(self) -> pd.Series:
        """Name of each run's group; ALL_RUNS without `by`.

        It is the level of the input `by`, such as "pi", or "anti_windup true" for other inputs than
        the controller.
        """
        if self.by is None:
            return self.status.map(lambda _: ALL_RUNS)
        levels, what = self.runs[self.by].astype(str), self.by.rpartition(".")[2]
        return levels if self.by in _CONTROLLER else f"{what} " + levels

    @cached_property
    def groups(self) -> dict[str, StudyTable]:
        """Tables of the groups, by name of the `group`."""
        parts = self.runs.groupby(self.group, sort=False)
        return {name: replace(self, runs=part) for name, part in parts}

    def designs(self, *outcomes: str) -> pd.DataFrame:
        """Return the accepted designs with their largest outcomes over all runs of the design.

        A design is a combination of the inputs in `choices`. It is accepted if all of its runs are
        ok and have these outcomes.

        Args:
            outcomes: names of outcomes, or of families for the worst joint.

        Returns:
            A design in each row; the index `row` is the number of its first run. Columns are the
            choices, then the outcomes in the units of `runs`.
        """
        choices = list(self.choices or ())
        values = {x: self.outcome(x).where(self.ok).fillna(math.inf) for x in outcomes}
        runs = self.runs[choices].assign(**values).reset_index()
        wanted = {"row": "first", **dict.fromkeys(outcomes, "max")}
        designs = runs.groupby(choices, sort=False, as_index=False).agg(wanted).set_index("row")
        return designs[(designs[list(outcomes)] < math.inf).all(axis=1)]


def is_column(name: str) -> bool:
    """Return whether the results have a column of this name, which then no input may have."""
    return name in RUN_COLUMNS or family_of(name)[0] in METRICS


def is_text(values: pd.Series) -> bool:
    """Return whether an input consists of texts; truth values count as texts."""
    return values.dtype.kind not in "iuf"


def pareto(cost: ArrayLike, error: ArrayLike) -> Mask:
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
