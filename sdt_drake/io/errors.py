"""`InputError`, the exception for all bad input of users, and checks of numbers."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager
from numbers import Integral, Real
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:  # import numpy lazily: it would slow down --help by 0.1 s
    from numpy.typing import ArrayLike

    from sdt_drake.io.arrays import Array

MAX_PERIODS = 1_000_000
"""Largest number of sample periods of a motion: 83 min of 5 ms, planned within a minute."""

MAX_NUMBER = 1e16
"""Largest size of a number in files and arguments; products of many such numbers are finite."""

MAX_PROBLEMS = 20
"""Largest number of problems that an `InputError` prints."""


class Problem(NamedTuple):
    """A problem of an input. Its text is one line: "where: place: found, expected accepted".

    >>> print(Problem("-1", "a number > 0", place="period", where="run.yaml"))
    run.yaml: period: -1, expected a number > 0
    """

    found: str
    """The wrong value or name; a whole sentence if `accepted` is empty."""
    accepted: str = ""
    """The accepted values."""
    place: str = ""
    """The dotted name of the field, entries counted from 1: "controller.kp[2]"."""
    where: str = ""
    """The file or object that contains the field."""
    kind: str = ""
    """"joints": the input belongs to a robot with other joints. "still": a joint moves no mass."""

    @property
    def text(self) -> str:
        """The problem without its place: what was found and what is accepted."""
        return f"{self.found}, expected {self.accepted}" if self.accepted else self.found

    def __str__(self) -> str:
        return ": ".join(filter(None, (self.where, self.place, self.text)))


class InputError(ValueError):
    """Bad input of a user: one or several problems, printed one per line.

    Args:
        problems: objects of `Problem`, or texts.
        place: place of the problems given as texts, see `Problem`.
        kind: kind of the problems given as texts, see `Problem`.
    """

    def __init__(self, *problems: Problem | str, place: str = "", kind: str = "") -> None:
        super().__init__(
            *(
                Problem(one, place=place, kind=kind) if isinstance(one, str) else one
                for one in problems
            )
        )

    @property
    def problems(self) -> tuple[Problem, ...]:
        """All problems, in the order in which they were found.

        Of a file or object, those beyond the first `MAX_PROBLEMS` may be without words and place.
        """
        return self.args

    @property
    def lines(self) -> list[str]:
        """The first `MAX_PROBLEMS` problems as text, then the number of the others."""
        lines = [f"{problem}" for problem in self.problems[:MAX_PROBLEMS]]
        if more := len(self.problems) - len(lines):
            lines.append(f"{Problem(f'{more} more', where=self.problems[0].where)}")
        return lines

    def __str__(self) -> str:
        return "\n".join(self.lines)


@contextlib.contextmanager
def retelling(change: Callable[[Problem], Problem]) -> Iterator[None]:
    """Change each problem of an `InputError` raised in the block."""
    try:
        yield
    except InputError as error:
        raise type(error)(*map(change, error.problems)) from None


def rewording(line: Callable[[str], str]) -> AbstractContextManager[None]:
    """Rewrite each line of an `InputError` raised in the block."""
    return retelling(lambda problem: Problem(line(f"{problem}"), kind=problem.kind))


def within(where: str | Path) -> AbstractContextManager[None]:
    """Prefix the problems of an `InputError` raised in the block with their file or object."""

    def named(problem: Problem) -> Problem:
        if f"{problem}".startswith(f"{where}"):
            return problem
        return problem._replace(where=": ".join(filter(None, (f"{where}", problem.where))))

    return retelling(named)


def at(place: str) -> AbstractContextManager[None]:
    """Prefix the places of the problems of an `InputError` raised in the block with `place`."""
    return retelling(lambda problem: problem._replace(place=dotted(place, problem.place)))


def dotted(place: str, name: str) -> str:
    """Return the place of a field, or of an entry "[2]", within another place."""
    return f"{place}{name}" if name.startswith("[") else f"{place}.{name}".strip(".")


def is_within(name: str, field: str) -> bool:
    """Check whether a dotted name is `field`, or a part or entry of it."""
    return name.startswith(field) and name[len(field) :][:1] in ("", ".", "[")


def meant(near: Iterable[str]) -> str:
    """Return a suggestion from similar names: "did you mean 'kind'?"."""
    return f"did you mean {' or '.join(map(repr, near))}?"


def suggestion(name: str, known: Iterable[str], otherwise: str = "") -> str:
    """Return a suggestion for an unknown name: "did you mean 'kind'?".

    Without a similar name, return `otherwise`, by default a list of all known names.
    """
    import difflib

    known = list(known)
    near = difflib.get_close_matches(name, known, n=3)
    if near:
        return meant(near)
    return otherwise or f"expected one of {', '.join(known)}"


def one_line(error: object) -> str:
    """Return the message of a library's error as one line of at most 300 characters."""
    text = " ".join(str(error).split())
    return text if len(text) <= 300 else f"{text[:300]}..."


