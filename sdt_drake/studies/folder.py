"""The folder of a study: what it is a study of, so that it can go on, be shown and be repeated.

It has copies of all files that the study names, so it may be moved, and they may be changed.
"""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from sdt_drake.io.errors import InputError
from sdt_drake.io.files import alone_in, checked_input, write_text
from sdt_drake.io.versions import other_versions, versions
from sdt_drake.io.yaml_files import parse_yaml, read_yaml, yaml_text
from sdt_drake.studies.job import Job, places_of
from sdt_drake.studies.runs import Runner, with_files
from sdt_drake.studies.store import DATABASE, OF_0_3, RESULTS, Store, create
from sdt_drake.studies.study import Study, load_study, read_study

STUDY, BASE, FILES = "study.yaml", "scenario.yaml", "files"

_MOST_NAMES = 5  # of fields that are told


@contextmanager
def opened(job: Job, folder: Path, resume: bool) -> Iterator[Store]:
    """Begin a study in its folder, or go on with it, in this process alone.

    Raises:
        InputError: if the folder holds another study; this one, and `resume` is not set; none, and
            it is; anything else, as nothing is overwritten; or if it cannot be written.
    """
    if resume and not holds_study(folder):
        raise InputError(f"{folder}: holds no study to resume")

    def refuse() -> None:
        raise InputError(f"{folder}: another process runs this study")

    with alone_in(folder, refuse):
        if not holds_study(folder):
            _begin(job, folder)
            resume = True
        with Store(folder) as store:
            _check_same(job, store.about, folder)
            if not resume:
                raise InputError(f"{folder}: holds this study already; --resume goes on with it")
            _save_files(job, folder)
            yield store


def _begin(job: Job, folder: Path) -> None:
    if any(not path.name.startswith(".") for path in folder.iterdir()):
        raise InputError(f"{folder}: holds something else, expected an empty folder or a new one")
    about = {
        "study": job.study.name,
        "inputs": [variable.name for variable in job.study.variables],
        "outcomes": list(job.outcomes),
        "fingerprint": job.fingerprint,
        "versions": job.versions,
        "files": _places(job),
        "contents": _texts(job),
    }
    create(folder, about, {x.name: x.takes_texts for x in job.study.variables})


def _check_same(job: Job, about: Mapping[str, Any], folder: Path) -> None:
    """Refuse a study that is not what a folder is about."""
    problems = []
    if other := other_versions(about["versions"], job.versions):
        problems.append(f"{folder}: begun with {other}; expected another folder")
    if about["fingerprint"] != job.fingerprint:
        other = _in_words(_differences(_contents(about["contents"]), _contents(_texts(job))))
        what = f"which differs in {other}" if other else "or this one with other shipped files"
        problems.append(f"{folder}: holds another study, {what}; expected another folder")
    if problems:
        raise InputError(*problems)


def _save_files(job: Job, folder: Path) -> None:
    """Write study, base scenario and files into their folder."""
    job.save_files(folder / FILES)
    for name in (BASE, STUDY):
        write_text(folder / name, _texts(job)[name])


def _places(job: Job) -> dict[str, str]:
    """Of the files, as the folder has them, by their names in the study."""
    return {name: f"{FILES}/{place}" for name, place in places_of(job.files).items()}


def _texts(job: Job) -> dict[str, str]:
    """Collect what the folder's files hold: YAML of study and scenario, hashes of the others."""
    study = dataclasses.replace(job.study, scenario=BASE)
    base = with_files(job.base, _places(job))
    return {
        STUDY: yaml_text(study),
        BASE: yaml_text(base),
        **{place: _hash(job.files[name]) for name, place in _places(job).items()},
    }


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def holds_study(folder: Path) -> bool:
    """Whether a study was begun in a folder, by this version or by one before it."""
    return any((folder / name).is_file() for name in (DATABASE, OF_0_3, RESULTS))


def load_folder(folder: Path) -> tuple[Study, tuple[str, ...]]:
    """Study and names of the outcomes of a study folder; nothing of it is run.

    Raises:
        InputError: if it holds no study, or a file of it cannot be used, or has been changed since
            its runs.
    """
    study, about = _checked(folder)
    return study, tuple(about["outcomes"])


def load_runner(folder: Path, *, trust: bool = False) -> tuple[Runner, tuple[str, ...], str]:
    """What runs rows of a study folder once more; names of its outcomes; and what it was begun with
    that is different here.

    Args:
        folder: of the study.
        trust: whether a Python file in it is run unasked.

    Raises:
        InputError: as `load_folder`.
    """
    _, about = _checked(folder)
    study, base = load_study(folder / STUDY, trust=trust)
    places = {name: str(folder / place) for name, place in about["files"].items()}
    other = other_versions(about["versions"], versions())
    return Runner(study, base, places), tuple(about["outcomes"]), other


def _checked(folder: Path) -> tuple[Study, dict[str, Any]]:
    """A study, and what its folder is about; its files still are what its runs were made of."""
    with Store(folder) as store:
        about = store.about
    study, _ = read_study(folder / STUDY)
    recorded = _contents(about["contents"])
    if found := _differences(recorded, _read(folder, recorded)):
        raise InputError(
            f"{folder}: {_in_words(found)} changed since the study was begun, expected what its "
            "runs were made of; a changed study belongs into another folder"
        )
    return study, about


def _read(folder: Path, names: Iterable[str]) -> dict[str, Any]:
    """Read what files of a folder hold now: study and scenario as data, hashes of the others."""
    return {
        name: read_yaml(folder / name)
        if name in (STUDY, BASE)
        else _hash(checked_input(folder / name).read_bytes())
        for name in names
    }


def _contents(texts: Mapping[str, str]) -> dict[str, Any]:
    """Read the texts of a folder's files: study and scenario as data, hashes as they are."""
    return {
        name: parse_yaml(text) if name in (STUDY, BASE) else text for name, text in texts.items()
    }


def _differences(old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, list[str]]:
    """Find the files that are not the same in both, and the dotted names of their fields.

    The time that a run may take changes nothing in it.
    """
    fields = {name: list(_fields(old.get(name), new.get(name))) for name in {**old, **new}}
    wanted = {name: [x for x in found if x != "timeout"] for name, found in fields.items()}
    return {name: found for name, found in wanted.items() if found}


def _fields(old: Any, new: Any, name: str = "") -> Iterator[str]:
    if isinstance(old, dict) and isinstance(new, dict):
        for key in {**old, **new}:
            yield from _fields(old.get(key), new.get(key), f"{name}.{key}".lstrip("."))
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for k, pair in enumerate(zip(old, new, strict=True)):
            yield from _fields(*pair, f"{name}[{k + 1}]")
    elif old != new:
        yield name


def _in_words(differences: Mapping[str, list[str]]) -> str:
    """Write files with their fields, as `_differences` finds them, in a line."""
    told = []
    for name, fields in differences.items():
        more = ["..."] if len(fields) > _MOST_NAMES else []
        inner = ", ".join([*filter(None, fields[:_MOST_NAMES]), *more])
        told.append(f"{name} ({inner})" if inner else name)
    return ", ".join(told)
