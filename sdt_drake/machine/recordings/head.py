"""The beginning of a file of columns: its format, its names and times, found without a mapping."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.formats import BINARY
from sdt_drake.io.list_cells import spread, spread_names
from sdt_drake.io.numbers import DAY, cell_value, header_cells, is_number, read_numbers
from sdt_drake.machine.recordings.columns import DECIMALS, DELIMITERS
from sdt_drake.machine.recordings.times import MIN_RATE, likely_factor

_START = 65536  # bytes that are read
_LINES = 200  # lines that are read
_EVEN = 0.05  # [-] spread of steps over the usual one
_TIME = r"^(t|time|zeit|(time)?stamp|clock)\b|time|zeit|stamp|\bsecs?$"
_TIME_UNITS = {
    r"\bns\b|nano|\bnsecs?\b": 1e-9,
    r"\bus\b|µs|micro": 1e-6,
    r"\bms\b|milli": 1e-3,
    r"\bmin\b": 60.0,
}
_NANOSECONDS = re.compile(r"(nano?|n)_?sec(ond)?s?$", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class Head:
    """The beginning of a file: its format, the names of its columns, and rows of texts."""

    style: dict[str, Any]
    """Fields of a mapping that differ from the default."""
    names: list[str]
    """Names of the columns; "1", "2", ... without a header."""
    rows: list[list[str]]
    """Cells of the first rows, with decimal points."""
    units: Sequence[str] = ()
    """Units of the columns; empty without a line of them."""

    @cached_property
    def columns(self) -> dict[str, Array]:
        """Values by the names of columns, shape (rows,): dates in seconds, NaN for other texts."""
        values = np.array([[cell_value(x) for x in row] for row in self.rows])
        return dict(zip(self.names, values.T, strict=True))

    @cached_property
    def texts(self) -> dict[str, str]:
        """Texts that stand in all rows of a column, by the names of columns."""
        cells = zip(*self.rows, strict=True)
        every = ({x.strip().strip('"').strip() for x in column} for column in cells)
        return {
            name: text
            for name, found in zip(self.names, every, strict=True)
            if len(found) == 1 and not is_number(text := found.pop()) and text
        }

    def words(self, name: str) -> str:
        """Return name and unit of a column in lower-case words."""
        unit = self.units[self.names.index(name)] if self.units else ""
        return words_of(f"{name} {unit}")

    def likely_time(self, least: float = MIN_RATE) -> dict[str, Any]:
        """Return the fields of a mapping for the most even time, with its unit.

        The unit is found by the name or by the steps. Without a time by its name, the first column
        counts if its steps are even. Nothing without a time. The rate is at least `least` [Hz].
        """
        named = [x for x in self.names if re.search(_TIME, self.words(x))]
        found = [x for name in named if (x := self._as_time(name, least)) is not None]
        if not found:
            first = self._as_time(self.names[0], least)
            found = [first] if first is not None and first[0] < _EVEN else []
        return min(found, key=lambda x: x[0])[1] if found else {}

    def seconds(self, time: Mapping[str, Any]) -> Array:
        """Return the times of the rows by fields of `likely_time` [s]; row numbers without one."""
        if not time:
            return np.arange(0.0, len(self.rows))
        values = self.columns[time["time"]]
        values = time.get("time_factor", 1.0) * (values - values[0])
        if self._is_date(time["time"]) and self.columns[time["time"]].max() < DAY:
            values = np.unwrap(values, period=DAY)  # over midnight
        more = self.columns[time["nanoseconds"]] if "nanoseconds" in time else np.zeros(len(values))
        return np.asarray(values + 1e-9 * (more - more[0]))

    def _as_time(self, name: str, least: float) -> tuple[float, dict[str, Any]] | None:
        """Return unevenness of a column's steps [-] and fields of a mapping; None for no time."""
        fields: dict[str, Any] = {"time": name}
        more = self._nanoseconds(name)
        if more:
            fields["nanoseconds"] = more
        steps = np.diff(self.seconds(fields))
        if _NANOSECONDS.search(name) or not np.all(steps > 0):
            return None
        if not len(steps):
            return np.inf, fields
        usual = float(np.median(steps))
        if not (more or self._is_date(name)):
            by_name = [x for unit, x in _TIME_UNITS.items() if re.search(unit, self.words(name))]
            fields["time_factor"] = by_name[0] if by_name else likely_factor(usual, least)
        return float(np.std(steps)) / usual, fields

    def _is_date(self, name: str) -> bool:
        """Return True for a column of dates or times of day."""
        return not is_number(self.rows[0][self.names.index(name)])

    def _nanoseconds(self, name: str) -> str:
        """Return the column with nanoseconds beside seconds, as stamps of ROS 2 have; or ""."""
        at = self.names.index(name) + 1
        after = self.names[at] if at < len(self.names) else ""
        whole = self.columns[name]
        if not after or self._is_date(name) or not np.all(whole == np.round(whole)):
            return ""
        values = self.columns[after]
        is_fraction = np.all((values >= 0) & (values < 1e9)) and np.any(values > 1e6)
        is_named = _NANOSECONDS.search(after) or after.isdecimal()
        return after if is_fraction and is_named else ""


