"""Where files are: those that ship with the package by short names, all others by their paths."""

from __future__ import annotations

import contextlib
import os
from itertools import islice
from pathlib import Path

from sdt_drake.io.errors import InputError, meant
from sdt_drake.io.files import checked_input, checked_name

_PACKAGE = Path(__file__).resolve().parents[1]
PACKAGE_PREFIX = "package://sdt/"

SHIPPED = {
    "scenario": "scenarios/*.yaml",
    "motion": "motions/*.yaml",
    "study": "studies/*.yaml",
    "robot": "*.sdf",
    "motors": "motors*.yaml",
    "drives": "drives*.yaml",
    "perception model": "perception/*.yaml",
    "flight": "flights/*.csv",
    "columns of a flight": "flights/*.yaml",
}
"""By kind, the files below `models/` that ship with the package; their short names are unique."""

_MOST_FILES = 1000  # of a folder, that are looked at for a name like one that is not there


def models_dir() -> Path:
    """The folder `models/`: inside an installed package, or beside it in a checkout."""
    installed = _PACKAGE / "models"
    return installed if installed.is_dir() else _PACKAGE.parent / "models"


def shipped(*kinds: str) -> dict[str, str]:
    """What ships of these kinds: short names, and the references (package://sdt/...) they mean."""
    models = models_dir()
    patterns = (SHIPPED[kind] for kind in kinds if kind in SHIPPED)
    files = (file for pattern in patterns for file in sorted(models.glob(pattern)))
    return {file.stem: PACKAGE_PREFIX + file.relative_to(models).as_posix() for file in files}


def named(text: str | Path, *kinds: str) -> str:
    """What `text` means where a file of one of these kinds is wanted.

    The reference of a short name: "coupled_pi" is package://sdt/scenarios/coupled_pi.yaml. Anything
    else is a path or a reference already.
    """
    return shipped(*kinds).get(str(text), str(text))


def beside(text: str, folder: Path, *kinds: str) -> str:
    """A text in a YAML file of this folder, where relative paths start, as it is said elsewhere.

    Raises:
        InputError: for a short name that nothing has.
    """
    if not text or named(text, *kinds).startswith("package://"):
        return text
    if shipped(*kinds) and not _is_path(text):
        find_file(text, *kinds, base=folder)
    return str(folder / text)


def find_file(text: str | Path, *kinds: str, base: Path | None = None) -> Path:
    """The file that `text` means, to be read.

    Args:
        text: short name, or `package://sdt/...`, of a file that ships, or a path.
        kinds: of the files that have short names here, of SHIPPED.
        base: folder that a relative path starts from; the working directory if None.

    Raises:
        InputError: if there is no such file, with names like it and where it was looked for; if it
            is a folder, a device or a pipe.
    """
    checked_name(str(text))
    meant = named(text, *kinds)
    if meant.startswith(PACKAGE_PREFIX):
        path = models_dir() / meant.removeprefix(PACKAGE_PREFIX)
    else:
        path = (base or Path()) / meant
    if not os.path.exists(path):  # whatever the reason: names that are too long, too
        raise InputError(_missing(meant, path, kinds))
    return checked_input(path)


def a_kind(kind: str) -> str:
    """A kind of file for people: "a scenario", "a file of motors"."""
    return f"a file of {kind}" if kind.endswith("s") else f"a {kind}"


def _missing(text: str, path: Path, kinds: tuple[str, ...]) -> str:
    """For people: that there is no such file, which names are like it, where it was looked for."""
    from difflib import get_close_matches

    for other in SHIPPED:
        if kinds and text in shipped(other):
            return f"{text}: is {a_kind(other)}, expected {a_kind(kinds[0])}"
    folder, slash, _ = text.rpartition("/")
    short, there = shipped(*kinds), dict[str, str]()
    with contextlib.suppress(OSError), os.scandir(path.parent) as entries:
        for file in (Path(entry.name) for entry in islice(entries, _MOST_FILES)):
            if file.suffix == path.suffix or file.stem not in there:
                there[file.stem] = f"{folder}{slash}{file.name}"
    names = there | {name: name for name in short}
    near = [names[stem] for stem in get_close_matches(path.stem, names, n=3)]
    is_reference = text.startswith(PACKAGE_PREFIX)
    known = sorted(there.values() if is_reference else short)
    hint = f"; shipped: {', '.join(known)}" if known else ""
    if near:
        hint = f", {meant(near)}"
    what = " or ".join(kinds) if short and not _is_path(text) else "file"
    looked = folder if is_reference else path.parent.absolute()
    also = " and among what ships" if short and not is_reference else ""
    return f"{text}: no such {what}{hint} (looked in {looked}{also})"


def _is_path(text: str) -> bool:
    return Path(text).name != text or bool(Path(text).suffix)
