"""Cells of a table that hold a list, such as "[1.0, 2.0]": pandas and ROS tools write them."""

import re
from collections.abc import Sequence
from functools import cache

_ENTRY = r"""(?:np\.\w+\()?('[^']*'|[-+]?(?:\.?\d|nan|inf)[-+.\w]*)\)?"""
_ENTRIES = rf"{_ENTRY}(?:[\s,;]+{_ENTRY})*"
_LIST = rf""" *"? *(?:array\((?:'\w',\s*)?)?[\[(]\s*({_ENTRIES})[\s,]*[\])]\)? *"? *"""


def spread(line: str, delimiter: str | None) -> str:
    """Return a row with a cell for each entry of a list."""
    if "[" not in line and "(" not in line:
        return line
    mark, whole = delimiter or " ", line.rstrip("\r\n")
    return _lists(mark).sub(lambda found: mark.join(_entries(found[1])), whole)


def spread_names(
    names: Sequence[str], line: str, delimiter: str | None
) -> tuple[list[str], list[str]]:
    """Return the names of the columns of a spread row, and sentences on those of lists.

    Args:
        names: Names of the columns of the file.
        line: A row of the file.
        delimiter: Separator of the columns; None: blanks.
    """
    pattern = _lists(delimiter or " ")
    counted = pattern.sub(lambda found: f"\0{len(_entries(found[1]))}", line.rstrip("\r\n"))
    counts = [cell.partition("\0")[2] for cell in counted.split(delimiter)]
    if len(counts) != len(names) or not any(counts):
        return [*names], []
    columns, lists = [], []
    for name, count in zip(names, counts, strict=True):
        own = [f"{name}_{k + 1}" for k in range(int(count or 0))]
        columns += own or [name]
        lists += [f"'{name}' holds lists, read as columns {own[0]} to {own[-1]}"] if own else []
    return columns, lists


@cache
def _lists(mark: str) -> re.Pattern[str]:
    """Return the pattern of a cell with a list of numbers or quoted texts between marks."""
    return re.compile(f"(?<![^{mark}]){_LIST}(?![^{mark}])")


def _entries(text: str) -> list[str]:
    """Return the entries of a list, without quotes."""
    return [entry.strip("'") for entry in re.findall(_ENTRY, text)]
