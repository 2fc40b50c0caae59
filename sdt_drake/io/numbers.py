"""Rectangular tables of numbers from text files with any delimiter, and from binary files."""

import contextlib
import itertools
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, time
from pathlib import Path

import numpy as np

from sdt_drake.io.arrays import Array, Index
from sdt_drake.io.errors import MAX_NUMBER, InputError, at_most
from sdt_drake.io.files import checked_input
from sdt_drake.io.formats import BINARY, MAX_NUMBERS, read_binary
from sdt_drake.io.list_cells import spread, spread_names

MAX_BYTES = 1_000_000_000
"""Largest size of a table file: a recording of an hour."""

_SEPARATORS = {"|": "pipes", ",": "commas", ";": "semicolons", "\t": "tabs", " ": "spaces"}

DAY = 86400.0
"""Duration of a day [s]. Times of day are read as numbers below it, dates as larger ones."""

_DATES = ("%d.%m.%Y %H:%M:%S", "%m/%d/%Y %H:%M:%S", "%d/%m/%Y %H:%M:%S", "%Y/%m/%d %H:%M:%S")
"""Forms of dates that loggers write beside ISO 8601, without fractions of seconds."""


@dataclass(frozen=True)
class Style:
    """The format of a text file with columns."""

    delimiter: str | None = ","
    """Separator of the columns; None: spaces or tabs."""
    header: bool = True
    """A first line with the names of the columns, perhaps after a #."""
    units: bool = False
    """A line with units after the names."""
    skip: int = 0
    """Number of lines to skip at the start; blank lines do not count."""
    decimal: str = "."
    """Decimal mark, "." or ","."""
    encoding: str = "utf-8"
    """Name of a text encoding of Python."""


@dataclass(frozen=True, eq=False)
class Numbers:
    """The content of a file of columns."""

    path: Path
    """The file."""
    names: list[str]
    """Names of the columns; "1", "2", ... without a header."""
    data: Array
    """Values, shape (rows, columns). Some may be NaN or infinite."""
    style: Style | None
    """The format of a text file; None for a binary file."""
    cut: str = ""
    """The last line, if it is incomplete and was ignored; otherwise ""."""
    texts: Mapping[int, tuple[int, str]] = field(default_factory=dict)
    """Row and text of the first cell of each column that is neither number nor date."""
    dates: frozenset[int] = frozenset()
    """Columns with dates or times of day, whose values are seconds."""
    kept: Index | None = None
    """The rows of the file that `data` has, from 0; None: all."""
    left_out: int = 0
    """Number of rows that `complete` left out."""
    lists: Sequence[str] = ()
    """Sentences on columns whose cells hold lists."""

    @property
    def notes(self) -> tuple[str, ...]:
        """One sentence for each part of the file that was ignored."""
        notes = [*self.lists]
        if self.cut:
            notes += [f"the last line is incomplete and was ignored: {self.cut[:40]}"]
        if self.left_out:
            notes += [f"{self.left_out} row(s) that lack a number were left out"]
        return tuple(notes)

    def complete(self, columns: Iterable[int]) -> "Numbers":
        """Return the rows with finite numbers in all of these columns."""
        kept = np.flatnonzero(np.isfinite(self.data[:, [*columns]]).all(axis=1))
        if len(kept) < 2:
            raise InputError(f"{self.path}: fewer than two rows have a number in each column")
        left_out = len(self.data) - len(kept)
        return replace(self, data=self.data[kept], kept=kept, left_out=left_out, texts={})

    def place(self, row: int) -> str:
        """Return file and line of a row, counted from 0."""
        row = row if self.kept is None else int(self.kept[row])
        if self.style is None:
            return f"{self.path}, row {row + 1}"
        line = next(itertools.islice(_rows(self.path, self.style), int(row), None))[0]
        return f"{self.path}, line {line}"

    def check_finite(
        self, columns: Iterable[int], *, dates: bool = False, or_else: str = ""
    ) -> None:
        """Check that columns have finite numbers only, none beyond MAX_NUMBER.

        With `dates`, they may also be dates, and any number of seconds or parts of it.

        Raises:
            InputError: another value; the message has its line and column, and `or_else` for NaN.
        """
        for column in columns:
            largest = np.finfo(float).max if dates else MAX_NUMBER
            bad = np.flatnonzero(~(np.abs(self.data[:, column]) <= largest))
            if column in self.dates and not dates:
                raise InputError(f"{self.path}: {self.names[column]} has dates, expected numbers")
            row, text = self.texts.get(column, (-1, ""))
            if len(bad) and row == bad[0]:
                raise InputError(f"{self.place(row)}: {_no_number(text, ' or decimal: comma')}")
            if len(bad):
                value = float(self.data[bad[0], column])
                raise InputError(
                    f"{self.place(bad[0])}: {self.names[column]} is {value}, "
                    f"expected a finite number{at_most(value)}" + or_else * bool(np.isnan(value))
                )


