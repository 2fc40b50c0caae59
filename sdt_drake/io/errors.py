"""The one exception that a user's bad input raises; checks of numbers and of files."""

from __future__ import annotations

import contextlib
import filecmp
import math
import os
import secrets
import shutil
import stat
import unicodedata
from collections.abc import Callable, Iterator, Sequence
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


# --- files -----------------------------------------------------------------------------------

_inputs: set[tuple[int, int]] | None = None  # device and number of the files; None: not kept
_outputs: set[tuple[int, int]] = set()
temporaries: set[Path] = set()
"""Files and folders that this process removes before it ends, whatever ends it."""

_IS_READ = "is read by this command, expected another file to write"


@contextlib.contextmanager
def keeping_inputs() -> Iterator[None]:
    """Keep files within: none is replaced that was read, or that begins otherwise than what is
    written."""
    global _inputs
    _inputs = set()
    try:
        yield
    finally:
        _inputs = None
        _outputs.clear()


def checked_name(path: str | Path) -> Path:
    """A path that can be shown, and that every system and format takes.

    Raises:
        InputError: if it has control characters, or letters that are not in UTF-8.
    """
    if has_control_characters(str(path)):
        raise InputError(f"{path}: control characters or no UTF-8 in a name, expected letters")
    return Path(path)


def has_control_characters(text: str) -> bool:
    """Whether there are some, NUL and line breaks too, or halves of letters (surrogates)."""
    return any(unicodedata.category(letter) in ("Cc", "Cs") for letter in text)


def checked_input(path: Path, most: float = math.inf) -> Path:
    """A file of at most `most` bytes that is going to be read; every reader of files begins here.

    Raises:
        InputError: if it is none, longer, or a file that the command writes.
    """
    status = _status(path)
    if status is None:
        raise InputError(f"{path}: no such file")
    if status.st_size > most:
        raise InputError(f"{path}: {status.st_size} bytes, expected at most {most}")
    if _inputs is not None:
        _inputs.add((status.st_dev, status.st_ino))
    return _separate(path)


def checked_output(path: Path) -> Path:
    """A file that is going to be written: refused before anything is computed.

    Raises:
        InputError: if it is a folder, a device, a link to nothing, or a file that the command
            reads.
    """
    status = _status(path)
    if status is not None and _inputs is not None:
        _outputs.add((status.st_dev, status.st_ino))
    return _separate(path)


def checked_suffix(path: Path, suffixes: Sequence[str]) -> Path:
    """A path of one of these kinds.

    Raises:
        InputError: naming them.
    """
    if path.suffix not in suffixes:
        raise InputError(f"{path}: unknown kind of file, expected {', '.join(suffixes)}")
    return path


def _status(path: Path) -> os.stat_result | None:
    """Of a regular file; None if there is none."""
    checked_name(path)
    if path.name in ("", ".."):
        raise InputError(f"{path}: is a folder, expected a file")
    try:
        status = path.stat()
    except OSError as error:
        if path.is_symlink():
            raise InputError(f"{path}: is a link that leads nowhere, expected a file") from None
        if isinstance(error, FileNotFoundError | NotADirectoryError):
            return None
        raise InputError(f"{path}: cannot be used ({error.strerror})") from None
    if stat.S_ISDIR(status.st_mode):
        raise InputError(f"{path}: is a folder, expected a file")
    if not stat.S_ISREG(status.st_mode):  # a pipe waits for its writer, a device may never end
        raise InputError(f"{path}: is a device or pipe, expected a file")
    return status


def _separate(path: Path) -> Path:
    if _inputs is not None and _inputs & _outputs:
        raise InputError(f"{path}: {_IS_READ}")
    return path


def read_text(path: Path, most: int) -> str:
    """A text in UTF-8, with or without a byte-order mark, of at most `most` bytes.

    Raises:
        InputError: if it is no file, longer, or no UTF-8.
    """
    try:
        return checked_input(path, most).read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from None


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


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary path beside `path` that takes its place only if the block succeeds.

    Raises:
        InputError: if `path` cannot be written, or must not be; see `keeping_inputs`.
    """
    with replacing_all([path]) as (partial,):
        yield partial


def write_text(path: Path, text: str) -> Path:
    """Write a text file, replaced whole.

    Raises:
        InputError: if it cannot be written.
    """
    with replacing(path) as partial:
        partial.write_text(text, encoding="utf-8")
    return path


@contextlib.contextmanager
def replacing_all(paths: Sequence[Path]) -> Iterator[list[Path]]:
    """Temporary paths beside several paths, which take their places only if the block succeeds: all
    or none."""
    statuses = [_status(path) for path in paths]
    targets = [path.resolve() if path.is_symlink() else path for path in paths]
    # Of names of their own: two processes may write the same file.
    partials = [
        target.with_name(f".{secrets.token_hex(8)}.partial{target.suffix}") for target in targets
    ]
    try:
        for target in targets:
            target.parent.mkdir(parents=True, exist_ok=True)
        temporaries.update(partials)
        try:
            yield partials
            for path, status, partial in zip(paths, statuses, partials, strict=True):
                if status is not None and _inputs is not None:
                    _check_replaceable(path, status, partial)
            for partial, target in zip(partials, targets, strict=True):
                partial.replace(target)
            _outputs.clear()  # what is new may have the number of what it replaced
        finally:
            for partial in partials:
                partial.unlink(missing_ok=True)
            temporaries.difference_update(partials)
    except OSError as error:
        where = paths[0] if len(paths) == 1 else paths[0].parent
        raise InputError(f"{where}: cannot be written ({error.strerror or error})") from None


def remove_temporaries() -> None:
    """Remove all of `temporaries`, for a process that is about to end."""
    for path in tuple(temporaries):
        shutil.rmtree(path, ignore_errors=True)
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)


def _check_replaceable(path: Path, status: os.stat_result, new: Path) -> None:
    """Refuse to replace what was read, but by the same, and what begins otherwise."""
    is_input = _inputs is not None and (status.st_dev, status.st_ino) in _inputs
    if is_input and not filecmp.cmp(path, new, shallow=False):
        raise InputError(f"{path}: {_IS_READ}")
    if path.suffix == ".txt":  # prose, which may begin with anything
        return
    with path.open("rb") as old, new.open("rb") as file:
        if not file.read(4).startswith(old.read(4)):  # an empty one may be replaced
            raise InputError(
                f"{path}: holds something else than what this command writes, expected another name"
            )
