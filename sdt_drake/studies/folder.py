"""The folder of a study: what it is a study of, so that it can go on, be shown and be repeated.

It has copies of all files that the study names, so it may be moved, and they may be changed.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
from pathlib import Path

from pydrake.common.yaml import yaml_dump_typed

from sdt_drake.errors import InputError, replacing
from sdt_drake.scenario import Scenario, save_scenario
from sdt_drake.studies.job import Job, places_of, with_files
from sdt_drake.studies.runs import Runner
from sdt_drake.studies.study import Study, load_study
from sdt_drake.versions import other_versions, versions

STUDY, BASE, STATE, FILES = "study.yaml", "scenario.yaml", "state.json", "files"


def claim(job: Job, folder: Path, resume: bool) -> None:
    """Make the folder this study's, or see that it is.

    Raises:
        InputError: if it holds another study; this one, and `resume` is not set; none, and it is;
            anything else, as nothing is overwritten; or if it cannot be written.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file, expected a folder")
    if holds_study(folder):
        _check_same(job, folder)
        if not resume:
            raise InputError(f"{folder}: holds this study already; --resume goes on with it")
        return
    if resume:
        raise InputError(f"{folder}: holds no study to resume")
    if folder.exists() and any(not path.name.startswith(".") for path in folder.iterdir()):
        raise InputError(f"{folder}: holds something else, expected an empty folder or a new one")
    state = {
        "fingerprint": job.fingerprint,
        "outcomes": list(job.outcomes),
        "files": {name: f"{FILES}/{place}" for name, place in places_of(job.files).items()},
        "versions": job.versions,
    }
    _create(folder / STATE, json.dumps(state, indent=1))


def _create(path: Path, text: str) -> None:
    """Write a file that is not there yet: of two processes, one does."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:  # also of a link that leads nowhere
        raise InputError(f"{error.filename}: no folder can be made ({error.strerror})") from None
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise InputError(f"{path.parent}: another process begins a study there") from None
    except OSError as error:
        with contextlib.suppress(OSError):
            path.unlink()
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None


def _check_same(job: Job, folder: Path) -> None:
    state = _state(folder)
    if state["fingerprint"] != job.fingerprint:
        raise InputError(
            f"{folder}: holds another study, or this one with other files; expected another folder"
        )
    if other := other_versions(state["versions"], job.versions):
        raise InputError(f"{folder}: begun with {other}; expected another folder")


def save_study(job: Job, folder: Path) -> None:
    """Write study, base scenario and files into their folder, which is `claim`ed.

    Raises:
        InputError: if it cannot be written.
    """
    places = {name: f"{FILES}/{place}" for name, place in places_of(job.files).items()}
    for name, place in places.items():
        with replacing(folder / place) as partial:
            partial.write_bytes(job.files[name])
    save_scenario(with_files(job.base, places), folder / BASE)
    study = dataclasses.replace(job.study, scenario=BASE)
    with replacing(folder / STUDY) as partial:
        partial.write_text(yaml_dump_typed(study, schema=Study), encoding="utf-8")


def holds_study(folder: Path) -> bool:
    """Whether a study was begun there."""
    return (folder / STATE).is_file()


def load_folder(folder: Path) -> tuple[Study, Scenario, tuple[str, ...]]:
    """Study, base scenario and names of the outcomes of a study folder.

    Raises:
        InputError: if it holds no study, or a file of it cannot be used.
    """
    state = _state(folder)
    study, base = load_study(folder / STUDY)
    return study, base, tuple(state["outcomes"])


def load_runner(folder: Path) -> tuple[Runner, str]:
    """Runs rows of a study folder once more; and what it was begun with that is different here.

    Raises:
        InputError: if it holds no study, or a file of it cannot be used.
    """
    state = _state(folder)
    study, base, _ = load_folder(folder)
    places = {name: str(folder / place) for name, place in state["files"].items()}
    return Runner(study, base, places), other_versions(state["versions"], versions())


def _state(folder: Path) -> dict:
    path = folder / STATE
    if not path.is_file():
        raise InputError(f"{folder}: holds no study, expected the folder of `sdt-drake study`")
    try:
        state = json.loads(path.read_text(encoding="utf-8"))
        texts = [state["fingerprint"], *state["outcomes"]]
        texts += [*state["files"].values(), *state["versions"].values()]
        if isinstance(state["outcomes"], list) and all(isinstance(text, str) for text in texts):
            return state
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        pass
    raise InputError(f"{path}: cannot be used; expected the file that `sdt-drake study` wrote")