def read_numbers(
    path: str | Path,
    style: Style = Style(),
    *,
    min_rows: int = 2,
    logged: bool = False,
    max_numbers: int = MAX_NUMBERS,
    max_bytes: int = MAX_BYTES,
) -> Numbers:
    """Read a rectangular table of numbers from .mat, .parquet or text.

    Args:
        path: the file.
        style: format of a text file.
        min_rows: smallest number of rows.
        logged: accept files of data loggers. Texts and empty cells are read as NaN, dates as
            seconds, and an incomplete last line is ignored.
        max_numbers: largest count of numbers.
        max_bytes: largest size of the file.

    Raises:
        InputError: no such file, another encoding or delimiter, a text for a number, a row of
            another length, or a larger file. The message has the line.
    """
    path = checked_input(Path(path), max_bytes)
    if path.suffix in BINARY:
        columns = read_binary(path)
        names = sorted(columns, key=lambda name: name != "time")  # MATLAB may change the order
        if not names or len(columns[names[0]]) < 2:
            raise InputError(f"{path}: fewer than two rows")
        return Numbers(path, names, np.stack([columns[name] for name in names], axis=1), None)
    start = list(itertools.islice(_rows(path, style), min_rows))
    head = None
    if style.header:
        _, head = next(itertools.islice(lines(path, style.encoding), style.skip, None), (0, ""))
    if len(start) < min_rows:
        raise InputError(f"{path}: fewer than {'two rows' if min_rows == 2 else 'a row'}")
    first = start[0][1] if head is None else head
    cells = start[0][1].split(style.delimiter)
    names, lists = header_cells(first, style.delimiter, len(cells)), list[str]()
    if head is not None:
        names, lists = spread_names(names, next(_raw(path, style))[1], style.delimiter)
    if len(names) == 1 or len(cells) == 1:
        _check_delimiter(path, start[0][1] if len(cells) == 1 else first, style, logged=logged)
    if logged and len(cells) == len(names) + 1 and not cells[-1].strip():
        names.append("")  # each row ends with a delimiter
    data, odd = _loaded(path, style, len(names), max_numbers), _Odd()
    if data is None and logged:
        odd = _odd_cells(path, style, len(names))
        data = _loaded(path, style, len(names), max_numbers, odd.columns, odd.rows)
    if data is None or len(data) < min_rows:
        raise _bad_line(path, len(names), style, logged=logged)
    if not style.header:
        names = [str(k + 1) for k in range(data.shape[1])]
    dates = frozenset(odd.dates)
    return Numbers(path, names, data, style, odd.cut, odd.texts, dates, lists=lists)


def lines(path: Path, encoding: str) -> Iterator[tuple[int, str]]:
    """Yield number and text of each line that is not blank.

    Raises:
        InputError: the file has another encoding.
    """
    utf8 = encoding.lower().replace("_", "-") in ("utf-8", "utf8")
    other = InputError(
        f"{path}: cannot be read as {'UTF-8' if utf8 else encoding}, expected a CSV file saved as "
        "UTF-8"
    )
    try:
        # Spreadsheets write a byte-order mark first.
        with path.open(encoding="utf-8-sig" if utf8 else encoding) as file:
            for number, line in enumerate(file, start=1):
                if "\0" in line:  # UTF-16 without a byte-order mark
                    raise other
                if line.strip():
                    yield number, line
    except UnicodeError:
        raise other from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None


def header_cells(line: str, delimiter: str | None, width: int) -> list[str]:
    """Return the names in a header of a table with so many columns.

    Names between runs of spaces may contain single ones.
    """
    line = line.strip().lstrip("#")
    names = line.split(delimiter)
    if delimiter is None and len(names) != width:
        names = re.split(r"\s{2,}|\t", line.strip())
    return [_unquoted(name) for name in names]


def is_number(cell: str) -> bool:
    """Check whether a cell of a table is a number."""
    try:
        float(_unquoted(cell).replace("_", "?"))  # Python would read 5_0 as 50
    except ValueError:
        return False
    return True


def _raw(path: Path, style: Style) -> Iterator[tuple[int, str]]:
    """Yield number and text of each line after the header."""
    first = style.skip + style.header + style.units
    return itertools.islice(lines(path, style.encoding), first, None)


def _rows(path: Path, style: Style) -> Iterator[tuple[int, str]]:
    """Yield number and text of each line of numbers, with decimal points, and without lists."""
    every = ((number, spread(line, style.delimiter)) for number, line in _raw(path, style))
    if style.decimal == ".":
        return every
    return ((number, line.replace(style.decimal, ".")) for number, line in every)


