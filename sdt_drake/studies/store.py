"""The database of a study: its metadata, and each row as it finishes.

A row is written whole or not at all, even if the process is killed.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, closing, contextmanager
from math import inf
from pathlib import Path, PurePath
from typing import Any

from sdt_drake.io.errors import InputError, needing, one_line
from sdt_drake.io.files import replacing
from sdt_drake.studies.fields import Value
from sdt_drake.studies.table import STATUSES, Row

DATABASE = "study.sqlite"
ABOUT = "sdt_drake"
"""Key of the study's metadata in its Parquet export."""

ROWS_OF_0_3 = "rows.jsonl"
"""File of rows of an unfinished study of version 0.3 or older."""

RESULTS = "results.parquet"
"""Export of a finished study; it is read where the database is missing."""

_KINDS = {"INTEGER": int, "TEXT": str, "REAL": float}
_STORED: dict[type, set[type]] = {int: {int}, str: {str}, float: {float, type(None)}}
"""Types of the stored values by type of the column; SQLite stores NaN as NULL."""
_LOCK_TIMEOUT = 60.0  # s; for another process that reads or writes a row
_GROUP_ROWS = 4096  # rows in memory at the same time
_UNUSABLE = (
    sqlite3.Error, ValueError, LookupError, TypeError, OverflowError, RecursionError, MemoryError,
)  # fmt: skip
_ABOUT = {
    "inputs": list, "outcomes": list, "fingerprint": str, "versions": dict, "files": dict,
    "contents": dict,
}  # fmt: skip
_COMPUTED = """
    SELECT count(*) FROM sqlite_master WHERE sql NOT LIKE 'CREATE TABLE %'
    UNION ALL SELECT count(*) FROM pragma_table_xinfo('study') WHERE hidden
    UNION ALL SELECT count(*) FROM pragma_table_xinfo('rows') WHERE hidden
"""


class Store(AbstractContextManager["Store"]):
    """The open database of a study folder."""

    path: Path
    """Path of the file."""
    about: dict[str, Any]
    """Metadata of the study, as given to `create`."""
    kinds: dict[str, type]
    """Type of each column, int, float or str, by name: "row", inputs, "status", "reason",
    "duration", outcomes."""

    def __init__(self, folder: Path) -> None:
        """Open the database of a folder.

        Raises:
            InputError: if there is none, or it cannot be used.
        """
        self.path = folder / DATABASE
        if not self.path.is_file():
            self.path = folder / RESULTS
        if not self.path.is_file():
            raise InputError(
                f"{folder}: contains an unfinished study of version 0.3 or older ({ROWS_OF_0_3}); "
                "run it again into another folder"
                if (folder / ROWS_OF_0_3).is_file()
                else f"{folder}: contains no study, expected the folder of `sdt-drake study`"
            )
        with self.reading():
            is_export = self.path.name == RESULTS
            self._database = _imported(self.path) if is_export else _connected(self.path)
            _check_tables(self._database)
            ((text,),) = self._database.execute("SELECT about FROM study")
            columns = self._database.execute("SELECT name, type FROM pragma_table_info('rows')")
            self.kinds = {name: _KINDS[kind] for name, kind in columns}
            self.about = _checked(json.loads(text), self.kinds)

    def __exit__(self, *_: object) -> None:
        self._database.close()

    def done(self) -> set[int]:
        """Return the numbers of the rows in the database."""
        with self.reading():
            return {number for (number,) in self._database.execute("SELECT row FROM rows")}

    def check_numbers(self, count: int) -> None:
        """Raise InputError if a row's number is not one of 0 to `count` - 1."""
        with self.reading():
            if others := self.done() - {*range(count)}:
                raise ValueError(f"row {min(others)}, expected 0 to {count - 1}")

    def inputs(self, number: int) -> dict[str, Value]:
        """Return the inputs of a row by name; empty if the row is not in the database."""
        for columns in self._groups("SELECT * FROM rows WHERE row = ?", number):
            row = zip(self.kinds, columns, strict=True)
            return {name: value for name, (value,) in row if name in self.about["inputs"]}
        return {}

    def append(self, row: Row, inputs: Mapping[str, Value]) -> None:
        """Write a row and wait until it is on the disk.

        Raises:
            InputError: if that fails. Earlier rows stay.
        """
        outcomes = row.outcomes or (None,) * len(self.about["outcomes"])
        values = (row.number, *inputs.values(), row.status, row.reason, row.duration, *outcomes)
        marks = ",".join("?" * len(values))  # SQLite stores NaN as NULL
        try:
            self._database.execute(f"INSERT INTO rows VALUES ({marks})", values)
        except sqlite3.Error as error:
            raise InputError(
                f"{self.path}: cannot be written ({error}); {len(self.done())} runs are kept, "
                "continue with --resume"
            ) from None

    def groups(self) -> Iterator[list[tuple[Any, ...]]]:
        """Yield the columns of all rows, sorted by number, in groups of 4096 rows."""
        return self._groups("SELECT * FROM rows ORDER BY row")

    def _groups(self, query: str, *values: int) -> Iterator[list[tuple[Any, ...]]]:
        with self.reading():
            cursor = self._database.execute(query, values)
            while group := cursor.fetchmany(_GROUP_ROWS):
                columns = [*zip(*group, strict=True)]
                _check_rows(dict(zip(self.kinds, columns, strict=True)), self.kinds)
                yield columns

    @contextmanager
    def reading(self) -> Iterator[None]:
        """Raise the block's errors as InputError: the file cannot be used."""
        try:
            yield
        except InputError:
            raise
        except _UNUSABLE as error:
            raise InputError(
                f"{self.path}: cannot be used ({one_line(error)}), expected the file that "
                "`sdt-drake study` wrote"
            ) from None


