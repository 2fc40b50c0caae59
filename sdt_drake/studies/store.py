"""The database of a study: what it is of, and its rows as they finish, whole whatever happens."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, closing, contextmanager
from pathlib import Path, PurePath
from typing import Any

from sdt_drake.io.errors import InputError, needing, one_line
from sdt_drake.io.files import replacing
from sdt_drake.studies.fields import Value
from sdt_drake.studies.table import Row

DATABASE = "study.sqlite"
ABOUT = "sdt_drake"
"""Key of what a study is of, in the metadata of its export."""

OF_0_3 = "rows.jsonl"
"""Rows of a study that version 0.3 or an older one ran."""

RESULTS = "results.parquet"
"""Export of a finished study, from which it can be read where its database is not."""

_KINDS = {"INTEGER": int, "TEXT": str, "REAL": float}
_PATIENCE = 60.0  # s; for another process that reads or writes a row
_GROUP = 4096  # rows that are in memory together
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
    """The database of a study folder, open.

    Attributes:
        path: of the file.
        about: what the study is of, as `create` got it.
        kinds: int, float or str, by name of the column: "row", inputs, "status", "reason",
            "duration", outcomes.
    """

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
                f"{folder}: holds an unfinished study of version 0.3 or an older one ({OF_0_3}), "
                "expected one of this version; run it anew into another folder"
                if (folder / OF_0_3).is_file()
                else f"{folder}: holds no study, expected the folder of `sdt-drake study`"
            )
        with self.reading():
            is_export = self.path.name == RESULTS
            self._database = _imported(self.path) if is_export else _connected(self.path)
            _check_tables(self._database)
            ((text,),) = self._database.execute("SELECT about FROM study")
            columns = self._database.execute("SELECT name, type FROM pragma_table_info('rows')")
            self.kinds = {name: _KINDS[kind] for name, kind in columns}
            self.about = _checked(json.loads(text))

    def __exit__(self, *_: object) -> None:
        self._database.close()

    def done(self) -> set[int]:
        """Numbers of the rows that are there."""
        with self.reading():
            return {number for (number,) in self._database.execute("SELECT row FROM rows")}

    def inputs(self, number: int) -> dict[str, Value]:
        """Inputs of a row; none of one that is not there."""
        with self.reading():
            found = self._database.execute("SELECT * FROM rows WHERE row = ?", (number,)).fetchone()
        columns = zip(self.kinds, found or (), strict=False)
        return {name: value for name, value in columns if name in self.about["inputs"]}

    def append(self, row: Row, inputs: Mapping[str, Value]) -> None:
        """Write a row and wait until the disk has it.

        Raises:
            InputError: if that fails; what was there before stays.
        """
        outcomes = row.outcomes or (None,) * len(self.about["outcomes"])
        values = (row.number, *inputs.values(), row.status, row.reason, row.duration, *outcomes)
        marks = ",".join("?" * len(values))  # SQLite takes NaN for NULL
        try:
            self._database.execute(f"INSERT INTO rows VALUES ({marks})", values)
        except sqlite3.Error as error:
            raise InputError(
                f"{self.path}: cannot be written ({error}); {len(self.done())} runs are kept, "
                "--resume goes on from there"
            ) from None

    def groups(self) -> Iterator[list[tuple[Any, ...]]]:
        """Some thousand rows at a time, in their order: the values of each column."""
        with self.reading():
            cursor = self._database.execute("SELECT * FROM rows ORDER BY row")
            while group := cursor.fetchmany(_GROUP):
                yield [*zip(*group, strict=True)]

    @contextmanager
    def reading(self) -> Iterator[None]:
        """Errors within are those of a file that cannot be used."""
        try:
            yield
        except _UNUSABLE as error:
            raise InputError(
                f"{self.path}: cannot be used ({one_line(error)}), expected the file that "
                "`sdt-drake study` wrote"
            ) from None


def create(folder: Path, about: Mapping[str, Any], texts: Mapping[str, bool]) -> None:
    """Write a database without rows.

    Args:
        folder: of the study.
        about: what it is of, as JSON takes it: "outcomes" are its outcomes.
        texts: for each input whether it is one of texts, not of numbers.

    Raises:
        InputError: if it cannot be written, or two inputs differ in capital letters alone.
    """
    with replacing(folder / DATABASE) as partial, closing(sqlite3.connect(partial)) as database:
        try:
            _fill(database, about, texts)
            database.commit()
        except sqlite3.Error as error:
            raise InputError(f"{folder}: no study can be begun there ({error})") from None


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
    """Refuse views and columns that SQLite would compute, maybe for ever."""
    if any(count for (count,) in database.execute(_COMPUTED)):
        raise ValueError("holds more than two tables of values")


def _checked(about: dict[str, Any]) -> dict[str, Any]:
    """What a study is of, nothing where it does not say so; its files are all in its folder."""
    about = {name: kind() for name, kind in _ABOUT.items()} | about
    for name, kind in _ABOUT.items():
        if not isinstance(about[name], kind):
            raise ValueError(f"{name} is no {kind.__name__}")
    for place in (*about["files"].values(), *about["contents"]):
        if PurePath(place).is_absolute() or ".." in PurePath(place).parts:
            raise ValueError(f"{place} is outside of the folder")
    return about


def _connected(path: Path) -> sqlite3.Connection:
    uri = f"{path.resolve().as_uri()}?mode=rw"
    return sqlite3.connect(uri, uri=True, isolation_level=None, timeout=_PATIENCE)


def _imported(results: Path) -> sqlite3.Connection:
    """Read the export of a finished study into a database in memory."""
    with needing(f"{results}: Parquet needs pyarrow", "sdt_drake[study]"):
        from pyarrow import parquet
    table = parquet.read_table(results)
    metadata = table.schema.metadata or {}
    if ABOUT.encode() not in metadata:
        raise ValueError("of another program")
    about = json.loads(metadata[ABOUT.encode()])
    if (old := results.with_name("state.json")).is_file():  # of version 0.3
        about |= {"contents": {}} | json.loads(old.read_text(encoding="utf-8"))
    database = sqlite3.connect(":memory:")
    texts = {name: f"{table[name].type}" == "string" for name in about["inputs"]}
    _fill(database, about, texts)
    marks = ",".join("?" * table.num_columns)
    values = zip(*(column.to_pylist() for column in table.columns), strict=True)
    database.executemany(f"INSERT INTO rows VALUES ({marks})", values)
    return database
