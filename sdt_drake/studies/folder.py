"""The folder of a study: what it is a study of, so that it can go on, be shown and be repeated.

It has copies of all files that the study names, so it may be moved, and they may be changed.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sdt_drake.io.errors import InputError
from sdt_drake.io.versions import other_versions, versions
from sdt_drake.io.yaml_files import write_yaml
from sdt_drake.run.scenario import Scenario, save_scenario
from sdt_drake.studies.job import Job, places_of
from sdt_drake.studies.runs import Runner, with_files
from sdt_drake.studies.study import Study, load_study

STUDY, BASE, STATE, FILES = "study.yaml", "scenario.yaml", "state.json", "files"


def claim(job: Job, folder: Path, resume: bool) -> None:
    """Make the folder that of this study, or see that it is.

    Raises:
        InputError: if it holds another study; this one, and `resume` is not set; none, and it is;
            anything else, as nothing is overwritten; or if it cannot be written.
    """
    if holds_study(folder):
        state = _state(folder)
        if state["fingerprint"] != job.fingerprint:
            raise InputError(
                f"{folder}: holds another study, or this one with other files; expected another "
                "folder"
            )
        if other := other_versions(state["versions"], job.versions):
            raise InputError(f"{folder}: begun with {other}; expected another folder")
        if not resume:
            raise InputError(f"{folder}: holds this study already; --resume goes on with it")
        return
    if resume:
        raise InputError(f"{folder}: holds no study to resume")
    state = {
        "fingerprint": job.fingerprint,
        "outcomes": list(job.outcomes),
        "files": _places(job),
        "versions": job.versions,
    }
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(not path.name.startswith(".") for path in folder.iterdir()):
            raise InputError(
                f"{folder}: holds something else, expected an empty folder or a new one"
            )
        with (folder / STATE).open("x", encoding="utf-8") as file:  # of two processes, one does
            try:
                json.dump(state, file, indent=1)
                file.flush()
            except OSError:  # half of it would be in the way of the next attempt
                (folder / STATE).unlink()
                raise
    except OSError as error:
        raise InputError(f"{folder}: no study can be begun there ({error.strerror})") from None


def save_study(job: Job, folder: Path) -> None:
    """Write study, base scenario and files into their folder, which is `claim`ed.

    Raises:
        InputError: if it cannot be written.
    """
    job.save_files(folder / FILES)
    save_scenario(with_files(job.base, _places(job)), folder / BASE)
    write_yaml(folder / STUDY, dataclasses.replace(job.study, scenario=BASE))


def _places(job: Job) -> dict[str, str]:
    """Of the files, as the folder has them, by their names in the study."""
    return {name: f"{FILES}/{place}" for name, place in places_of(job.files).items()}


def holds_study(folder: Path) -> bool:
    """Whether a study was begun in a folder."""
    return (folder / STATE).is_file()


def load_folder(folder: Path) -> tuple[Study, Scenario, tuple[str, ...]]:
    """Study, base scenario and names of the outcomes of a study folder.

    Raises:
        InputError: if it holds no study, or a file of it cannot be used.
    """
    state = _state(folder)
    study, base = load_study(folder / STUDY)
    return study, base, tuple(state["outcomes"])


def load_runner(folder: Path) -> tuple[Runner, tuple[str, ...], str]:
    """What runs rows of a study folder once more; names of its outcomes; and what it was begun with
    that is different here.

    Raises:
        InputError: if it holds no study, or a file of it cannot be used.
    """
    state = _state(folder)
    study, base, outcomes = load_folder(folder)
    places = {name: str(folder / place) for name, place in state["files"].items()}
    return Runner(study, base, places), outcomes, other_versions(state["versions"], versions())


def _state(folder: Path) -> Mapping[str, Any]:
    path = folder / STATE
    if not path.is_file():
        raise InputError(f"{folder}: holds no study, expected the folder of `sdt-drake study`")
    try:
        state = json.loads(path.read_text(encoding="utf-8"))
        texts = [state["fingerprint"], *state["outcomes"]]
        texts += [*state["files"].values(), *state["versions"].values()]
        "".join(texts)  # a TypeError, if one is none
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise InputError(
            f"{path}: cannot be used; expected the file that `sdt-drake study` wrote"
        ) from None
    return state
