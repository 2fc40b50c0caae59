"""Rectangular tables of numbers, of text files with any delimiter and of binary files."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Container, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.files import checked_input
from sdt_drake.io.formats import BINARY, MOST_NUMBERS, read_binary

MOST_BYTES = 1_000_000_000
"""Of a table that is read: a recording of an hour."""

_SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", " ": "spaces"}

Converters = dict[int | str, Callable[[str], float]]
"""Of cells of columns that are not numbers throughout."""


@dataclass(frozen=True)
class Style:
    """How a text file with columns is written.

    Attributes:
        delimiter: between the columns; None: spaces or tabs.
        header: whether names of the columns come first, perhaps behind a #.
        skip: how many lines before that say something else; blank ones do not count.
        decimal: mark in numbers, "." or ",".
        encoding: of its letters; one that Python knows.
    """

    delimiter: str | None = ","
    header: bool = True
    skip: int = 0
    decimal: str = "."
    encoding: str = "utf-8"


@dataclass(frozen=True, eq=False)
class Numbers:
    """What a file of columns holds.

    Attributes:
        path: of the file.
        names: of the columns; "1", "2", ... where it has no header.
        data: shape (rows, columns); there may be some that are not finite.
        style: how it is written; of a file that is no text, None.
        cut: the last line, where it was left out as it ends too soon; else "".
    """

    path: Path
    names: list[str]
    data: Array
    style: Style | None
    cut: str = ""

    @property
    def notes(self) -> tuple[str, ...]:
        """What was left out, in sentences."""
        told = f"the last line ends too soon, and was left out: {self.cut[:40]}"
        return (told,) if self.cut else ()

    def place(self, row: int) -> str:
        """File and line with a row, from 0."""
        if self.style is None:
            return f"{self.path}, row {row + 1}"
        line = next(itertools.islice(_rows(self.path, self.style), int(row), None))[0]
        return f"{self.path}, line {line}"

    def check_finite(self, columns: Iterable[int]) -> None:
        """Refuse what is not a finite number, naming line and column."""
        for column in columns:
            bad = np.flatnonzero(~np.isfinite(self.data[:, column]))
            if len(bad):
                raise InputError(
                    f"{self.place(bad[0])}: {self.names[column]} is "
                    f"{self.data[bad[0], column]}, expected a finite number"
                )


def read_numbers(
    path: str | Path, style: Style = Style(), *, least: int = 2, logged: bool = False
) -> Numbers:
    """Read a rectangular table of numbers, as .mat or .parquet by its suffix, else as text.

    Args:
        path: of the file.
        style: how it is written, where it is text.
        least: how many rows there must be.
        logged: whether a logger may have written it. Then columns may hold texts or be empty, and
            are NaN there, and a last line that ends too soon is left out.

    Raises:
        InputError: naming the file, and the line where there is one: no such file, another
            encoding, no such delimiter, a text for a number, a row of another length, more than
            MOST_BYTES.
    """
    path = checked_input(Path(path), MOST_BYTES)
    if path.suffix in BINARY:
        return _binary(path)
    start = list(itertools.islice(_rows(path, style), least))
    head = _header(path, style) if style.header else None
    if len(start) < least:
        raise InputError(f"{path}: fewer than {'two rows' if least == 2 else 'a row'}")
    first = start[0][1] if head is None else head.strip().lstrip("#")
    names = [_unquoted(name) for name in first.split(style.delimiter)]
    if len(names) == 1:
        _check_delimiter(path, first, style)
    cells = start[0][1].split(style.delimiter)
    if logged and len(cells) == len(names) + 1 and not cells[-1].strip():
        names.append("")  # each row ends with a delimiter
    texts: Converters = {
        k: lambda _: np.nan for k, cell in enumerate(cells) if logged and _is_text(cell)
    }
    data, cut = _loaded(path, style, len(names), texts), ""
    if data is None and logged:
        empty, cut, count = _gaps(path, style, len(names), texts)
        texts = empty | texts
        data = _loaded(path, style, len(names), texts, count)
    if data is None or len(data) < least:
        raise _bad_line(path, len(names), style, texts, " or decimal: comma" * logged)
    if not style.header:
        names = [str(k + 1) for k in range(data.shape[1])]
    return Numbers(path, names, data, style, cut)


def lines(path: Path, encoding: str) -> Iterator[tuple[int, str]]:
    """Number and text of each line that is not blank, one by one: a file may be large.

    Raises:
        InputError: for a file that is not in that encoding.
    """
    utf8 = encoding.lower().replace("_", "-") in ("utf-8", "utf8")
    other = InputError(
        f"{path}: cannot be read as {'UTF-8' if utf8 else encoding}, expected a CSV file saved as "
        "UTF-8"
    )
    try:
        # Spreadsheets put a byte-order mark in front.
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


def is_number(cell: str) -> bool:
    """Whether a cell of a table is a number."""
    try:
        float(_unquoted(cell).replace("_", "?"))  # Python would take 5_0 for a number
    except ValueError:
        return False
    return True


def _header(path: Path, style: Style) -> str:
    """The line with the names; "" in a file that ends before."""
    _, line = next(itertools.islice(lines(path, style.encoding), style.skip, None), (0, ""))
    return line


def _rows(path: Path, style: Style) -> Iterator[tuple[int, str]]:
    """Number and text of each line with numbers, points for decimal commas."""
    every = itertools.islice(lines(path, style.encoding), style.skip + style.header, None)
    if style.decimal == ".":
        return every
    return ((number, line.replace(style.decimal, ".")) for number, line in every)


def _loaded(
    path: Path, style: Style, width: int, converters: Converters, count: int | None = None
) -> Array | None:
    """The numbers of the first `count` rows, by default of all; None where the file is no table of
    that width.

    Raises:
        InputError: for more than MOST_NUMBERS.
    """
    most = MOST_NUMBERS // width
    every = (line for _, line in itertools.islice(_rows(path, style), count or most + 1))
    try:
        data = np.loadtxt(
            every,
            delimiter=style.delimiter,
            ndmin=2,
            comments=None,
            quotechar='"',
            converters=converters,
        )
    except ValueError as error:
        if isinstance(error, InputError):  # of the encoding
            raise
        return None
    if len(data) > most:
        raise InputError(f"{path}: more than {MOST_NUMBERS} numbers, expected at most so many")
    return data if data.shape[1] == width else None


def _gaps(
    path: Path, style: Style, width: int, texts: Container[int | str]
) -> tuple[Converters, str, int]:
    """How to read columns with empty cells; the last line, if it ends too soon, else ""; how many
    rows there are before that."""
    empty: set[int] = set()
    cells: list[str] = []
    last, count = "", 0
    for _, line in _rows(path, style):
        empty |= _blank(cells)  # of the line before
        cells, last, count = line.rstrip("\r\n").split(style.delimiter), line.strip(), count + 1
    ends = cells[-1]
    is_whole = len(cells) >= width and (width - 1 in texts or not ends.strip() or is_number(ends))
    if is_whole:
        empty |= _blank(cells)
    converters: Converters = dict.fromkeys(empty, _number_or_nan)
    return converters, "" if is_whole else last, count - (not is_whole)


def _blank(cells: list[str]) -> set[int]:
    """Places of empty cells."""
    return {k for k, cell in enumerate(cells) if not cell.strip()}


def _number_or_nan(cell: str) -> float:
    return float(cell) if cell.strip() else np.nan


def _binary(path: Path) -> Numbers:
    columns = read_binary(path)
    ordered = sorted(columns, key=lambda name: name != "time")  # MATLAB sorts them as it likes
    if len(columns) == 0 or len(columns[ordered[0]]) < 2:
        raise InputError(f"{path}: fewer than two rows")
    return Numbers(path, ordered, np.stack([columns[name] for name in ordered], axis=1), None)


def _unquoted(cell: str) -> str:
    return cell.strip().strip('"').strip()


def _check_delimiter(path: Path, line: str, style: Style) -> None:
    """Refuse a line with another separator than it should have."""
    expected = _SEPARATORS[style.delimiter or " "]
    for separator, name in _SEPARATORS.items():
        if name != expected and len(line.strip().split(separator)) > 1:
            raise InputError(
                f"{path}, line {next(lines(path, style.encoding))[0]}: {name} between the columns, "
                f"expected {expected}, and points in the numbers"
            )


def _is_text(cell: str) -> bool:
    """Whether a cell was never meant as a number, as 1,5 is."""
    return not is_number(cell) and any(map(str.isalpha, cell))


def _bad_line(
    path: Path, width: int, style: Style, skipped: Container[int | str], or_else: str
) -> InputError:
    """What is wrong with a file that does not read as a rectangular table of numbers."""
    for number, line in _rows(path, style):
        fields = line.strip().split(style.delimiter)
        if len(fields) != width:
            return InputError(
                f"{path}, line {number}: {len(fields)} value(s), expected {width} as in the first"
            )
        for column, cell in enumerate(fields):
            if column not in skipped and not is_number(cell):
                expected = f", expected points in the numbers{or_else}"
                expected *= is_number(cell.replace(",", "."))
                told = f"'{cell.strip()}' is not a number{expected}"
                return InputError(f"{path}, line {number}: {told}")
    return InputError(f"{path}: not a table of numbers")
