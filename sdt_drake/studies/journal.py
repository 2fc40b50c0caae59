"""Rows on disk as they finish: a line of JSON each, so that what is written stays readable."""

from __future__ import annotations

import fcntl
import json
import math
import os
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sdt_drake.errors import InputError
from sdt_drake.studies.runs import Row
from sdt_drake.studies.table import STATUSES

JOURNAL = "rows.jsonl"


class Journal:
    """The file of finished rows of a study folder, open for more. Only one process may have it.

    A line is complete once it ends; what a killed process left of its last one is cut off.
    """

    def __init__(self, folder: Path, count: int, width: int) -> None:
        """Open the journal of `count` rows with `width` outcomes, or begin it.

        Raises:
            InputError: if another process has it, or a line in it is none of a row.
        """
        self._path = folder / JOURNAL
        self._file = self._path.open("a+b")
        try:
            self._lock()
            self._offset, self._end = _places(self._file, self._path, count, width)
            self._file.truncate(self._end)
        except BaseException:
            self._file.close()
            raise

    def _lock(self) -> None:
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(f"{self._path.parent}: another process runs this study") from None
        except OSError as error:
            raise InputError(f"{self._path}: cannot be locked ({error.strerror})") from None

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    @property
    def done(self) -> NDArray[np.bool_]:
        """Which rows are there, shape (count,)."""
        return self._offset >= 0

    def append(self, rows: Iterable[Row]) -> None:
        """Write rows and wait until the disk has them.

        Raises:
            InputError: if that fails; what was there before stays, and nothing half-written.
        """
        text, offsets, end = [], {}, self._end
        for row in rows:
            line = _to_json(row).encode() + b"\n"
            text.append(line)
            offsets[row.number] = end
            end += len(line)
        try:
            _write(self._file.fileno(), b"".join(text))
            os.fsync(self._file.fileno())
        except OSError as error:
            self._file.truncate(self._end)
            raise InputError(
                f"{self._path}: cannot be written ({error.strerror}); {self.done.sum()} of "
                f"{len(self._offset)} runs are kept, --resume goes on from there"
            ) from None
        self._end = end
        for number, offset in offsets.items():
            self._offset[number] = offset

    def rows(self) -> Iterator[Row]:
        """The rows that are there, in their order."""
        return _rows_at(self._file, self._offset)


def read_rows(folder: Path, count: int, width: int) -> Iterator[Row]:
    """The rows in a folder, in their order, while another process may go on writing.

    Raises:
        InputError: if there is no journal, or a line in it is none of a row.
    """
    path = folder / JOURNAL
    try:
        file = path.open("rb")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    with file:
        offsets, _ = _places(file, path, count, width)
        yield from _rows_at(file, offsets)


def _rows_at(file, offsets: NDArray[np.int64]) -> Iterator[Row]:
    for offset in offsets[offsets >= 0]:
        file.seek(offset)
        yield _from_json(file.readline())


def _places(file, path: Path, count: int, width: int) -> tuple[NDArray[np.int64], int]:
    """Where the complete line of each row starts, -1 for none; and where the last one ends."""
    offsets = np.full(count, -1, dtype=np.int64)
    file.seek(0)
    offset, place = 0, 1
    while (line := file.readline()).endswith(b"\n"):
        number = _checked_number(line, width)
        if not 0 <= number < count:
            raise InputError(
                f"{path}, line {place}: is no row of this study; without that line --resume runs "
                "the row anew"
            )
        offsets[number] = offset
        offset, place = offset + len(line), place + 1
    return offsets, offset


def _checked_number(line: bytes, width: int) -> int:
    """Of the row; -1 if the line is none."""
    try:
        row = _from_json(line)
        types = (int, str, str, float)
        own = (row.number, row.status, row.reason, row.duration)
        good = all(type(value) is kind for value, kind in zip(own, types, strict=True))
        numbers = (row.duration, *row.outcomes)
        good &= all(type(value) is float and not math.isinf(value) for value in numbers)
        good &= row.status in STATUSES
        good &= len(row.outcomes) == (width if row.status == "ok" else 0)
        row.reason.encode()  # half a character raises a ValueError
        return row.number if good else -1
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return -1


def _write(descriptor: int, data: bytes) -> None:
    while data:
        data = data[os.write(descriptor, data) :]


def _to_json(row: Row) -> str:
    return json.dumps(
        {
            "row": row.number,
            "status": row.status,
            "reason": row.reason,
            "duration": row.duration,
            "outcomes": [None if math.isnan(value) else value for value in row.outcomes],
        },
        allow_nan=False,
    )


def _from_json(line: bytes) -> Row:
    data = json.loads(line)
    outcomes = tuple(math.nan if value is None else value for value in data["outcomes"])
    return Row(data["row"], data["status"], data["reason"], data["duration"], outcomes)
