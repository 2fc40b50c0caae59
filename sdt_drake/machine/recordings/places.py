"""Columns of a file, found by the names of a mapping."""

import re

from sdt_drake.io.errors import InputError
from sdt_drake.io.numbers import Numbers
from sdt_drake.io.shown import listed

OR_DROP = "; or drop_incomplete: true in a mapping file (columns=...)"
"""Hint for a column with NaN."""

_NUMBER = r"\{k0?\}"


def places_of(
    numbers: Numbers, names: list[str], signal: str, n: int, *, needed: bool
) -> list[int] | None:
    """Return the places of a signal's columns; None for a signal that is not there nor needed.

    Raises:
        InputError: A column is missing or ambiguous, or the number of columns is not n.
    """
    if not names and not needed:
        return None
    pattern = names[0] if len(names) == 1 and re.search(_NUMBER, names[0]) else None
    columns = _numbered(numbers, pattern, n) if pattern else names
    places = [place_of(numbers, name) for name in columns]
    if pattern:
        one_more = places.pop() is not None
        if one_more or (places[0] is not None and None in places):
            count = f"{n + 1} or more" if one_more else n - places.count(None)
            raise InputError(
                f"{numbers.path}: {count} column(s) {re.sub(_NUMBER, 'k', pattern)} ({signal}), "
                f"but the robot has {n} joint(s)"
            )
    elif len(places) != n:
        raise InputError(f"{signal}: {len(names)} column(s), but the robot has {n} joint(s)")
    found = [place for place in places if place is not None]
    if len(found) == n:
        named = zip(columns, places, strict=False)
        twice = [name for name, place in named if places.count(place) > 1]
        if twice:
            raise InputError(
                f"{numbers.path}: {signal}: {listed(twice)} are the same column, expected one for "
                "each joint"
            )
        return found
    if needed or found:
        raise missing(numbers, columns[places.index(None)], signal)
    return None


def _numbered(numbers: Numbers, pattern: str, n: int) -> list[str]:
    """Return the n columns of a pattern and the one after, from 0 if {k0} or the file says so."""
    from_0 = [re.sub(_NUMBER, str(k), pattern) for k in range(n + 2)]
    starts_at_0 = from_0[0] in numbers.names and (n == 1 or from_0[1] in numbers.names)
    return from_0[:-1] if starts_at_0 or "{k0}" in pattern else from_0[1:]


def place_of(numbers: Numbers, name: str) -> int | None:
    """Return the place of a column given by name or number, from 0; None if there is none."""
    if numbers.names.count(name) > 1:
        raise InputError(
            f"{numbers.path}: {numbers.names.count(name)} columns '{name}', expected one; give its "
            "number in a mapping file (columns=...)"
        )
    if name in numbers.names:
        return numbers.names.index(name)
    is_number = name.isdecimal() and 0 < int(name) <= len(numbers.names)
    return int(name) - 1 if is_number else None


def missing(numbers: Numbers, name: str, signal: str) -> InputError:
    """Return the error for a missing column."""
    there = ", ".join(numbers.names[:12]) + (", ..." if len(numbers.names) > 12 else "")
    return InputError(
        f"{numbers.path}: no column '{name}' ({signal}), there are {there}; name the columns in a "
        "mapping file (columns=...)"
    )
