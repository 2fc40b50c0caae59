"""The folder of a study, from which the study can be resumed, shown and repeated.

The folder contains copies of all files that the study names. So the folder may be moved, and the
original files may be changed.
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
from sdt_drake.studies.runs import Runner, moved
from sdt_drake.studies.store import DATABASE, RESULTS, ROWS_OF_0_3, Store, create
from sdt_drake.studies.study import Study, load_study, read_study

STUDY, BASE, FILES = "study.yaml", "scenario.yaml", "files"

_MAX_NAMES = 5  # names of fields in a message


@contextmanager
def opened(job: Job, folder: Path, resume: bool) -> Iterator[Store]:
    """Begin or resume a study in its folder, which is locked for other processes meanwhile.

    Raises:
        InputError: if the folder contains another study or other files; this study (without
            `resume`); no study (with `resume`). Also if another process runs the study, or the
            folder cannot be written.
    """
    if resume and not holds_study(folder):
        raise InputError(f"{folder}: no study to resume; run without --resume to begin one")

    def refuse() -> None:
        raise InputError(f"{folder}: another process runs this study; wait until it ends")

    with alone_in(folder, refuse):
        if not holds_study(folder):
            _begin(job, folder)
            resume = True
        with Store(folder) as store:
            _check_same(job, store.about, folder)
            if not resume:
                raise InputError(f"{folder}: contains this study; continue it with --resume")
            store.check_numbers(len(job.study))
            _save_files(job, folder)
            yield store


def _begin(job: Job, folder: Path) -> None:
    if any(not path.name.startswith(".") for path in folder.iterdir()):
        raise InputError(f"{folder}: contains other files, expected an empty folder or a new one")
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
    """Raise InputError unless a folder's study is the one of the job, with the same versions."""
    problems = []
    if other := other_versions(about["versions"], job.versions):
        problems.append(f"{folder}: begun with {other}; use another folder")
    if about["fingerprint"] != job.fingerprint:
        other = _in_words(_differences(_contents(about["contents"]), _contents(_texts(job))))
        what = f"which differs in {other}" if other else "or this one with other shipped files"
        problems.append(f"{folder}: contains another study, {what}; use another folder")
    if problems:
        raise InputError(*problems)


def _save_files(job: Job, folder: Path) -> None:
    """Write the study, the base scenario and the files that they name into a folder."""
    job.save_files(folder / FILES)
    for name in (BASE, STUDY):
        write_text(folder / name, _texts(job)[name])


def _places(job: Job) -> dict[str, str]:
    """Return the path of each file within the study folder, by its name in the study."""
    return {name: f"{FILES}/{place}" for name, place in places_of(job.files).items()}


def _texts(job: Job) -> dict[str, str]:
    """Return the contents of the folder's files: YAML of study and scenario, hashes of others."""
    study = dataclasses.replace(job.study, scenario=BASE)
    return {
        STUDY: yaml_text(study),
        BASE: yaml_text(job.base, moved(job.base, _places(job))),
        **{place: _hash(job.files[name]) for name, place in _places(job).items()},
    }


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def holds_study(folder: Path) -> bool:
    """Return whether a folder contains a study, of this version or an earlier one."""
    return any((folder / name).is_file() for name in (DATABASE, RESULTS, ROWS_OF_0_3))


def load_folder(folder: Path) -> tuple[Study, tuple[str, ...]]:
    """Return the study of a folder and the names of its outcomes. No code in the folder is run.

    Raises:
        InputError: if there is no study, or a file cannot be used or was changed after the runs.
    """
    study, about = _checked(folder)
    return study, tuple(about["outcomes"])


def load_runner(folder: Path, *, trust: bool = False) -> tuple[Runner, tuple[str, ...], str]:
    """Return a runner for rows of a study folder, names of its outcomes, and changed versions.

    Args:
        folder: folder of the study.
        trust: whether Python files in it are run without a question.

    Raises:
        InputError: as `load_folder`.
    """
    _, about = _checked(folder)
    study, base = load_study(folder / STUDY, trust=trust)
    places = {name: str(folder / place) for name, place in about["files"].items()}
    other = other_versions(about["versions"], versions())
    return Runner(study, base, places), tuple(about["outcomes"]), other


def _checked(folder: Path) -> tuple[Study, dict[str, Any]]:
    """Return the study of a folder and its metadata; check that no file was changed."""
    with Store(folder) as store:
        about = store.about
    study, _ = read_study(folder / STUDY)
    recorded = _contents(about["contents"])
    if found := _differences(recorded, _read(folder, recorded)):
        raise InputError(
            f"{folder}: {_in_words(found)} changed since the study was begun; restore the files, "
            "and run the changed study in another folder"
        )
    return study, about


def _read(folder: Path, names: Iterable[str]) -> dict[str, Any]:
    """Read files of a folder: the study and the scenario as data, the hashes of the others."""
    return {
        name: read_yaml(folder / name)
        if name in (STUDY, BASE)
        else _hash(checked_input(folder / name).read_bytes())
        for name in names
    }


def _contents(texts: Mapping[str, str]) -> dict[str, Any]:
    """Parse the texts of the study and the scenario; keep the hashes of the other files."""
    return {
        name: parse_yaml(text) if name in (STUDY, BASE) else text for name, text in texts.items()
    }


def _differences(old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, list[str]]:
    """Return the dotted names of the fields that differ, by file.

    `timeout` is left out: it does not change the result of a run.
    """
    fields = {name: list(_fields(old.get(name), new.get(name))) for name in {**old, **new}}
    relevant = {name: [x for x in found if x != "timeout"] for name, found in fields.items()}
    return {name: found for name, found in relevant.items() if found}


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
    """Return the differences of `_differences` as one line."""
    texts = []
    for name, fields in differences.items():
        more = ["..."] if len(fields) > _MAX_NAMES else []
        inner = ", ".join([*filter(None, fields[:_MAX_NAMES]), *more])
        texts.append(f"{name} ({inner})" if inner else name)
    return ", ".join(texts)
