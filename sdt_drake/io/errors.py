"""The one exception that a user's bad input raises; checks of numbers."""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager
from numbers import Integral, Real
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:  # numpy takes a tenth of a second, which --help has no use for
    from numpy.typing import ArrayLike

    from sdt_drake.io.arrays import Array

MOST_PERIODS = 1_000_000
"""Of a motion: what is planned in a minute, and memory holds; 83 min of 5 ms."""


_MOST_PROBLEMS = 20  # that are told


class Problem(NamedTuple):
    """Something wrong with an input, as data; its text is one line: "where: place: found, expected
    accepted".

    Attributes:
        found: what is wrong; the whole sentence where the parts below are empty.
        accepted: what would be right.
        place: dotted name of a field, entries counted from 1: "controller.kp[2]".
        where: the file or the object that has the field.
        near: names like one that there is none of.
        kind: "joints" where the input is of another robot, with other joints; "still" where a joint
            of a robot has nothing to move.
    """

    found: str
    accepted: str = ""
    place: str = ""
    where: str = ""
    near: tuple[str, ...] = ()
    kind: str = ""

    @property
    def text(self) -> str:
        """What was found, and what would be right."""
        if self.near:
            return f"{self.found}, {meant(self.near)}"
        return f"{self.found}, expected {self.accepted}" if self.accepted else self.found

    def __str__(self) -> str:
        return ": ".join(filter(None, (self.where, self.place, self.text)))


class InputError(ValueError):
    """Input that cannot be used: a `Problem` for each thing that is wrong, a line for each of the
    first ones.

    Args:
        problems: their data, or texts.
        place, kind: of problems that are texts, see `Problem`.
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
        """All that is wrong, in the order in which it was found."""
        return self.args

    @property
    def lines(self) -> list[str]:
        """The first problems for people, and how many more there are."""
        lines = [f"{problem}" for problem in self.problems]
        if len(lines) > _MOST_PROBLEMS:
            more = f"{len(lines) - _MOST_PROBLEMS} more"
            lines[_MOST_PROBLEMS:] = [f"{Problem(more, where=self.problems[0].where)}"]
        return lines

    def __str__(self) -> str:
        return "\n".join(self.lines)


@contextlib.contextmanager
def retelling(change: Callable[[Problem], Problem]) -> Iterator[None]:
    """Change the problems of an `InputError`."""
    try:
        yield
    except InputError as error:
        raise type(error)(*map(change, error.problems)) from None


def rewording(line: Callable[[str], str]) -> AbstractContextManager[None]:
    """Say the lines of an `InputError` in other words."""
    return retelling(lambda problem: Problem(line(f"{problem}"), kind=problem.kind))


def within(where: str | Path) -> AbstractContextManager[None]:
    """Name the file or object that the problems of an `InputError` are in, if none is named."""

    def named(problem: Problem) -> Problem:
        if f"{problem}".startswith(f"{where}"):
            return problem
        return problem._replace(where=": ".join(filter(None, (f"{where}", problem.where))))

    return retelling(named)


def at(place: str) -> AbstractContextManager[None]:
    """Name the field that the problems of an `InputError` are in; their own places are in it."""
    return retelling(lambda problem: problem._replace(place=dotted(place, problem.place)))


def dotted(place: str, name: str) -> str:
    """The place of a field, or of an entry "[2]", in a place."""
    return f"{place}{name}" if name.startswith("[") else f"{place}.{name}".strip(".")


def is_within(name: str, field: str) -> bool:
    """Whether a dotted name is that of a field, or of a part or an entry of it."""
    return name.startswith(field) and name[len(field) :][:1] in ("", ".", "[")


PART = re.compile(r"(\w+)(?:\[([1-9]\d{0,5})\])?")
"""Part of a dotted name; entries count from 1."""


def meant(near: Iterable[str]) -> str:
    """The names like a wrong one, for people: "did you mean 'kind'?"."""
    return f"did you mean {' or '.join(map(repr, near))}?"


def one_line(error: object) -> str:
    """What an error of a library says, in one line that is not too long."""
    text = " ".join(str(error).split())
    return text if len(text) <= 300 else f"{text[:300]}..."


def checked_number(
    value: float, where: str, *, minimum: float = -math.inf, exclusive: bool = False
) -> float:
    """`value` as a finite number >= `minimum` (> `minimum` if `exclusive`).

    Raises:
        InputError: naming `where`.
    """
    is_number = isinstance(value, Real) and math.isfinite(value)
    if not is_number or value < minimum or (exclusive and value == minimum):
        bound = f" {'>' if exclusive else '>='} {minimum:g}" if math.isfinite(minimum) else ""
        raise InputError(f"{one_line(value)}, expected a finite number{bound}", place=where)
    return float(value)


def checked_count(value: int, where: str) -> int:
    """`value` if it is a whole number >= 1.

    Raises:
        InputError: naming `where`.
    """
    if not isinstance(value, Integral) or value < 1:
        raise InputError(f"{value!r}, expected a whole number >= 1", place=where)
    return int(value)


def checked_positive(values: ArrayLike, where: str, n: int | None = None) -> Array:
    """`values` as an array of numbers > 0, one for each joint, shape (n,); of any n by default.

    Raises:
        InputError: naming `where`.
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
    """Refuse what is not of a kind; made_by: how one gets it.

    Raises:
        InputError: naming `where`.
    """
    if not isinstance(value, kind):
        told = f"a {type(value).__name__}"
        if isinstance(value, type):
            told = f"the class {value.__name__}"
        raise InputError(f"{told}, expected a {kind.__name__}, as {made_by} makes it", place=where)


def checked_choice(value: str, choices: tuple[str, ...], where: str) -> str:
    """`value` if it is one of `choices`.

    Raises:
        InputError: naming `where` and the choices.
    """
    if value not in choices:
        raise InputError(f"'{value}', expected one of {', '.join(choices)}", place=where)
    return value


def whole_periods(duration: float, period: float, where: str) -> int:
    """How many periods [s] make up `duration` [s].

    Raises:
        InputError: if that is not a whole number >= 1.
    """
    if not duration / MOST_PERIODS <= period:
        raise InputError(
            f"period {period:g} s, expected at least a {MOST_PERIODS}th of {duration:g} s",
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
    """Imports of a package that is not always there; `extra` has it: "sdt_drake[study]".

    Raises:
        InputError: starting with `what`, if it is not installed, or cannot be loaded.
    """
    try:
        yield
    except ModuleNotFoundError:
        raise InputError(f"{what}: pip install '{extra}'") from None
    except ImportError as error:  # it is there: memory is short, or a library does not fit
        raise InputError(f"{what}, which cannot be loaded ({error})") from None
