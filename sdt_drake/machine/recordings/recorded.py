"""A recording in SI units, joint side."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from sdt_drake.io.arrays import Array, Index
from sdt_drake.io.errors import InputError
from sdt_drake.machine.recordings.columns import Columns

_GAP = 4.0  # length of a gap over the median step


@dataclass(frozen=True, eq=False)
class Recorded:
    """A recording of a robot, **joint side**, as it was sampled."""

    path: Path
    """Path of the file."""
    time: Array
    """Increasing times [s], shape (N,); steps may differ."""
    signals: dict[str, Array]
    """The recorded ones of RECORDED_SIGNALS [rad, rad/s, rad/s², N m], each of shape (N, n)."""
    of_links: bool = False
    """True if q and v belong to the links, as `simulate` writes them; False for encoders."""
    time_factor: float | None = 1.0
    """Assumed unit of the time column [s]; None without one."""
    columns: Columns | None = None
    """Mapping of its file; None for arrays."""
    by_names: Mapping[str, Sequence[str]] = field(default_factory=dict)
    """Columns of a signal in the order of the joints by the names in the file, where the mapping
    has another order."""
    notes: tuple[str, ...] = ()
    """Changes of the data on reading, as sentences."""

    @cached_property
    def period(self) -> float:
        """The median step of time [s]."""
        return float(np.median(np.diff(self.time)))

    @cached_property
    def gaps(self) -> Index:
        """Indices of the rows before a gap in time, from 0."""
        return np.flatnonzero(np.diff(self.time) > _GAP * self.period)

    @property
    def gaps_in_words(self) -> str:
        """Number of gaps, and the place of the longest one; "" for none."""
        if not len(self.gaps):
            return ""
        steps = np.diff(self.time)
        i = self.gaps[steps[self.gaps].argmax()]
        longest = f"the longest {steps[i]:.3g} s at {self.time[i]:.3g} s"
        return f"{len(self.gaps)} gap(s) in time, {longest}"


def check_different(recordings: Sequence[Recorded]) -> None:
    """Refuse two recordings with the same data.

    Raises:
        InputError: Two recordings are equal; the error gives both files.
    """
    for i, one in enumerate(recordings):
        for other in recordings[:i]:
            pairs = ((values, other.signals.get(name)) for name, values in one.signals.items())
            if len(one.signals) == len(other.signals) and all(
                x is y or (y is not None and np.array_equal(x, y)) for x, y in pairs
            ):
                raise InputError(
                    f"{one.path}: has the same data as {other.path}, expected another recording"
                )
