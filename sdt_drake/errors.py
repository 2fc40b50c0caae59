"""The one exception that a user's bad input raises."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

_MOST_PERIODS = 10_000_000  # what memory holds


class InputError(ValueError):
    """Input that cannot be used; the message is one line: where, what, and what would be right."""


def told_by(error: BaseException) -> str:
    """What an error of Drake says, in one line that is not too long."""
    text = " ".join(str(error).split())
    return text if len(text) <= 300 else f"{text[:300]}..."


def checked_vector(
    values: ArrayLike,
    n: int,
    where: str,
    *,
    positive: bool = False,
) -> NDArray[np.float64]:
    """`values` as a finite array of shape (n,), all > 0 if `positive`.

    Raises:
        InputError: naming `where`, if length, finiteness or sign is wrong.
    """
    try:
        array = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{where}: {values!r} is not a list of numbers") from None
    if array.shape != (n,) or n < 1:
        shape = "a single number" if array.ndim == 0 else f"{array.size} value(s)"
        raise InputError(f"{where}: {shape}, expected {max(n, 1)}, one for each joint")
    if not np.all(np.isfinite(array)):
        raise InputError(f"{where}: {array.tolist()} contains a value that is not finite")
    if positive and np.any(array <= 0):
        raise InputError(f"{where}: {array.tolist()}, every value must be > 0")
    return array


def checked_number(
    value: float, where: str, *, minimum: float = -np.inf, exclusive: bool = False
) -> float:
    """`value` as a finite number >= `minimum` (> `minimum` if `exclusive`).

    Raises:
        InputError: naming `where`.
    """
    relation = ">" if exclusive else ">="
    bad = not np.isfinite(value) or value < minimum or (exclusive and value == minimum)
    if bad:
        bound = f" {relation} {minimum:g}" if np.isfinite(minimum) else ""
        raise InputError(f"{where}: {value}, expected a finite number{bound}")
    return float(value)


def checked_count(value: int, where: str) -> int:
    """`value` as a whole number >= 1.

    Raises:
        InputError: naming `where`.
    """
    if value != int(value) or value < 1:
        raise InputError(f"{where}: {value}, expected a whole number >= 1")
    return int(value)


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
    if not duration / _MOST_PERIODS <= period:
        raise InputError(
            f"{where}: period {period:g} s, expected at least a {_MOST_PERIODS}th of {duration:g} s"
        )
    count = round(duration / period)
    if count < 1 or abs(count * period - duration) > 1e-9 * max(1.0, duration):
        raise InputError(
            f"{where}: {duration:g} s is not a whole multiple of the period {period:g} s"
        )
    return count


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary path beside `path` that takes its place only if the block succeeds.

    Raises:
        InputError: if `path` cannot be written.
    """
    given, path = path, path.resolve() if path.is_symlink() else path
    if not path.name or path.name == ".." or path.is_dir():
        raise InputError(f"{given}: is a folder, expected a file")
    if path.exists() and not path.is_file():
        raise InputError(f"{given}: is a device or pipe, expected a file")
    partial = path.with_name(f".{path.name}.partial{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            yield partial
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"{given}: cannot be written ({error.strerror or error})") from None
