"""Reading and writing of files: atomic writes that never replace an input of the command."""

import contextlib
import csv
import fcntl
import filecmp
import itertools
import math
import os
import re
import shutil
import stat
import unicodedata
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

from sdt_drake.io.errors import InputError
from sdt_drake.io.signals import holding_signals

_inputs: set[Path] | None = None  # files read by the command; None: not tracked
_outputs: set[Path] = set()  # files to be replaced by the command

_IS_READ = "is read by this command; choose another file to write"

_BEGINNINGS = {
    ".csv": rb"[^\n\0]*[,;\t]",
    ".dot": rb"\s*(strict\s|digraph|graph)",
    ".fmu": rb"PK",
    ".html": rb"(?i)\s*<(!doctype html|html)",
    ".json": rb"\s*[\[{]",
    ".mat": rb"MATLAB|\x89HDF",
    ".parquet": rb"PAR1",
    ".pdf": rb"%PDF",
    ".png": rb"\x89PNG",
    ".sdf": rb"\s*<",
    ".svg": rb"\s*<",
}
"""Patterns of the beginning of files, by suffix; other files hold text."""
_TEXT = rb"[^\0]*\Z"
_BEGINNING = 4096  # bytes


@contextlib.contextmanager
def keeping_inputs() -> Iterator[None]:
    """Protect files in the block: inputs and files of another kind are never replaced.

    A block within another one protects the files of both.
    """
    global _inputs
    if _inputs is not None:
        yield
        return
    _inputs = set()
    try:
        yield
    finally:
        _inputs = None
        _outputs.clear()


def checked_name(path: str | Path) -> Path:
    """Return `path` if its name is printable UTF-8.

    Raises:
        InputError: the name has control characters or is no UTF-8.
    """
    if has_control_characters(str(path)):
        raise InputError(f"{path}: control characters or no UTF-8 in a name; rename the file")
    return Path(path)


def has_control_characters(text: str) -> bool:
    """Check for control characters (also NUL), line breaks of any kind, and surrogates."""
    return any(unicodedata.category(letter) in ("Cc", "Cs", "Zl", "Zp") for letter in text)


def checked_input(path: Path, max_bytes: float = math.inf) -> Path:
    """Return the path of a file to be read. Every reader of files begins here.

    Raises:
        InputError: no such file, not a regular file, longer than `max_bytes`, or an output of the
            command.
    """
    status = _status(path)
    if status is None:
        raise InputError(f"{path}: no such file")
    if status.st_size > max_bytes:
        raise InputError(f"{path}: {status.st_size} bytes, expected at most {max_bytes}")
    if _inputs is not None:
        _inputs.add(path.resolve())
    return _separate(path)


def checked_output(path: Path) -> Path:
    """Return the path of a file to be written. Call this before the computation.

    Raises:
        InputError: a folder, a device, a broken link, an input of the command, or a file whose
            content is not of the kind that its suffix says.
    """
    if _status(path) is not None and _inputs is not None:
        _outputs.add(path.resolve())
        _separate(path)
        _check_kind(path)
    return path


def checked_suffix(path: Path, suffixes: Sequence[str]) -> Path:
    """Return `path` if its suffix is one of `suffixes`.

    Raises:
        InputError: another suffix.
    """
    if path.suffix not in suffixes:
        raise InputError(f"{path}: unknown kind of file, expected {', '.join(suffixes)}")
    return path


def _status(path: Path) -> os.stat_result | None:
    """Return the status of a regular file; None if it does not exist."""
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


def read_text(path: Path, max_bytes: int) -> str:
    """Return the text of a UTF-8 file, without its byte-order mark.

    Raises:
        InputError: no such file, longer than `max_bytes`, or no UTF-8.
    """
    try:
        return checked_input(path, max_bytes).read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from None


@contextlib.contextmanager
def replacing(path: Path, *, protected: bool = True) -> Iterator[Path]:
    """Yield a temporary path that replaces `path` if the block succeeds.

    Args:
        path: the file.
        protected: keep an old file that is an input of the command, or of another kind.

    Raises:
        InputError: `path` cannot be written, or is protected by `keeping_inputs`.
    """
    with replacing_all([path], protected=protected) as (partial,):
        yield partial


def write_text(path: Path, text: str) -> Path:
    """Write a text file atomically.

    Raises:
        InputError: the file cannot be written.
    """
    with replacing(path) as partial:
        partial.write_text(text, encoding="utf-8")
    return path


def write_csv(path: Path, header: Iterable[str], rows: Iterable[Iterable[object]]) -> Path:
    """Write a table of cells atomically as CSV.

    Raises:
        InputError: the file cannot be written.
    """
    with replacing(path) as partial, partial.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(itertools.chain([header], rows))
    return path


