"""Short views of objects: one line, a printed table, or a table in a notebook."""

import math
import os
import pkgutil
import re
import shutil
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from itertools import zip_longest
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Figure
    from pandas import DataFrame as DataFrame

    from sdt_drake.io.arrays import Array
else:  # their packages load when a figure is drawn, or a table made
    Figure = DataFrame = Any


class Summary(NamedTuple):
    """The summary of an object: a line, and a table whose first `keys` columns name the rows."""

    title: str
    header: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    keys: int = 1


def higher(place: str) -> Any:
    """Return a function of a higher layer by its place in this package.

    Methods such as `run.plot` find their figure so, when they are called: no module imports a
    higher layer. `tests/test_layers.py` lists all these places.

    >>> higher("show.figures.scope:scope").__name__
    'scope'
    """
    return pkgutil.resolve_name(f"sdt_drake.{place}")


class Shown:
    """Base class of objects that print their `summary`."""

    def summary(self) -> Summary:
        """Return one line about the object, and its numbers."""
        raise NotImplementedError

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.summary().title}>"

    def __str__(self) -> str:
        summary = self.summary()
        title = f"{type(self).__name__} {summary.title}"
        return "\n".join([title, *aligned(*summary[1:])])

    def _repr_html_(self) -> str:
        """Return the summary as HTML, for notebooks."""
        import html

        title, header, rows, _ = self.summary()
        heading = f"<b>{type(self).__name__}</b> {html.escape(title)}"
        lines = [[f"<th>{html.escape(name)}</th>" for name in header]]
        lines += [[f"<td>{html.escape(cell)}</td>" for cell in row] for row in rows]
        table = "".join(f"<tr>{''.join(cells)}</tr>" for cells in lines)
        return f"<p>{heading}</p><table>{table}</table>" if rows else f"<p>{heading}</p>"


def listed(texts: Sequence[str]) -> str:
    """Join words to a list.

    >>> listed(["roll", "pitch", "yaw"])
    'roll, pitch and yaw'
    """
    return " and ".join([", ".join(texts[:-1]), texts[-1]] if len(texts) > 1 else texts)


def by_joint(
    names: Sequence[str], columns: Sequence[tuple[str, str, Iterable[Any]]]
) -> tuple[list[str], list[list[str]]]:
    """Return header and rows of a table with one row per joint.

    Args:
        names: names of the joints.
        columns: header, format and values of each column, one value per joint. NaN is a dash.
    """
    cells = [[formatted(x, spec) for x in values] for _, spec, values in columns]
    rows = [list(row) for row in zip(numbered(names), *cells, strict=True)]
    return ["joint", *(header for header, _, _ in columns)], rows


def joint_count(n: int) -> str:
    """Return the number of joints as text: "1 joint", "4 joints"."""
    return f"{n} joint{'s' * (n != 1)}"


def numbered(names: Sequence[str]) -> list[str]:
    """Return number and name of each joint: "1 planetary"."""
    return [f"{k + 1} {name}".strip() for k, name in enumerate(names)]


_ROUNDING = 1e-12


def duration(seconds: float) -> str:
    """Return a time of waiting as text.

    >>> duration(0.4), duration(42.2), duration(500), duration(9000)
    ('1 s', '42 s', '8 min', '2.5 h')
    """
    if seconds < 100:
        return f"{max(1, round(seconds))} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


def formatted(value: Any, spec: str) -> str:
    """Format a number, with a dash for NaN, ∞ for infinity, and 0.0 for -0.0.

    Numbers below 1e-12 are rounding errors of computed ones, in any unit used here, and become 0.
    """
    if isinstance(value, float) and abs(value) < _ROUNDING:
        value = 0.0
    text = format(value, spec).replace("nan", "–").replace("inf", "∞")
    return re.sub(r"^-(?=0[.0]*$)", "", text)


_LEAST_STD = 1e-9  # below it, numbers are rounded to nine places


def rounded(value: float, std: float) -> str:
    """Round a number to one digit of its standard deviation, two digits if the first is 1.

    >>> rounded(2.71828, 0.034)
    '2.72'
    >>> rounded(2.71828, 0.014)
    '2.718'
    >>> rounded(3.2, 1e-20)
    '3.2'
    """
    if not 0 < std < math.inf:
        return formatted(value, ".4g")
    if std < _LEAST_STD:
        return formatted(round(value, 9), ".9g")
    place = -math.floor(math.log10(std))
    place += round(std, place) < 2 * 10.0**-place
    return formatted(round(value, place), f".{max(0, place)}f")


def of_joints(
    title: str, columns: "Mapping[str, tuple[str, Array]]", names: Sequence[str] = ()
) -> Summary:
    """Return a summary of columns (format, values) by header, with one value per joint."""
    table = [(header, *column) for header, column in columns.items()]
    return Summary(title, *by_joint(names or [""] * len(table[0][-1]), table))


