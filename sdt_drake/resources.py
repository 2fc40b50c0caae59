"""Where the robots, motions and scenarios that ship with the package are."""

from __future__ import annotations

import os
from pathlib import Path

from sdt_drake.errors import InputError, checked_input, checked_name

_PACKAGE = Path(__file__).resolve().parent
PACKAGE_PREFIX = "package://sdt/"


def models_dir() -> Path:
    """The folder `models/`: inside an installed package, or beside it in a checkout."""
    installed = _PACKAGE / "models"
    return installed if installed.is_dir() else _PACKAGE.parent / "models"


def find_file(reference: str | Path, base: Path | None = None) -> Path:
    """The file that `reference` means, to be read.

    Args:
        reference: `package://sdt/...` for a file that ships with the package, otherwise a path.
        base: folder that a relative path starts from; the working directory if None.

    Raises:
        InputError: if there is no such file, or it is a folder, a device or a pipe.
    """
    text = str(reference)
    checked_name(text)
    if text.startswith(PACKAGE_PREFIX):
        path = models_dir() / text.removeprefix(PACKAGE_PREFIX)
        choices = sorted(p.name for p in path.parent.glob(f"*{path.suffix}"))
        hint = f"; shipped: {', '.join(choices)}" if choices else ""
    else:
        path = (base or Path()) / text
        hint = f"; files of the package start with {PACKAGE_PREFIX}"
    if not os.path.exists(path):  # whatever the reason: names that are too long, too
        raise InputError(f"{text}: no such file{hint}")
    return checked_input(path)


def page_text(name: str) -> str:
    """A text of `pages/`, which pages and reports are made of."""
    return (_PACKAGE / "pages" / name).read_text(encoding="utf-8")
