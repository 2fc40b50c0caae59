"""Trust: the Python files that may be run, by their resolved path and the SHA-256 of their bytes.

A data file may name a Python file. It is run only with the user's permission: an answer, which is
stored in the user's folder, or `trust=True` or `--trust` for one call.
"""

import contextlib
import json
import os
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from contextvars import ContextVar
from pathlib import Path

from sdt_drake.io.errors import InputError
from sdt_drake.io.files import alone_in, checked_input, checked_name, replacing

Ask = Callable[[str, str], bool]
"""A function of the path and the SHA-256 of a file: True if the file may be run."""

_MAX_BYTES = 1_000_000  # size of a Python file

_accepted: set[tuple[str, str]] = set()  # paths and SHA-256, in this process


def trusted_code(file: Path) -> bytes:
    """Return the bytes of a trusted Python file. Exactly these bytes may be run.

    Raises:
        InputError: the file is not trusted, missing, or too long.
    """
    content = checked_input(file, _MAX_BYTES).read_bytes()
    path, digest = _key(file, content)
    if (path, digest) not in _accepted and not _ask.get()(path, digest):
        raise InputError(
            f"{path}: is Python that would be run, SHA-256 {digest}, and is not trusted; read it, "
            "then allow it with trust=True"
        )
    _accepted.add((path, digest))
    return content


def accept(file: Path, content: bytes) -> None:
    """Trust a file with this content, in this process."""
    _accepted.add(_key(file, content))


def is_kept(path: str, digest: str) -> bool:
    """Check whether the user's file of trusted files contains this one.

    Raises:
        InputError: the file of trusted files is broken.
    """
    return _kept().get(path) == digest


def keep(path: str, digest: str) -> None:
    """Trust a file with this SHA-256 permanently, instead of an earlier content.

    Raises:
        InputError: the user's file of trusted files is broken or cannot be written.
    """
    place = _place()
    with alone_in(place.parent, lambda: None):  # another process may store an answer, too
        text = json.dumps({**_kept(), path: digest}, indent=1) + "\n"
        with replacing(place, protected=False) as partial:  # users edit it
            partial.write_text(text, encoding="utf-8")


@contextlib.contextmanager
def asking(ask: Ask) -> Iterator[None]:
    """Call `ask` for each file that would be run in the block and is not accepted yet."""
    before = _ask.set(ask)
    try:
        yield
    finally:
        _ask.reset(before)


def trusting(trust: bool) -> AbstractContextManager[None]:
    """Trust every Python file in the block if `trust`; otherwise change nothing."""
    return asking(lambda path, digest: True) if trust else nullcontext()


_ask: ContextVar[Ask] = ContextVar("ask", default=is_kept)


def _key(file: Path, content: bytes) -> tuple[str, str]:
    import hashlib  # here, as for --help each import counts

    return str(checked_name(file.resolve())), hashlib.sha256(content).hexdigest()


def _place() -> Path:
    """Return the user's file of trusted files. A relative $XDG_CONFIG_HOME is ignored."""
    own = Path(os.environ.get("XDG_CONFIG_HOME", ""))
    try:
        folder = own if own.is_absolute() else Path("~/.config").expanduser()
    except RuntimeError:
        raise InputError("trusted files: no home directory; set $HOME") from None
    if not folder.is_absolute():  # or the working directory could bring its own
        home = os.environ.get("HOME")
        raise InputError(f"trusted files: $HOME is '{home}', expected an absolute path")
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