def _loaded(
    path: Path,
    style: Style,
    width: int,
    max_numbers: int,
    odd: Iterable[int] = (),
    count: int | None = None,
) -> Array | None:
    """Read the first `count` rows, by default all; None if the file is no table of that width.

    Columns in `odd` may hold dates, texts and empty cells.

    Raises:
        InputError: more than `max_numbers`.
    """
    most = max_numbers // width
    every = (line for _, line in itertools.islice(_rows(path, style), count or most + 1))
    try:
        data = np.loadtxt(
            every,
            delimiter=style.delimiter,
            ndmin=2,
            comments=None,
            quotechar='"',
            converters=dict.fromkeys(odd, cell_value),
        )
    except ValueError as error:
        if isinstance(error, InputError):  # another encoding
            raise
        return None
    if len(data) > most:
        raise InputError(f"{path}: more than {max_numbers} numbers, expected a smaller table")
    return data if data.shape[1] == width else None


@dataclass
class _Odd:
    """The cells of a table that are no numbers."""

    columns: set[int] = field(default_factory=set)
    texts: dict[int, tuple[int, str]] = field(default_factory=dict)
    dates: set[int] = field(default_factory=set)
    rows: int | None = None
    """Number of complete rows; None: all."""
    cut: str = ""


def _odd_cells(path: Path, style: Style, width: int) -> _Odd:
    """Find empty cells, texts, dates, and an incomplete last line."""
    odd, last = _Odd(), ""
    cells: list[str] = []
    row = -1
    for row, (_, line) in enumerate(_rows(path, style)):
        _note(odd, row - 1, cells)  # of the line before, since the last one may be cut
        cells, last = line.rstrip("\r\n").split(style.delimiter), line.strip()
    ends = cells[-1]
    is_whole = len(cells) >= width and (
        width - 1 in odd.texts or width - 1 in odd.dates or not ends.strip() or is_number(ends)
    )
    if is_whole:
        _note(odd, row, cells)
    else:
        odd.rows, odd.cut = row, last
    return odd


def _note(odd: _Odd, row: int, cells: Sequence[str]) -> None:
    """Add the cells of a row that are no numbers."""
    for k, cell in enumerate(cells):
        if is_number(cell):
            continue
        odd.columns.add(k)
        if np.isfinite(cell_value(cell)):
            odd.dates.add(k)
        elif cell.strip():
            odd.texts.setdefault(k, (row, cell.strip()))


def cell_value(cell: str) -> float:
    """Return a number, the seconds of a date or a time of day, or NaN for other texts."""
    text = _unquoted(cell)
    if is_number(text):
        return float(text)
    try:
        of_day = time.fromisoformat(text)
        return _seconds(datetime.combine(_FIRST.date(), of_day)) if ":" in text else np.nan
    except ValueError:
        return _date(text)


_FIRST = datetime(1970, 1, 1)


def _seconds(date: datetime) -> float:
    """Return the seconds since 1970, in the time zone of the date."""
    return (date.replace(tzinfo=None) - _FIRST).total_seconds()


def _date(text: str) -> float:
    """Return the seconds of a date in ISO 8601 or in one of _DATES, or NaN."""
    if not text[:1].isdecimal() or ":" not in text:
        return np.nan
    with contextlib.suppress(ValueError):
        return _seconds(datetime.fromisoformat(text))
    whole, mark, fraction = text.rpartition(".")
    if not mark or ":" in fraction:  # a point of the date
        whole, fraction = text, "0"
    for form in _DATES:
        with contextlib.suppress(ValueError):
            return _seconds(datetime.strptime(whole, form)) + float(f"0.{fraction}")
    return np.nan


def _unquoted(cell: str) -> str:
    return cell.strip().strip('"').strip()


def _check_delimiter(path: Path, line: str, style: Style, *, logged: bool) -> None:
    """Check that a line has no other separator than the expected one."""
    expected = _SEPARATORS[style.delimiter or " "]
    for separator, name in _SEPARATORS.items():
        if name != expected and len(line.strip().split(separator)) > 1:
            raise InputError(
                f"{path}, line {next(lines(path, style.encoding))[0]}: {name} between the columns, "
                f"expected {expected}, and points in the numbers"
                + f"; or delimiter: {name[:-1]} in a mapping file (columns=...)"
                * logged
            )


def _no_number(cell: str, or_else: str = "") -> str:
    """Return that a cell is no number, and what is expected."""
    expected = f", expected points in the numbers{or_else}"
    return f"'{cell.strip()}' is not a number{expected * is_number(cell.replace(',', '.'))}"


def _bad_line(path: Path, width: int, style: Style, *, logged: bool) -> InputError:
    """Return the error of a file that is no rectangular table of numbers."""
    for number, line in _rows(path, style):
        fields = line.strip().split(style.delimiter)
        if len(fields) != width:
            return InputError(
                f"{path}, line {number}: {len(fields)} value(s), expected {width} as in the first"
            )
        for cell in fields:
            if not logged and not is_number(cell):
                return InputError(f"{path}, line {number}: {_no_number(cell)}")
    return InputError(f"{path}: not a table of numbers")
