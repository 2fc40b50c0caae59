"""The folder of a study: what it is a study of, so that it can go on, be shown and be repeated.

It has copies of all files that the study names, so it may be moved, and they may be changed.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from pydrake.common.yaml import yaml_dump_typed

from sdt_drake.io.errors import InputError
from sdt_drake.io.files import checked_input, write_text
from sdt_drake.io.versions import other_versions, versions
from sdt_drake.io.yaml_files import parse_yaml, read_yaml
from sdt_drake.run.scenario import Scenario
from sdt_drake.studies.job import Job, places_of
from sdt_drake.studies.runs import Runner, with_files
from sdt_drake.studies.study import Study, load_study

STUDY, BASE, STATE, FILES = "study.yaml", "scenario.yaml", "state.json", "files"

_MOST_NAMES = 5  # of fields that are told


def claim(job: Job, folder: Path, resume: bool) -> None:
    """Make the folder that of this study, or see that it is.

    Raises:
        InputError: if it holds another study; this one, and `resume` is not set; none, and it is;
            anything else, as nothing is overwritten; or if it cannot be written.
    """
    if holds_study(folder):
        state = _state(folder)
        problems = []
        if other := other_versions(state["versions"], job.versions):
            problems.append(f"{folder}: begun with {other}; expected another folder")
        if state["fingerprint"] != job.fingerprint:
            files = (STUDY, BASE, *state["files"].values())
            there = _recorded(state) or _read(folder, files)
            other = _in_words(_differences(there, _recorded({"contents": _texts(job)})))
            what = f"which differs in {other}" if other else "or this one with other shipped files"
            problems.append(f"{folder}: holds another study, {what}; expected another folder")
        if problems:
            raise InputError(*problems)
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
        "contents": _texts(job),
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
        STUDY: yaml_dump_typed(study, schema=Study),
        BASE: yaml_dump_typed(base, schema=Scenario),
        **{place: _hash(job.files[name]) for name, place in _places(job).items()},
    }


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def holds_study(folder: Path) -> bool:
    """Whether a study was begun in a folder."""
    return (folder / STATE).is_file()


def load_folder(folder: Path) -> tuple[Study, Scenario, tuple[str, ...]]:
    """Study, base scenario and names of the outcomes of a study folder.

    Raises:
        InputError: if it holds no study, or a file of it cannot be used, or has been changed since
            its runs.
    """
    state = _state(folder)
    study, base = load_study(folder / STUDY)
    _check_unchanged(folder, _recorded(state))
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


def _check_unchanged(folder: Path, recorded: Mapping[str, Any]) -> None:
    """Refuse files that are not as they were when the study was begun: its outcomes are of them."""
    if found := _differences(recorded, _read(folder, recorded)):
        raise InputError(
            f"{folder}: {_in_words(found)} changed since the study was begun, expected what its "
            "runs were made of; a changed study belongs into another folder"
        )


def _read(folder: Path, names: Iterable[str]) -> dict[str, Any]:
    """Read what files of a folder hold now: study and scenario as data, hashes of the others."""
    return {
        name: read_yaml(folder / name)
        if name in (STUDY, BASE)
        else _hash(checked_input(folder / name).read_bytes())
        for name in names
    }


def _recorded(state: Mapping[str, Any]) -> dict[str, Any]:
    """Collect what the files held when the study was begun; folders of 0.3 do not tell."""
    contents: Mapping[str, str] = state.get("contents", {})
    return {
        name: parse_yaml(text) if name in (STUDY, BASE) else text for name, text in contents.items()
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


def _state(folder: Path) -> Mapping[str, Any]:
    path = folder / STATE
    if not path.is_file():
        raise InputError(f"{folder}: holds no study, expected the folder of `sdt-drake study`")
    try:
        state = json.loads(path.read_text(encoding="utf-8"))
        texts = [state["fingerprint"], *state["outcomes"]]
        texts += [*state["files"].values(), *state["versions"].values()]
        texts += state.get("contents", {}).values()
        "".join(texts)  # a TypeError, if one is none
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise InputError(
            f"{path}: cannot be used; expected the file that `sdt-drake study` wrote"
        ) from None
    return state