def create(folder: Path, about: Mapping[str, Any], texts: Mapping[str, bool]) -> None:
    """Write a database without rows.

    Args:
        folder: folder of the study.
        about: metadata that JSON can hold; "outcomes" are the names of the outcomes.
        texts: for each input, whether its values are texts.

    Raises:
        InputError: if it cannot be written, or two inputs differ only in upper and lower case.
    """
    with replacing(folder / DATABASE) as partial, closing(sqlite3.connect(partial)) as database:
        try:
            _fill(database, about, texts)
            database.commit()
        except sqlite3.Error as error:
            raise InputError(f"{folder}: cannot begin a study here ({error})") from None


def _fill(
    database: sqlite3.Connection, about: Mapping[str, Any], texts: Mapping[str, bool]
) -> None:
    columns = {"row": "INTEGER PRIMARY KEY"}
    columns |= {name: "TEXT" if is_text else "REAL" for name, is_text in texts.items()}
    columns |= {"status": "TEXT", "reason": "TEXT", "duration": "REAL"}
    columns |= dict.fromkeys(about["outcomes"], "REAL")
    quoted = (f'"{name.replace(chr(34), 2 * chr(34))}" {kind}' for name, kind in columns.items())
    database.execute("CREATE TABLE study (about TEXT)")
    database.execute("INSERT INTO study VALUES (?)", (json.dumps(about),))
    database.execute(f"CREATE TABLE rows ({', '.join(quoted)})")


def _check_tables(database: sqlite3.Connection) -> None:
    """Raise ValueError for views and computed columns, whose evaluation might never end."""
    if any(count for (count,) in database.execute(_COMPUTED)):
        raise ValueError("contains more than two tables of values")


def _check_rows(columns: Mapping[str, tuple[Any, ...]], kinds: Mapping[str, type]) -> None:
    """Raise ValueError for values that no run writes; SQLite stores any value in any column."""
    for name, values in columns.items():
        if not set(map(type, values)) <= _STORED[kinds[name]] or {inf, -inf} & {*values}:
            raise ValueError(f"{name} contains values that are no {kinds[name].__name__}")
    if others := {*columns["status"]} - {*STATUSES}:
        raise ValueError(f"status {min(others)!r}, expected one of {', '.join(STATUSES)}")


def _checked(about: dict[str, Any], kinds: Mapping[str, type]) -> dict[str, Any]:
    """Return the metadata with defaults for missing entries; check types, columns and paths."""
    about = {name: kind() for name, kind in _ABOUT.items()} | about
    for name, kind in _ABOUT.items():
        if not isinstance(about[name], kind):
            raise ValueError(f"{name} is not a {kind.__name__}")
        inner = about[name].values() if kind is dict else about[name]
        if not all(isinstance(text, str) for text in inner):
            raise ValueError(f"{name} contains other values than texts")
    columns = {"row": int, **{name: kinds.get(name) for name in about["inputs"]}}
    columns |= {"status": str, "reason": str, "duration": float}
    columns |= dict.fromkeys(about["outcomes"], float)
    if [*columns.items()] != [*kinds.items()]:
        raise ValueError("its columns are not those of its inputs and outcomes")
    for place in (*about["files"].values(), *about["contents"]):
        if PurePath(place).is_absolute() or ".." in PurePath(place).parts:
            raise ValueError(f"{place} is outside the folder")
    return about


def _connected(path: Path) -> sqlite3.Connection:
    uri = f"{path.resolve().as_uri()}?mode=rw"
    return sqlite3.connect(uri, uri=True, isolation_level=None, timeout=_LOCK_TIMEOUT)


def _imported(results: Path) -> sqlite3.Connection:
    """Read the export of a finished study into a database in memory."""
    with needing(f"{results}: Parquet needs pyarrow", "sdt_drake[study]"):
        from pyarrow import parquet
    table = parquet.read_table(results)
    metadata = table.schema.metadata or {}
    if ABOUT.encode() not in metadata:
        raise ValueError("written by another program")
    about = json.loads(metadata[ABOUT.encode()])
    if (old := results.with_name("state.json")).is_file():  # version 0.3 wrote it
        about |= {"contents": {}} | json.loads(old.read_text(encoding="utf-8"))
    database = sqlite3.connect(":memory:")
    texts = {name: f"{table[name].type}" == "string" for name in about["inputs"]}
    _fill(database, about, texts)
    marks = ",".join("?" * table.num_columns)
    values = zip(*(column.to_pylist() for column in table.columns), strict=True)
    database.executemany(f"INSERT INTO rows VALUES ({marks})", values)
    return database