@contextlib.contextmanager
def replacing_all(paths: Sequence[Path], *, protected: bool = True) -> Iterator[list[Path]]:
    """Yield temporary paths that replace `paths` if the block succeeds: all or none.

    Signals wait until all have been replaced, and until all temporary files are removed.
    """
    old = [path for path in paths if _status(path) is not None]
    if not protected or _inputs is None:
        old = []
    for path in old:
        _check_kind(path)
    targets = [path.resolve() for path in paths]
    # Random names, because two processes may write the same file.
    partials = [
        target.with_name(f".{os.urandom(8).hex()}.partial{target.suffix}") for target in targets
    ]
    try:
        with holding_signals() as released, _made([target.parent for target in targets]):
            try:
                with released():
                    yield partials
                    for path in old:
                        _check_no_input(path, partials[paths.index(path)])
                for partial, target in zip(partials, targets, strict=True):
                    partial.replace(target)
                _outputs.difference_update(targets)
            finally:
                for partial in partials:
                    partial.unlink(missing_ok=True)
    except OSError as error:
        where = paths[0] if len(paths) == 1 else paths[0].parent
        raise InputError(f"{where}: cannot be written ({error.strerror or error})") from None


@contextlib.contextmanager
def _made(folders: Iterable[Path]) -> Iterator[None]:
    """Create folders, and after the block remove the new ones that are empty."""
    places = {place for folder in folders for place in (folder, *folder.parents)}
    missing = sorted((place for place in places if not place.exists()), reverse=True)
    try:
        for place in reversed(missing):  # parents first
            place.mkdir(exist_ok=True)
        yield
    finally:
        for place in missing:
            with contextlib.suppress(OSError):  # not empty
                place.rmdir()


def _check_no_input(path: Path, new: Path) -> None:
    """Refuse to replace an input by other content."""
    if path.resolve() in (_inputs or ()) and not filecmp.cmp(path, new, shallow=False):
        raise InputError(f"{path}: {_IS_READ}")


def _check_kind(path: Path) -> None:
    """Refuse to replace a file whose content is not of the kind that its suffix says."""
    with path.open("rb") as file:
        beginning = file.read(_BEGINNING)
    if beginning and not re.match(_BEGINNINGS.get(path.suffix, _TEXT), beginning):
        kind = f"is no {path.suffix} file" if path.suffix in _BEGINNINGS else "holds no text"
        raise InputError(f"{path}: {kind} and would be replaced; choose another name")


@contextlib.contextmanager
def replacing_files(folder: Path, last: str = "") -> Iterator[Path]:
    """Yield a temporary folder whose files move into `folder` if the block succeeds.

    All files are written before the first one is replaced, and signals wait until the last one is.
    Other files in `folder` stay.

    Args:
        folder: created if missing, and removed again if it stays empty.
        last: name of the file to move last; its presence marks a complete set.

    Raises:
        InputError: a file in `folder` cannot be written, or is protected by `keeping_inputs`.
    """
    new = folder / f".{os.urandom(8).hex()}.partial"
    try:
        with contextlib.ExitStack() as kept:
            released = kept.enter_context(holding_signals())
            try:
                kept.enter_context(_made([folder]))
                new.mkdir()
            except OSError as error:
                raise InputError(f"{folder}: cannot be written ({error.strerror})") from None
            kept.callback(shutil.rmtree, new, ignore_errors=True)
            with released():
                yield new
            files = sorted(path for path in new.rglob("*") if path.is_file())
            files.sort(key=lambda path: path.name == last)
            with replacing_all([folder / path.relative_to(new) for path in files]) as partials:
                for path, partial in zip(files, partials, strict=True):
                    shutil.move(path, partial)  # a link in `folder` may point to another disk
    except InputError as error:  # names the folder in place of the temporary one
        texts = (f"{one}".replace(f"{new}", f"{folder}") for one in error.problems)
        raise InputError(*texts) from None


# --- one process at a time -------------------------------------------------------------------


@contextlib.contextmanager
def alone_in(folder: Path, taken: Callable[[], None]) -> Iterator[None]:
    """Lock a folder for this process during the block.

    Args:
        folder: created if missing, and removed again if it stays empty.
        taken: called if another process holds the lock. It may raise; otherwise this process waits.

    Raises:
        InputError: the folder cannot be created.
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
                break  # otherwise another process removed its new folder: try again
        try:
            yield
        finally:
            if is_new:
                with contextlib.suppress(OSError):  # not empty
                    folder.rmdir()
