"""Columns of a file, found by what a mapping says."""

from sdt_drake.io.errors import InputError
from sdt_drake.io.numbers import Numbers
from sdt_drake.io.shown import listed


def places_of(
    numbers: Numbers, names: list[str], signal: str, n: int, *, needed: bool
) -> list[int] | None:
    """The columns of a signal; None if it has none and need not."""
    if not names and not needed:
        return None
    pattern = names[0] if len(names) == 1 and "{k}" in names[0] else None
    said = [pattern.replace("{k}", str(k + 1)) for k in range(n + 1)] if pattern else names
    places = [place_of(numbers, name) for name in said]
    if pattern:
        one_more = places.pop() is not None
        if one_more or (places[0] is not None and None in places):
            count = n + 1 if one_more else n - places.count(None)
            told = (
                f"{count} {'or more ' if one_more else ''}column(s) {pattern.replace('{k}', 'k')}"
            )
            raise InputError(f"{numbers.path}: {told} ({signal}), but the robot has {n} joint(s)")
    elif len(places) != n:
        raise InputError(f"{signal}: {len(names)} column(s), but the robot has {n} joint(s)")
    found = [place for place in places if place is not None]
    if len(found) == n:
        twice = [name for name, place in zip(said, places, strict=False) if places.count(place) > 1]
        if twice:
            raise InputError(
                f"{numbers.path}: {signal}: {listed(twice)} are one column, expected one for each "
                "joint"
            )
        return found
    if needed or found:
        raise missing(numbers, said[places.index(None)], signal)
    return None


def place_of(numbers: Numbers, name: str) -> int | None:
    """Place of a column, by its name or number; None if there is none."""
    if numbers.names.count(name) > 1:
        raise InputError(
            f"{numbers.path}: {numbers.names.count(name)} columns '{name}', expected one; a "
            "mapping file (--columns) may name it by its number"
        )
    if name in numbers.names:
        return numbers.names.index(name)
    is_number = name.isdecimal() and 0 < int(name) <= len(numbers.names)
    return int(name) - 1 if is_number else None


def missing(numbers: Numbers, name: str, signal: str) -> InputError:
    """The error of a column that is not there."""
    there = ", ".join(numbers.names[:12]) + (", ..." if len(numbers.names) > 12 else "")
    return InputError(
        f"{numbers.path}: no column '{name}' ({signal}), there are {there}; a mapping file "
        "(--columns) names others"
    )
