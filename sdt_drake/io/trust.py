"""Trust: the Python files that may be run, by their resolved path and the SHA-256 of their bytes.

Nothing that a file of data names is run before the user has said so: by an answer, which is kept
in a file of the user's own, or for once by `trust=True` or `--trust`.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from contextvars import ContextVar
from pathlib import Path

from sdt_drake.io.errors import InputError
from sdt_drake.io.files import checked_input, checked_name, write_text

Ask = Callable[[str, str], bool]
"""Takes the path and the SHA-256 of a file, and tells whether it may be run."""

_LARGEST = 1_000_000  # bytes of Python

_accepted: set[tuple[str, str]] = set()  # in this process: paths and SHA-256


def trusted_code(file: Path) -> bytes:
    """The bytes of a Python file that may be run; exactly these are trusted.

    Raises:
        InputError: if nobody trusts the file; if there is none, or it is too long.
    """
    content = checked_input(file, _LARGEST).read_bytes()
    path, digest = _key(file, content)
    if (path, digest) not in _accepted and not _ask.get()(path, digest):
        raise InputError(
            f"{path}: is Python that would be run, SHA-256 {digest}, and is not trusted; read it, "
            "then allow it with --trust, in Python trust=True"
        )
    _accepted.add((path, digest))
    return content


def accept(file: Path, content: bytes) -> None:
    """Trust a file with this content, in this process."""
    _accepted.add(_key(file, content))


def is_kept(path: str, digest: str) -> bool:
    """Whether the user's file of trusted files has this one.

    Raises:
        InputError: if that file is broken.
    """
    return _kept().get(path) == digest


def keep(path: str, digest: str) -> None:
    """Trust a file with this SHA-256 from now on, in the place of an earlier content.

    Raises:
        InputError: if the user's file of trusted files is broken, or cannot be written.
    """
    write_text(_place(), json.dumps({**_kept(), path: digest}, indent=1) + "\n")


@contextlib.contextmanager
def asking(ask: Ask) -> Iterator[None]:
    """Ask this within, where a file would be run that is not accepted yet."""
    before = _ask.set(ask)
    try:
        yield
    finally:
        _ask.reset(before)


def trusting(trust: bool) -> AbstractContextManager[None]:
    """Trust every Python file within, if `trust`; else nothing changes."""
    return asking(lambda path, digest: True) if trust else nullcontext()


_ask: ContextVar[Ask] = ContextVar("ask", default=is_kept)


def _key(file: Path, content: bytes) -> tuple[str, str]:
    return str(checked_name(file.resolve())), hashlib.sha256(content).hexdigest()


def _place() -> Path:
    """The user's file of trusted files; as its rules are, a relative $XDG_CONFIG_HOME is none."""
    own = Path(os.environ.get("XDG_CONFIG_HOME", ""))
    try:
        folder = own if own.is_absolute() else Path("~/.config").expanduser()
    except RuntimeError:
        raise InputError("trusted files: nobody's home is known, expected $HOME") from None
    return folder / "sdt_drake" / "trusted.json"


def _kept() -> dict[str, str]:
    place = _place()
    try:
        kept = json.loads(place.read_text(encoding="utf-8"))
        if not isinstance(kept, dict):
            raise ValueError("no object")
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(
            f"{place}: cannot be read ({error}), expected SHA-256 by path; remove it"
        ) from None
    return kept
