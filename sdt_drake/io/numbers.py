"""Rectangular tables of numbers from text files with any delimiter, and from binary files."""

import itertools
from collections.abc import Callable, Container, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import MAX_NUMBER, InputError, at_most
from sdt_drake.io.files import checked_input
from sdt_drake.io.formats import BINARY, MAX_NUMBERS, read_binary

MAX_BYTES = 1_000_000_000
"""Largest size of a table file: a recording of an hour."""

_SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", " ": "spaces"}

Converters = dict[int | str, Callable[[str], float]]
"""Functions that read the cells of a column which contains texts or empty cells."""


@dataclass(frozen=True)
class Style:
    """The format of a text file with columns."""

    delimiter: str | None = ","
    """Separator of the columns; None: spaces or tabs."""
    header: bool = True
    """A first line with the names of the columns, perhaps after a #."""
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

    @property
    def notes(self) -> tuple[str, ...]:
        """One sentence for each part of the file that was ignored."""
        text = f"the last line is incomplete and was ignored: {self.cut[:40]}"
        return (text,) if self.cut else ()

    def place(self, row: int) -> str:
        """Return file and line of a row, counted from 0."""
        if self.style is None:
            return f"{self.path}, row {row + 1}"
        line = next(itertools.islice(_rows(self.path, self.style), int(row), None))[0]
        return f"{self.path}, line {line}"

    def check_finite(self, columns: Iterable[int]) -> None:
        """Check that columns have finite values only, none beyond MAX_NUMBER.

        Raises:
            InputError: another value; the message has its line and column.
        """
        for column in columns:
            bad = np.flatnonzero(~(np.abs(self.data[:, column]) <= MAX_NUMBER))
            if len(bad):
                value = float(self.data[bad[0], column])
                raise InputError(
                    f"{self.place(bad[0])}: {self.names[column]} is {value}, "
                    f"expected a finite number{at_most(value)}"
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
        logged: accept files of data loggers. Texts and empty cells are read as NaN, and an
            incomplete last line is ignored.
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
    data, cut = _loaded(path, style, len(names), texts, max_numbers), ""
    if data is None and logged:
        cut, count = _ending(path, style, len(names), texts)
        gaps: Converters = dict.fromkeys(range(len(names)), _number_or_nan)
        data = _loaded(path, style, len(names), gaps | texts, max_numbers, count)
    if data is None or len(data) < min_rows:
        raise _bad_line(path, len(names), style, texts, logged)
    if not style.header:
        names = [str(k + 1) for k in range(data.shape[1])]
    return Numbers(path, names, data, style, cut)


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


def is_number(cell: str) -> bool:
    """Check whether a cell of a table is a number."""
    try:
        float(_unquoted(cell).replace("_", "?"))  # Python would read 5_0 as 50
    except ValueError:
        return False
    return True


def _rows(path: Path, style: Style) -> Iterator[tuple[int, str]]:
    """Yield number and text of each line of numbers, with decimal points."""
    every = itertools.islice(lines(path, style.encoding), style.skip + style.header, None)
    if style.decimal == ".":
        return every
    return ((number, line.replace(style.decimal, ".")) for number, line in every)


def _loaded(
    path: Path,
    style: Style,
    width: int,
    converters: Converters,
    max_numbers: int,
    count: int | None = None,
) -> Array | None:
    """Read the first `count` rows, by default all; None if the file is no table of that width.

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
            converters=converters,
        )
    except ValueError as error:
        if isinstance(error, InputError):  # another encoding
            raise
        return None
    if len(data) > most:
        raise InputError(f"{path}: more than {max_numbers} numbers, expected a smaller table")
    return data if data.shape[1] == width else None


def _ending(path: Path, style: Style, width: int, texts: Container[int | str]) -> tuple[str, int]:
    """Return an incomplete last line, "" if it is complete, and the number of complete rows."""
    last, count = "", 0
    for _, line in _rows(path, style):
        last, count = line, count + 1
    cells = last.rstrip("\r\n").split(style.delimiter)
    ends = cells[-1]
    is_whole = len(cells) >= width and (width - 1 in texts or not ends.strip() or is_number(ends))
    return "" if is_whole else last.strip(), count - (not is_whole)


def _number_or_nan(cell: str) -> float:
    return float(cell) if cell.strip() else np.nan


def _unquoted(cell: str) -> str:
    return cell.strip().strip('"').strip()


def _check_delimiter(path: Path, line: str, style: Style) -> None:
    """Check that a line has no other separator than the expected one."""
    expected = _SEPARATORS[style.delimiter or " "]
    for separator, name in _SEPARATORS.items():
        if name != expected and len(line.strip().split(separator)) > 1:
            raise InputError(
                f"{path}, line {next(lines(path, style.encoding))[0]}: {name} between the columns, "
                f"expected {expected}, and points in the numbers"
            )


def _is_text(cell: str) -> bool:
    """Check whether a cell is text, and no misspelt number such as 1,5."""
    return not is_number(cell) and any(map(str.isalpha, cell))


def _bad_line(
    path: Path, width: int, style: Style, texts: Container[int | str], logged: bool
) -> InputError:
    """Return the error of a file that is no rectangular table of numbers."""
    for number, line in _rows(path, style):
        fields = line.strip().split(style.delimiter)
        if len(fields) != width:
            return InputError(
                f"{path}, line {number}: {len(fields)} value(s), expected {width} as in the first"
            )
        for column, cell in enumerate(fields):
            if not (column in texts or is_number(cell) or (logged and not cell.strip())):
                expected = ", expected points in the numbers" + " or decimal: comma" * logged
                expected *= is_number(cell.replace(",", "."))
                wrong = f"'{cell.strip()}' is not a number{expected}"
                return InputError(f"{path}, line {number}: {wrong}")
    return InputError(f"{path}: not a table of numbers")
