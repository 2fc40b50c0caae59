"""The runs of a study as a table."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sdt_drake.errors import InputError
from sdt_drake.studies.quantities import FAMILIES, family_of

Array = NDArray[np.float64]

STATUSES = ("ok", "infeasible", "failed", "timed_out", "crashed")

ANSWERS = ("ok", "infeasible")
"""Of these: what says something about the device."""

COLUMNS = ("row", "status", "reason", "duration")
"""Of every study; beside its inputs and its outcomes."""


@dataclass(frozen=True, eq=False)
class StudyTable:
    """N runs: what went in, and what came out.

    Attributes:
        name: of the study.
        row: number of each run, shape (N,).
        inputs: by name of the variable: numbers or texts, shape (N,).
        outcomes: by name, joint k = 1..n at its end, shape (N,); NaN where a run has none. See
            `quantities.FAMILIES` for the names and their units; in the table angles are in rad and
            shares between 0 and 1.
        status: one of STATUSES, shape (N,).
        reason: why a run is not ok, "" where it is, shape (N,).
        duration: of the computation [s], shape (N,).

    Raises:
        InputError: naming the study and the column: for a wrong length, an unknown status.
    """

    name: str
    row: NDArray[np.int64]
    inputs: dict[str, NDArray]
    outcomes: dict[str, Array]
    status: NDArray[np.str_]
    reason: NDArray
    duration: Array

    def __post_init__(self) -> None:
        columns = {"status": self.status, "reason": self.reason, "duration": self.duration}
        for name, values in (columns | self.inputs | self.outcomes).items():
            if np.shape(values) != (len(self),):
                raise InputError(
                    f"study '{self.name}': {name} has shape {np.shape(values)}, expected "
                    f"({len(self)},), one for each run"
                )
        unknown = sorted(set(map(str, self.status)) - set(STATUSES))
        if unknown:
            raise InputError(
                f"study '{self.name}': status '{unknown[0]}', expected one of {', '.join(STATUSES)}"
            )

    def __len__(self) -> int:
        return len(self.row)

    @property
    def ok(self) -> NDArray[np.bool_]:
        """Which runs are ok, shape (N,)."""
        return np.asarray(self.status) == "ok"

    @property
    def families(self) -> list[str]:
        """Names of the outcomes without their joints, in the order of the table."""
        return list(dict.fromkeys(family_of(name)[0] for name in self.outcomes))

    def joints(self, family: str) -> list[int]:
        """The joints k = 1..n that an outcome is there for; none for one of the whole device."""
        both = map(family_of, self.outcomes)
        return sorted(k for stem, k in both if stem == family and k is not None)

    def outcome(self, name: str) -> Array:
        """An outcome, shape (N,); for the name of a family, that of each run's worst joint.

        Raises:
            InputError: for an unknown name.
        """
        if name in self.outcomes:
            return self.outcomes[name]
        joints = self.joints(name)
        if not joints:
            raise InputError(
                f"study '{self.name}': no outcome '{name}', expected one of "
                f"{', '.join(self.families)}, or one joint of it as in rms_speed_error_2"
            )
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

    def checked_input(self, name: str) -> NDArray:
        """An input, shape (N,).

        Raises:
            InputError: for an unknown name.
        """
        if name not in self.inputs:
            raise InputError(
                f"study '{self.name}': no input '{name}', expected one of {', '.join(self.inputs)}"
            )
        return self.inputs[name]

    def select(self, runs: NDArray) -> StudyTable:
        """The table of some runs: their mask, shape (N,), or their indices."""
        return StudyTable(
            name=self.name,
            row=self.row[runs],
            inputs={name: values[runs] for name, values in self.inputs.items()},
            outcomes={name: values[runs] for name, values in self.outcomes.items()},
            status=self.status[runs],
            reason=self.reason[runs],
            duration=self.duration[runs],
        )

    def split(self, by: str | None) -> dict[str, StudyTable]:
        """A table for each level of a text input, by level; all under "all runs" for None.

        Raises:
            InputError: if there is no such input, or it is one of numbers.
        """
        if by is None:
            return {ALL_RUNS: self}
        values = self.checked_input(by)
        if not is_text(values):
            raise InputError(
                f"study '{self.name}': input '{by}' has numbers, expected one of texts"
                f"{_listed(self.text_inputs)}"
            )
        texts = values.astype(str)
        return {level: self.select(texts == level) for level in levels_of(values)}

    @property
    def text_inputs(self) -> list[str]:
        """Names of the inputs that are texts."""
        return [name for name, values in self.inputs.items() if is_text(values)]


ALL_RUNS = "all runs"


def is_column(name: str) -> bool:
    """Whether a column of the results has this name, so that no input may."""
    return name in COLUMNS or family_of(name)[0] in FAMILIES


def is_text(values: NDArray) -> bool:
    """Whether an input is one of texts; truth values count as such."""
    return values.dtype.kind not in "iuf"


def levels_of(values: NDArray) -> list[str]:
    """The different texts of an input, in the order in which they come."""
    return list(dict.fromkeys(map(str, values.tolist())))


def _listed(names: Iterable[str]) -> str:
    text = ", ".join(names)
    return f": {text}" if text else ", and there is none"
