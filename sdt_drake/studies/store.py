"""The database of a study: what the study is, and each row as it finishes.

A row is written whole or not at all, even if the process is killed.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, closing, contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import AfterValidator, TypeAdapter

from sdt_drake.io.errors import InputError, needing, one_line
from sdt_drake.io.files import replacing
from sdt_drake.studies.table import STATUSES, Row, Value, pandas

if TYPE_CHECKING:
    import pandas as pd

DATABASE = "study.sqlite"
ABOUT = "sdt_drake"
"""Key of the study's `About` in the metadata of its Parquet export."""

RESULTS = "results.parquet"
"""Export of a finished study; it is read where the database is missing."""

_INFERRED = {"INTEGER": "integer", "TEXT": "string", "REAL": "floating"}
"""Type of the values of a column in pandas, by its type in the database."""

_LOCK_TIMEOUT = 60.0  # s; for another process that reads or writes a row
_GROUP_ROWS = 4096  # rows in memory as objects of Python
_UNUSABLE = (
    sqlite3.Error, OSError, ValueError, LookupError, TypeError, OverflowError, RecursionError,
    MemoryError,
)  # fmt: skip
_COMPUTED = """
    SELECT count(*) FROM sqlite_master WHERE sql NOT LIKE 'CREATE TABLE %'
    UNION ALL SELECT count(*) FROM pragma_table_xinfo('study') WHERE hidden
    UNION ALL SELECT count(*) FROM pragma_table_xinfo('rows') WHERE hidden
"""


def _inside(place: str) -> str:
    if PurePath(place).is_absolute() or ".." in PurePath(place).parts:
        raise ValueError(f"{place} is outside the folder")
    return place


_Place = Annotated[str, AfterValidator(_inside)]


@dataclass(frozen=True)
class About:
    """A study's identity, and what computes its rows."""

    contents: dict[_Place, str] = field(default_factory=dict)
    """Identity of the study: equal contents give equal rows. Texts of study.yaml and scenario.yaml,
    and SHA-256 of all other files, by place in the study's folder or package:// name."""
    files: dict[str, _Place] = field(default_factory=dict)
    """Place in the study's folder of each file outside the package, by its name in the study."""
    versions: dict[str, str] = field(default_factory=dict)
    """Versions of the packages that compute the rows."""


class Store(AbstractContextManager["Store"]):
    """The open database of a study folder."""

    path: Path
    """Path of the file."""
    about: About
    """Identity of the study, as given to `create`."""
    input_names: list[str]
    """Names of the inputs, as columns have them."""
    outcome_names: list[str]
    """Names of the outcomes, as columns have them."""

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
                f"{folder}: contains no study, expected the folder of `sdt-drake study`"
            )
        with self.reading():
            is_export = self.path.name == RESULTS
            uri = f"{self.path.resolve().as_uri()}?mode=rw"
            self._database = (
                _imported(self.path)
                if is_export
                else sqlite3.connect(uri, uri=True, isolation_level=None, timeout=_LOCK_TIMEOUT)
            )
            if any(count for (count,) in self._database.execute(_COMPUTED)):
                raise ValueError("contains more than two tables of values")
            ((text,),) = self._database.execute("SELECT about FROM study")
            self.about = TypeAdapter(About).validate_json(text)
            columns = self._database.execute("SELECT name, type FROM pragma_table_info('rows')")
            self._kinds = dict(columns.fetchall())
            names = [*self._kinds]
            end = names.index("status")
            self.input_names, self.outcome_names = names[1:end], names[end + 3 :]
            texts = {name: self._kinds[name] == "TEXT" for name in self.input_names}
            if [*self._kinds.items()] != [*_columns(texts, self.outcome_names).items()]:
                raise ValueError("its columns are not those of inputs and outcomes")

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
        found = self.runs(number)[self.input_names].to_dict("records")
        return found[0] if found else {}

    def append(self, row: Row, inputs: Mapping[str, Value]) -> None:
        """Write a row and wait until it is on the disk.

        Raises:
            InputError: if that fails. Earlier rows stay.
        """
        outcomes = row.outcomes or (None,) * len(self.outcome_names)
        values = (row.number, *inputs.values(), row.status, row.reason, row.duration, *outcomes)
        marks = ",".join("?" * len(values))  # SQLite stores NaN as NULL
        try:
            self._database.execute(f"INSERT INTO rows VALUES ({marks})", values)
        except sqlite3.Error as error:
            raise InputError(
                f"{self.path}: cannot be written ({error}); {len(self.done())} runs are kept, "
                "continue with resume=True"
            ) from None

    def runs(self, number: int | None = None) -> pd.DataFrame:
        """Return the finished runs in the order of their rows.

        Args:
            number: the only row to return; None for all.

        Returns:
            The table that `StudyTable.runs` describes.

        Raises:
            InputError: for values that no run writes.
        """
        pd, where = pandas(), "" if number is None else f"WHERE row = {number:d}"
        query = f"SELECT * FROM rows {where} ORDER BY row"
        with self.reading():
            parts = pd.read_sql_query(query, self._database, chunksize=_GROUP_ROWS)
            return pd.concat(map(self._checked, parts)).set_index("row")

    def _checked(self, runs: pd.DataFrame) -> pd.DataFrame:
        """Return rows with numbers as floats; SQLite stores any value in any column."""
        infer = pandas().api.types.infer_dtype
        numbers = [name for name, kind in self._kinds.items() if kind == "REAL"]
        for name, kind in self._kinds.items():
            values = runs[name].dropna() if name in numbers else runs[name]  # NULL stands for NaN
            is_kind = infer(values, skipna=False) in (_INFERRED[kind], "empty")
            if not is_kind or values.isna().any():
                raise ValueError(f"{name} contains other values than those of a run")
        if others := {*runs["status"]} - {*STATUSES}:
            raise ValueError(f"status {min(others)!r}, expected one of {', '.join(STATUSES)}")
        runs = runs.astype(dict.fromkeys(numbers, float))
        if np.isinf(runs[numbers]).any(axis=None):
            raise ValueError("contains infinite numbers")
        return runs

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