def at_most(value: object) -> str:
    """Return " of at most 1e+16" for a finite number beyond it, otherwise ""."""
    is_beyond = isinstance(value, int | float) and MAX_NUMBER < abs(value) < math.inf
    return f" of at most {MAX_NUMBER:g}" if is_beyond else ""


def checked_number(
    value: float, where: str, *, minimum: float = -math.inf, exclusive: bool = False
) -> float:
    """Return `value` as a finite number >= `minimum` (> `minimum` if `exclusive`).

    Raises:
        InputError: the value is no such number.
    """
    is_number = isinstance(value, Real) and abs(value) <= MAX_NUMBER
    if not is_number or value < minimum or (exclusive and value == minimum):
        bound = f" {'>' if exclusive else '>='} {minimum:g}" if math.isfinite(minimum) else ""
        most = at_most(value)
        raise InputError(f"{one_line(value)}, expected a finite number{bound}{most}", place=where)
    return float(value)


def checked_count(value: int, where: str) -> int:
    """Return `value` as a whole number >= 1.

    Raises:
        InputError: the value is no such number.
    """
    if not isinstance(value, Integral) or value < 1:
        raise InputError(f"{value!r}, expected a whole number >= 1", place=where)
    return int(value)


def checked_positive(values: ArrayLike, where: str, n: int | None = None) -> Array:
    """Return `values` as finite numbers > 0, one for each joint, shape (n,); any n by default.

    Raises:
        InputError: the values are no such numbers.
    """
    import numpy as np

    try:
        array = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        array = np.zeros(0)
    is_list = array.ndim == 1 and len(array) > 0 and (n is None or len(array) == n)
    if not is_list or not (np.isfinite(array) & (array > 0)).all():
        count = "" if n is None else f"{n} "
        raise InputError(
            f"{one_line(values)}, expected a list of {count}finite numbers > 0, one for each joint",
            place=where,
        )
    return array


def checked_type(value: object, kind: type, where: str, made_by: str) -> None:
    """Check the type of a value. `made_by` names the function that creates one.

    Raises:
        InputError: the value has another type.
    """
    if not isinstance(value, kind):
        given = f"a {type(value).__name__}"
        if isinstance(value, type):
            given = f"the class {value.__name__}"
        raise InputError(f"{given}, expected a {kind.__name__}, as {made_by} makes it", place=where)


def checked_choice(value: str, choices: tuple[str, ...], where: str) -> str:
    """Return `value` if it is one of `choices`.

    Raises:
        InputError: the value is none of the choices, which it lists.
    """
    if value not in choices:
        raise InputError(f"'{value}', expected one of {', '.join(choices)}", place=where)
    return value


def whole_periods(duration: float, period: float, where: str) -> int:
    """Return the number of periods [s] in `duration` [s].

    Raises:
        InputError: the duration is no whole multiple of the period, or too long.
    """
    if not duration / MAX_PERIODS <= period:
        raise InputError(
            f"period {period:g} s, expected at least a {MAX_PERIODS}th of {duration:g} s",
            place=where,
        )
    count = round(duration / period)
    if count < 1 or abs(count * period - duration) > 1e-9 * max(1.0, duration):
        raise InputError(
            f"{duration:g} s is not a whole multiple of the period {period:g} s", place=where
        )
    return count


@contextlib.contextmanager
def needing(what: str, extra: str) -> Iterator[None]:
    """Import an optional package in the block.

    Args:
        what: start of the message: what needs the package.
        extra: extra of this package that installs it: "sdt_drake[study]".

    Raises:
        InputError: the package is not installed or cannot be loaded.
    """
    try:
        yield
    except ModuleNotFoundError:
        raise InputError(f"{what}: pip install '{extra}'") from None
    except ImportError as error:  # installed, but short of memory or incompatible
        raise InputError(f"{what}, which cannot be loaded ({error})") from None
