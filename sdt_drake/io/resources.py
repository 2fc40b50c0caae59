"""Locations of files: short names of shipped files, paths of all others."""

import contextlib
import os
from functools import cache
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
    "stops": "stops*.yaml",
    "acceptance tests": "acceptance*.yaml",
    "perception model": "perception/*.yaml",
    "flight": "flights/*.csv",
    "columns of a flight": "flights/*.yaml",
}
"""Patterns of the shipped files in `models/`, by kind. Their short names are unique."""

_MAX_FILES = 1000  # directory entries searched for similar names


def models_dir() -> Path:
    """Return the folder `models/`: inside an installed package, or beside it in a checkout."""
    installed = _PACKAGE / "models"
    return installed if installed.is_dir() else _PACKAGE.parent / "models"


@cache
def shipped(*kinds: str) -> dict[str, str]:
    """Return the references (package://sdt/...) of shipped files of some kinds, by short name.

    >>> shipped("drives")
    {'drives': 'package://sdt/drives.yaml'}
    """
    models, patterns = models_dir(), [SHIPPED[kind] for kind in kinds if kind in SHIPPED]
    files = [file for pattern in patterns for file in sorted(models.glob(pattern))]
    return {file.stem: PACKAGE_PREFIX + file.relative_to(models).as_posix() for file in files}


def named(text: str | Path, *kinds: str) -> str:
    """Return the reference of a short name. A path or reference is returned unchanged.

    >>> named("coupled_pi", "scenario")
    'package://sdt/scenarios/coupled_pi.yaml'
    """
    return shipped(*kinds).get(str(text), str(text))


def beside(text: str, folder: Path, *kinds: str, similar: bool = True) -> str:
    """Return a file name of a YAML file as a path that is valid outside of its folder.

    Args:
        text: short name, reference or path as written in the file.
        folder: folder of the YAML file, where relative paths start.
        kinds: kinds of files with short names here.
        similar: search similar names for the message, as `find_file` does.

    Raises:
        InputError: an unknown short name.
    """
    if not text or named(text, *kinds).startswith("package://"):
        return text
    if shipped(*kinds) and not _is_path(text):
        find_file(text, *kinds, base=folder, similar=similar)
    return str(folder / text)


def find_file(
    text: str | Path, *kinds: str, base: Path | None = None, similar: bool = True
) -> Path:
    """Find a file to be read.

    Args:
        text: short name or reference (`package://sdt/...`) of a shipped file, or a path.
        kinds: kinds of files, keys of SHIPPED, with short names here.
        base: folder where relative paths start; the working directory if None.
        similar: search similar names for the message, which takes milliseconds.

    Raises:
        InputError: no such file (the message has similar names and the searched folder), or a
            folder, device or pipe.
    """
    checked_name(str(text))
    meant = named(text, *kinds)
    if meant.startswith(PACKAGE_PREFIX):
        path = models_dir() / meant.removeprefix(PACKAGE_PREFIX)
    else:
        path = (base or Path()) / meant
    if not os.path.exists(path):  # also false for names that are too long
        raise InputError(_missing(meant, path, kinds) if similar else f"{meant}: no such file")
    return checked_input(path)


def a_kind(kind: str) -> str:
    """Return a kind of file with its article: "a scenario", "a file of motors"."""
    return f"a file of {kind}" if kind.endswith("s") else f"a {kind}"


def _missing(text: str, path: Path, kinds: tuple[str, ...]) -> str:
    """Return the message of a missing file, with similar names and the searched folder."""
    from difflib import get_close_matches

    for other in SHIPPED:
        if kinds and text in shipped(other):
            return f"{text}: is {a_kind(other)}, expected {a_kind(kinds[0])}"
    folder, slash, _ = text.rpartition("/")
    short, there = shipped(*kinds), dict[str, str]()
    with contextlib.suppress(OSError), os.scandir(path.parent) as entries:
        for file in (Path(entry.name) for entry in islice(entries, _MAX_FILES)):
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