def create(folder: Path, about: About, texts: Mapping[str, bool], outcomes: Sequence[str]) -> None:
    """Write a database without rows.

    Args:
        folder: folder of the study.
        about: identity of the study.
        texts: for each input, whether its values are texts.
        outcomes: names of the outcomes.

    Raises:
        InputError: if it cannot be written, or two inputs differ only in upper and lower case.
    """
    with replacing(folder / DATABASE) as partial, closing(sqlite3.connect(partial)) as database:
        columns = _columns(texts, outcomes) | {"row": "INTEGER PRIMARY KEY"}
        quoted = (f'"{name.replace(chr(34), 2 * chr(34))}" {x}' for name, x in columns.items())
        try:
            database.execute(f"CREATE TABLE rows ({', '.join(quoted)})")
            _describe(database, json.dumps(asdict(about)))
            database.commit()
        except sqlite3.Error as error:
            raise InputError(f"{folder}: cannot begin a study here ({error})") from None


def _columns(texts: Mapping[str, bool], outcomes: Sequence[str]) -> dict[str, str]:
    """Return the type of each column in the database, by name."""
    inputs = {name: "TEXT" if is_text else "REAL" for name, is_text in texts.items()}
    own = {"status": "TEXT", "reason": "TEXT", "duration": "REAL"}
    return {"row": "INTEGER", **inputs, **own, **dict.fromkeys(outcomes, "REAL")}


def _describe(database: sqlite3.Connection, about: str) -> None:
    database.execute("CREATE TABLE study (about TEXT)")
    database.execute("INSERT INTO study VALUES (?)", (about,))


def _imported(results: Path) -> sqlite3.Connection:
    """Read the export of a finished study into a database in memory."""
    with needing(f"{results}: Parquet needs pyarrow", "sdt_drake[study]"):
        from pyarrow import parquet
    table = parquet.read_table(results)
    metadata = table.schema.metadata or {}
    if ABOUT.encode() not in metadata:
        raise ValueError("written by another program")
    database = sqlite3.connect(":memory:")
    table.to_pandas().to_sql("rows", database, index=False)
    about = json.loads(metadata[ABOUT.encode()])
    if (old := results.with_name("state.json")).is_file():  # version 0.3 wrote it
        about |= json.loads(old.read_text(encoding="utf-8"))
    _describe(database, json.dumps(about))
    return database
