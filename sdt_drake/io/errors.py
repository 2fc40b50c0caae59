"""`InputError`, the exception for all bad input of users."""

import contextlib
import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

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
def within(where: str | Path = "", *, place: str = "", kind: str = "") -> Iterator[None]:
    """Tell of the problems of an `InputError` raised in the block where they are.

    Args:
        where: file or object to put before theirs.
        place: dotted name of a field to put before their places.
        kind: kind of the problems, see `Problem`.
    """
    try:
        yield
    except InputError as error:
        problems = [_placed(one, f"{where}", place, kind) for one in error.problems]
        raise type(error)(*problems) from None


@contextlib.contextmanager
def gathering(problems: list[Problem]) -> Iterator[None]:
    """Add the problems of an `InputError` raised in the block to a list."""
    try:
        yield
    except InputError as error:
        problems += error.problems


def raise_all(problems: Sequence[Problem]) -> None:
    """Raise `InputError` with all these problems, if there are any."""
    if problems:
        raise InputError(*problems)


def _placed(problem: Problem, where: str, place: str, kind: str) -> Problem:
    if where and not f"{problem}".startswith(where):
        problem = problem._replace(where=": ".join(filter(None, (where, problem.where))))
    if place:
        problem = problem._replace(place=dotted(place, problem.place))
    return problem._replace(kind=kind or problem.kind)


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