def aligned(
    header: Sequence[str], rows: Sequence[Sequence[str]], keys: int = 1, width: int = 0
) -> list[str]:
    """Format a table: first column left-aligned, others right-aligned.

    A table wider than `width` (by default the terminal, or 80 characters) gets headers of several
    lines. If it is still too wide, it is turned, or its cells get several lines, as `fitting` does.
    Else its columns are split into blocks, which repeat the first `keys` columns.
    """
    if not header:
        return []
    header, rows = fitting(header, rows, keys, width)
    columns = [list(column) for column in zip(header, *rows, strict=True)]
    blocks, width = [columns], width or terminal_width()
    if _width(columns) > width:
        columns = _stacked(columns)
        blocks = _blocks(columns[:keys], columns[keys:], width)
    lines: list[str] = []
    for block in blocks:
        lines += [""] * bool(lines) + _lines(block)
    return lines


Table = tuple[Sequence[str], Sequence[Sequence[str]]]


def fitting(
    header: Sequence[str], rows: Sequence[Sequence[str]], keys: int = 1, width: int = 0
) -> Table:
    """Return header and rows of a table that fits into `width`, if there is one.

    Where only that helps, rows become columns, cells get several lines, or the first of two keys
    stands above the second.
    """
    width = width or terminal_width()
    turned, *others = zip(header, *rows, strict=True)
    tables: list[Table] = [(turned, others)]
    if keys == 2:
        tables = [_with_one_key(header, rows)]
    elif rows:
        tables += [(x, _broken(x, cells, width)) for x, cells in ((header, rows), *tables)]
    fits = [table for table in tables if _least(*table) <= width]
    if _least(header, rows) <= width or not fits:
        return header, rows
    return min(fits, key=lambda table: len(table[1]))


def _with_one_key(header: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """Return a table whose first key, where there is one, stands in a row of its own."""
    lines: list[list[str]] = []
    for first, second, *cells in rows:
        lines += [[first, *[""] * len(cells)]] * bool(first)
        lines.append([f"  {second}", *cells])
    return [", ".join(header[:2]), *header[2:]], lines


def _broken(
    header: Sequence[str], rows: Sequence[Sequence[str]], width: int
) -> list[tuple[str, ...]]:
    """Break cells behind the first column into lines at words; all columns share `width`."""
    first = max((len(row[0]) for row in rows), default=0)
    share = max((width - first) // max(len(header) - 1, 1) - 2, 1)
    lines: list[tuple[str, ...]] = []
    for name, *cells in rows:
        wrapped = [textwrap.wrap(cell, share, break_long_words=False) or [""] for cell in cells]
        lines += zip_longest([name], *wrapped, fillvalue="")
    return lines


def _least(header: Sequence[str], rows: Sequence[Sequence[str]]) -> int:
    """Return the width of a table whose headers have several lines."""
    return _width(_stacked([list(column) for column in zip(header, *rows, strict=True)]))


def terminal_width() -> int:
    """Return $COLUMNS, or the width of the terminal behind stdout or stderr, or 80 [characters]."""
    for number in (1, 2):  # stdout may be a pipe
        if not os.environ.get("COLUMNS") and os.isatty(number):
            return os.get_terminal_size(number).columns
    return shutil.get_terminal_size().columns


def _width(columns: Sequence[Sequence[str]]) -> int:
    return sum(max(map(len, column)) + 2 for column in columns) - 2


def _stacked(columns: Sequence[Sequence[str]]) -> list[list[str]]:
    """Split the headers of columns into lines at words, as many lines for each column."""
    headers = [_words(header, cells) for header, *cells in columns]
    height = max(map(len, headers))
    return [
        [*[""] * (height - len(lines)), *lines, *cells]
        for lines, (_, *cells) in zip(headers, columns, strict=True)
    ]


def _words(header: str, cells: Sequence[str]) -> list[str]:
    """Split a header into lines that are no wider than its longest word and the cells below it."""
    # A unit like [N m s/rad] is one word.
    text = re.sub(r"\[.*\]", lambda unit: unit[0].replace(" ", "\xa0"), header)
    longest = max(map(len, [*cells, *text.split(" ")]))
    lines = textwrap.wrap(text, max(longest, 1), break_long_words=False) or [""]
    return [line.replace("\xa0", " ") for line in lines]


def _blocks(keys: list[list[str]], columns: list[list[str]], width: int) -> list[list[list[str]]]:
    blocks = [list(keys)]
    for column in columns:
        if len(blocks[-1]) > len(keys) and _width([*blocks[-1], column]) > width:
            blocks.append(list(keys))
        blocks[-1].append(column)
    return blocks


def _lines(columns: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(map(len, column)) for column in columns]
    lines = []
    for first, *others in zip(*columns, strict=True):
        right = [cell.rjust(width) for cell, width in zip(others, widths[1:], strict=True)]
        lines.append("  ".join([first.ljust(widths[0]), *right]).rstrip())
    return list(filter(None, lines))  # drop empty header lines
