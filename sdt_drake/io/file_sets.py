"""Files that are written together: all of them take their places, or none."""

from __future__ import annotations

import contextlib
import secrets
import shutil
from collections.abc import Iterator
from pathlib import Path

from sdt_drake.io.errors import InputError, replacing_all, rewording, temporaries


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
    new = folder / f".{secrets.token_hex(8)}.partial"
    temporaries.add(new)
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
        temporaries.discard(new)
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