def read_head(path: Path, least: int) -> Head | None:
    """Read the beginning of a file; None if no table with `least` columns of numbers is found."""
    if path.suffix in BINARY:
        numbers = read_numbers(path)
        return Head({}, numbers.names, [[*map(repr, x)] for x in numbers.data[:_LINES].tolist()])
    with path.open("rb") as file:
        start = file.read(_START)
    text, encoding = _decoded(start)
    lines = [line for line in text.splitlines() if line.strip()][:_LINES]
    style: dict[str, Any] = {"encoding": encoding} if encoding != "utf-8" else {}
    for name in ("pipe", "semicolon", "tab", "comma", "space"):
        head = _table(lines[:-1], name, least)  # the last may be cut
        if head is not None:
            return replace(head, style=style | head.style)
    return None


def _table(lines: list[str], delimiter: str, least: int) -> Head | None:
    """Read lines as a table; None if they have fewer than `least` columns of numbers."""
    mark = DELIMITERS[delimiter]
    table = [spread(line.strip("\r\n"), mark).split(mark) for line in lines]
    if not table or len(table[-1]) < least:
        return None
    width = len(table[-1])
    style: dict[str, Any] = {"delimiter": delimiter}
    if any(not is_number(x) and is_number(x.replace(",", ".")) for x in table[-1]):
        style["decimal"] = "comma"
    point = DECIMALS[style.get("decimal", "point")]
    table = [[x.replace(point, ".") for x in row] for row in table]
    is_row = [len(row) == width and sum(map(is_number, row)) >= least for row in table]
    first = is_row.index(True) if True in is_row else 0
    if not is_row[first]:
        return None
    rows = [row for row in table[first:] if len(row) == width]

    def named(line: int) -> list[str]:
        names = header_cells(lines[line], mark, width) if line >= 0 else []
        names, _ = spread_names(names, lines[first], mark)
        ends = len(names) == width - 1 and not any(row[-1].strip() for row in rows)
        names += [""] * ends  # each row ends with a delimiter
        return names if len(names) == width else []

    names, above = named(first - 1), named(first - 2)
    if len({*names}) < len({*above}):  # the last line before the rows has units
        return Head(style | {"skip": first - 2, "units": True}, above, rows, names)
    if names:
        return Head(style | {"skip": first - 1}, names, rows)
    return Head(style | {"header": False, "skip": first}, [str(k + 1) for k in range(width)], rows)


def _decoded(start: bytes) -> tuple[str, str]:
    """Return the text and the encoding of bytes that may end within a letter."""
    if start[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return start.decode("utf-16", errors="ignore"), "utf-16"
    try:
        return start[: start.rfind(b"\n")].decode("utf-8-sig"), "utf-8"
    except UnicodeDecodeError:
        return start.decode("latin-1"), "latin-1"


def words_of(name: str) -> str:
    """Split a name into lower-case words: "Achse1.IstPos_deg" gives "achse ist pos deg"."""
    name = re.sub(r"(?<=[a-z])(?=[A-Z])|[\W\d_]", " ", name.replace("°", " deg "))
    return re.sub(" +", " ", name.lower()).strip()
