"""Rows on disk as they finish: a line of JSON each, so that what is written stays readable."""

from __future__ import annotations

import fcntl
import json
import math
import os
from collections.abc import Iterator
from contextlib import AbstractContextManager
from dataclasses import astuple, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sdt_drake.io.errors import InputError
from sdt_drake.studies.table import STATUSES

JOURNAL = "rows.jsonl"
_KEYS = ("row", "status", "reason", "duration", "outcomes")  # of the fields of a Row


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


class Journal(AbstractContextManager["Journal"]):
    """The file of finished rows of a study folder, open for more. Only one process may have it.

    A line is complete once it ends; what a killed process left of its last one is cut off.
    """

    def __init__(self, folder: Path, count: int, width: int) -> None:
        """Open the journal of `count` rows with `width` outcomes, or begin it.

        Raises:
            InputError: if another process has it, or a line in it is none of a row.
        """
        self._path = folder / JOURNAL
        self._file = self._path.open("ab", buffering=0)
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self._offset, self._end = _places(self._path, count, width)
            self._file.truncate(self._end)
        except BlockingIOError:
            self._file.close()
            raise InputError(f"{folder}: another process runs this study") from None
        except BaseException:
            self._file.close()
            raise

    def __exit__(self, *_: object) -> None:
        self._file.close()

    @property
    def done(self) -> NDArray[np.bool_]:
        """Which rows are there, shape (count,)."""
        return self._offset >= 0

    def append(self, row: Row) -> None:
        """Write a row and wait until the disk has it.

        Raises:
            InputError: if that fails; what was there before stays, and nothing half-written.
        """
        line = _to_json(row)
        try:
            written = self._file.write(line)
            self._file.write(line[written:])  # where the disk is full, this says so
            os.fsync(self._file.fileno())
        except OSError as error:
            self._file.truncate(self._end)
            raise InputError(
                f"{self._path}: cannot be written ({error.strerror}); {self.done.sum()} of "
                f"{len(self._offset)} runs are kept, --resume goes on from there"
            ) from None
        self._offset[row.number] = self._end
        self._end += len(line)

    def rows(self) -> Iterator[Row]:
        """The rows that are there, in their order."""
        return _rows_at(self._path, self._offset)


def read_rows(folder: Path, count: int, width: int) -> Iterator[Row]:
    """The rows in a folder, in their order, while another process may go on writing.

    Raises:
        InputError: if there is no journal, or a line in it is none of a row.
    """
    path = folder / JOURNAL
    try:
        offsets, _ = _places(path, count, width)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    return _rows_at(path, offsets)


def _rows_at(path: Path, offsets: NDArray[np.int64]) -> Iterator[Row]:
    with path.open("rb") as file:
        for offset in offsets[offsets >= 0]:
            file.seek(offset)
            yield _from_json(file.readline())


def _places(path: Path, count: int, width: int) -> tuple[NDArray[np.int64], int]:
    """Where the complete line of each row starts, -1 for none; and where the last one ends."""
    offsets = np.full(count, -1, dtype=np.int64)
    offset = 0
    with path.open("rb") as file:
        for place, line in enumerate(file, 1):
            if not line.endswith(b"\n"):
                break
            number = _number_of(line, width)
            if not 0 <= number < count:
                raise InputError(
                    f"{path}, line {place}: is no row of this study; without that line --resume "
                    "runs the row anew"
                )
            offsets[number] = offset
            offset += len(line)
    return offsets, offset


def _number_of(line: bytes, width: int) -> int:
    """Of the row; -1 if the line is none."""
    try:
        row = _from_json(line)
        row.reason.encode()  # half a character raises a ValueError
        infinite = any(map(math.isinf, (row.duration, *row.outcomes)))
    except (ArithmeticError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return -1
    good = type(row.number) is int and row.status in STATUSES and not infinite
    good &= len(row.outcomes) == (width if row.status == "ok" else 0)
    return row.number if good else -1


def _to_json(row: Row) -> bytes:
    data = dict(zip(_KEYS, astuple(row), strict=True))
    data["outcomes"] = [None if math.isnan(value) else value for value in row.outcomes]
    return json.dumps(data, allow_nan=False).encode() + b"\n"


def _from_json(line: bytes) -> Row:
    number, status, reason, duration, values = map(json.loads(line).__getitem__, _KEYS)
    outcomes = tuple(math.nan if value is None else value for value in values)
    return Row(number, status, reason, duration, outcomes)
