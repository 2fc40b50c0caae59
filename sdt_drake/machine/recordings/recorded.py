"""A recording in SI units, joint side."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sdt_drake.io.arrays import Array, Index
from sdt_drake.io.errors import InputError

_GAP = 4.0  # of the usual step


@dataclass(frozen=True, eq=False)
class Recorded:
    """A recording of a robot, **joint side**, as it was sampled.

    Attributes:
        path: of the file.
        time: growing, not always in equal steps [s], shape (N,).
        signals: those of RECORDED_SIGNALS that there are [rad, rad/s, rad/s², N m], each of shape
            (N, n).
        of_links: whether q and v are those of the links, as `simulate` writes them, and not of what
            encoders are on.
        time_factor: what a 1 in the column of times was taken for [s]; None without such a column.
        notes: what was done to read it, in words.
    """

    path: Path
    time: Array
    signals: dict[str, Array]
    of_links: bool = False
    time_factor: float | None = 1.0
    notes: tuple[str, ...] = ()

    @property
    def gaps(self) -> Index:
        """Rows, from 0, after which nobody knows what happened until the next one."""
        steps = np.diff(self.time)
        return np.flatnonzero(steps > _GAP * np.median(steps))

    @property
    def gaps_in_words(self) -> str:
        """How many gaps there are, and where the longest one is; "" for none."""
        if not len(self.gaps):
            return ""
        steps = np.diff(self.time)
        i = self.gaps[steps[self.gaps].argmax()]
        longest = f"the longest {steps[i]:.3g} s at {self.time[i]:.3g} s"
        return f"{len(self.gaps)} gap(s) in time, {longest}"


def check_different(recordings: Sequence[Recorded]) -> None:
    """Refuse a recording that says what another one does, whatever their files are called.

    Raises:
        InputError: naming both files.
    """
    for i, one in enumerate(recordings):
        for other in recordings[:i]:
            pairs = ((values, other.signals.get(name)) for name, values in one.signals.items())
            if len(one.signals) == len(other.signals) and all(
                x is y or (y is not None and np.array_equal(x, y)) for x, y in pairs
            ):
                raise InputError(
                    f"{one.path}: holds the same as {other.path}, expected another recording"
                )
