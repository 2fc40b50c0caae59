"""The one exception that a user's bad input raises; checks of numbers."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from numbers import Real
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from sdt_drake.io.arrays import Array

MOST_PERIODS = 1_000_000
"""Of a motion: what is planned in a minute, and memory holds; 83 min of 5 ms."""


class InputError(ValueError):
    """Input that cannot be used: a line for each problem, where, what, and what would be right."""

    def __str__(self) -> str:
        return "\n".join(self.args)


@contextlib.contextmanager
def rewording(line: Callable[[str], str]) -> Iterator[None]:
    """Say the lines of an `InputError` in other words."""
    try:
        yield
    except InputError as error:
        raise type(error)(*map(line, error.args)) from None


def within(where: str | Path) -> AbstractContextManager[None]:
    """Start the lines of an `InputError` with `where`, if they do not yet."""
    return rewording(lambda x: x if x.startswith(f"{where}") else f"{where}: {x}")


def one_line(error: object) -> str:
    """What an error of a library says, in one line that is not too long."""
    text = " ".join(str(error).split())
    return text if len(text) <= 300 else f"{text[:300]}..."


def checked_number(
    value: float, where: str, *, minimum: float = -np.inf, exclusive: bool = False
) -> float:
    """`value` as a finite number >= `minimum` (> `minimum` if `exclusive`).

    Raises:
        InputError: naming `where`.
    """
    is_number = isinstance(value, Real) and np.isfinite(value)
    if not is_number or value < minimum or (exclusive and value == minimum):
        bound = f" {'>' if exclusive else '>='} {minimum:g}" if np.isfinite(minimum) else ""
        raise InputError(f"{where}: {one_line(value)}, expected a finite number{bound}")
    return float(value)


def checked_count(value: int, where: str) -> int:
    """`value` if it is a whole number >= 1.

    Raises:
        InputError: naming `where`.
    """
    if not isinstance(value, int | np.integer) or value < 1:
        raise InputError(f"{where}: {value!r}, expected a whole number >= 1")
    return int(value)


def checked_positive(values: ArrayLike, where: str, n: int | None = None) -> Array:
    """`values` as an array of numbers > 0, one for each joint, shape (n,); of any n by default.

    Raises:
        InputError: naming `where`.
    """
    try:
        array = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        array = np.zeros(0)
    is_list = array.ndim == 1 and len(array) > 0 and (n is None or len(array) == n)
    if not is_list or not (np.isfinite(array) & (array > 0)).all():
        count = "" if n is None else f"{n} "
        raise InputError(
            f"{where}: {one_line(values)}, expected a list of {count}finite numbers > 0, one for "
            "each joint"
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
        raise InputError(f"{where}: {told}, expected a {kind.__name__}, as {made_by} makes it")


def checked_choice(value: str, choices: tuple[str, ...], where: str) -> str:
    """`value` if it is one of `choices`.

    Raises:
        InputError: naming `where` and the choices.
    """
    if value not in choices:
        raise InputError(f"{where}: '{value}', expected one of {', '.join(choices)}")
    return value


def whole_periods(duration: float, period: float, where: str) -> int:
    """How many periods [s] make up `duration` [s].

    Raises:
        InputError: if that is not a whole number >= 1.
    """
    if not duration / MOST_PERIODS <= period:
        raise InputError(
            f"{where}: period {period:g} s, expected at least a {MOST_PERIODS}th of {duration:g} s"
        )
    count = round(duration / period)
    if count < 1 or abs(count * period - duration) > 1e-9 * max(1.0, duration):
        raise InputError(
            f"{where}: {duration:g} s is not a whole multiple of the period {period:g} s"
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
