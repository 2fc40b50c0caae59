"""Files at the boundary: what is read, what is written whole, and that the two stay apart."""

from __future__ import annotations

import contextlib
import csv
import fcntl
import filecmp
import itertools
import math
import os
import shutil
import stat
import unicodedata
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

from sdt_drake.io.errors import InputError, rewording

_inputs: set[Path] | None = None  # that the command has read; None: not kept
_outputs: set[Path] = set()  # that it is going to replace

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
        _inputs.add(path.resolve())
    return _separate(path)


def checked_output(path: Path) -> Path:
    """A file that is going to be written: refused before anything is computed.

    Raises:
        InputError: if it is a folder, a device, a link to nothing, or a file that the command
            reads.
    """
    if _status(path) is not None and _inputs is not None:
        _outputs.add(path.resolve())
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
    if _inputs and _inputs & _outputs:
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


def write_csv(path: Path, header: Iterable[str], rows: Iterable[Iterable[object]]) -> Path:
    """Write a table of cells, replaced whole.

    Raises:
        InputError: if it cannot be written.
    """
    with replacing(path) as partial, partial.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(itertools.chain([header], rows))
    return path


@contextlib.contextmanager
def replacing_all(paths: Sequence[Path]) -> Iterator[list[Path]]:
    """Temporary paths beside several paths, which take their places only if the block succeeds: all
    or none."""
    is_there = [_status(path) is not None for path in paths]
    targets = [path.resolve() for path in paths]
    # Of names of their own: two processes may write the same file.
    partials = [
        target.with_name(f".{os.urandom(8).hex()}.partial{target.suffix}") for target in targets
    ]
    try:
        for target in targets:
            target.parent.mkdir(parents=True, exist_ok=True)
        try:
            yield partials
            if _inputs is not None:
                for path, old, partial in zip(paths, is_there, partials, strict=True):
                    if old:
                        _check_replaceable(path, partial)
            for partial, target in zip(partials, targets, strict=True):
                partial.replace(target)
            _outputs.difference_update(targets)
        finally:
            for partial in partials:
                partial.unlink(missing_ok=True)
    except OSError as error:
        where = paths[0] if len(paths) == 1 else paths[0].parent
        raise InputError(f"{where}: cannot be written ({error.strerror or error})") from None


def _check_replaceable(path: Path, new: Path) -> None:
    """Refuse to replace what was read, but by the same, and what begins otherwise."""
    if path.resolve() in (_inputs or ()) and not filecmp.cmp(path, new, shallow=False):
        raise InputError(f"{path}: {_IS_READ}")
    if path.suffix == ".txt":  # prose, which may begin with anything
        return
    with path.open("rb") as old, new.open("rb") as file:
        if not file.read(4).startswith(old.read(4)):  # an empty one may be replaced
            raise InputError(
                f"{path}: holds something else than what this command writes, expected another name"
            )


@contextlib.contextmanager
def replacing_files(folder: Path, last: str = "") -> Iterator[Path]:
    """Make a temporary folder, whose files take their places in `folder` if the block succeeds.

    All are written before the first one is replaced. Other files in `folder` stay.

    Args:
        folder: made if it is not there, and removed again if nothing is written.
        last: name of the file that tells that the others are there; it comes after them.

    Raises:
        InputError: naming the file in `folder` that cannot be written, or must not be; see
            `keeping_inputs`.
    """
    missing = [place for place in (folder, *folder.parents) if not place.exists()]
    new = folder / f".{os.urandom(8).hex()}.partial"
    try:
        with rewording(lambda line: line.replace(f"{new}", f"{folder}")):
            try:
                new.mkdir(parents=True)
            except OSError as error:
                raise InputError(f"{folder}: cannot be written ({error.strerror})") from None
            yield new
            _move(new, folder, last)
    finally:
        shutil.rmtree(new, ignore_errors=True)
        for place in missing:
            with contextlib.suppress(OSError):  # it is not empty
                place.rmdir()


def _move(new: Path, folder: Path, last: str) -> None:
    """Give all files of a folder their places in another one."""
    files = sorted(path for path in new.rglob("*") if path.is_file())
    files.sort(key=lambda path: path.name == last)
    with replacing_all([folder / path.relative_to(new) for path in files]) as partials:
        for path, partial in zip(files, partials, strict=True):
            shutil.move(path, partial)  # a link of `folder` may lead to another disk


# --- one process at a time -------------------------------------------------------------------


@contextlib.contextmanager
def alone_in(folder: Path, taken: Callable[[], None]) -> Iterator[None]:
    """Keep other processes that ask for it out of a folder, which is made if it is not there.

    A new folder in which nothing is written is removed again.

    Args:
        folder: the folder.
        taken: called where another process has the folder; unless it raises, this one then waits.

    Raises:
        InputError: if the folder cannot be made.
    """
    is_new = not folder.exists()
    with contextlib.ExitStack() as held:
        while True:
            try:
                folder.mkdir(parents=True, exist_ok=True)
                lock = os.open(folder, os.O_RDONLY)
            except OSError as error:
                raise InputError(f"{folder}: cannot be written ({error.strerror})") from None
            held.callback(os.close, lock)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                taken()
                fcntl.flock(lock, fcntl.LOCK_EX)
            if folder.exists() and os.path.samestat(os.fstat(lock), folder.stat()):
                break  # else another process has removed it, which was new
        try:
            yield
        finally:
            if is_new:
                with contextlib.suppress(OSError):  # it is not empty
                    folder.rmdir()
