"""The folder of a study, from which the study can be resumed, shown and repeated.

The folder contains copies of all files that the study names. So the folder may be moved, and the
original files may be changed.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from sdt_drake.io.errors import InputError
from sdt_drake.io.files import alone_in, checked_input, write_text
from sdt_drake.io.resources import PACKAGE_PREFIX
from sdt_drake.io.versions import other_versions, versions
from sdt_drake.io.yaml_files import parse_yaml, read_yaml
from sdt_drake.studies.job import BASE, STUDY, Job, digest
from sdt_drake.studies.runs import Runner
from sdt_drake.studies.store import DATABASE, RESULTS, About, Store, create
from sdt_drake.studies.study import Study, load_study, read_study

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
        raise InputError(f"{folder}: no study to resume; run without resume=True to begin one")

    def refuse() -> None:
        raise InputError(f"{folder}: another process runs this study; wait until it ends")

    with alone_in(folder, refuse):
        if not holds_study(folder):
            if any(not path.name.startswith(".") for path in folder.iterdir()):
                raise InputError(
                    f"{folder}: contains other files, expected an empty folder or a new one"
                )
            texts = {variable.name: variable.takes_texts for variable in job.study.variables}
            create(folder, job.about, texts, job.outcomes)
            resume = True
        with Store(folder) as store:
            _check_same(job.about, store.about, folder)
            if not resume:
                raise InputError(f"{folder}: contains this study; continue it with resume=True")
            store.check_numbers(len(job.study))
            job.save_files(folder)
            for name in (BASE, STUDY):
                write_text(folder / name, job.about.contents[name])
            yield store


def _check_same(job: About, there: About, folder: Path) -> None:
    """Raise InputError unless a folder's study is the one of a job, with the same versions."""
    problems = []
    if other := other_versions(there.versions, job.versions):
        problems.append(f"{folder}: begun with {other}; use another folder")
    if other := _differences(_parsed(there), _parsed(job)):
        problems.append(
            f"{folder}: contains another study, which differs in {other}; use another folder"
        )
    if problems:
        raise InputError(*problems)


def holds_study(folder: Path) -> bool:
    """Return whether a folder contains a study."""
    return any((folder / name).is_file() for name in (DATABASE, RESULTS))


def load_folder(folder: Path) -> Study:
    """Return the study of a folder. No code in the folder is run.

    Raises:
        InputError: if there is no study, or a file cannot be used or was changed after the runs.
    """
    with Store(folder) as store:
        study, _ = read_study(folder / STUDY)
        own = {x: y for x, y in _parsed(store.about).items() if not x.startswith(PACKAGE_PREFIX)}
    there = {
        name: read_yaml(folder / name)
        if name in (STUDY, BASE)
        else digest(checked_input(folder / name).read_bytes())
        for name in own
    }
    if found := _differences(own, there):
        raise InputError(
            f"{folder}: {found} changed since the study was begun; restore the files, "
            "and run the changed study in another folder"
        )
    return study


def load_runner(folder: Path, *, trust: bool = False) -> tuple[Runner, tuple[str, ...], str]:
    """Return a runner for rows of a study folder, names of its outcomes, and changed versions.

    Args:
        folder: folder of the study.
        trust: whether Python files in it are run without a question.

    Raises:
        InputError: as `load_folder`.
    """
    load_folder(folder)
    with Store(folder) as store:
        about, outcomes = store.about, tuple(store.outcome_names)
    study, base = load_study(folder / STUDY, trust=trust)
    places = {name: str(folder / place) for name, place in about.files.items()}
    return Runner(study, base, places), outcomes, other_versions(about.versions, versions())


def _parsed(about: About) -> dict[str, Any]:
    """Return the study and the scenario as data, and the hashes of the other files."""
    contents = about.contents.items()
    return {name: parse_yaml(x) if name in (STUDY, BASE) else x for name, x in contents}


def _differences(old: Mapping[str, Any], new: Mapping[str, Any]) -> str:
    """Return the files that differ, and the dotted names of their fields, as text; "" if none do.

    `timeout` is left out: it does not change the result of a run.
    """
    texts = []
    for name in {**old, **new}:
        fields = [x for x in _fields(old.get(name), new.get(name)) if x != "timeout"]
        more = ["..."] if len(fields) > _MAX_NAMES else []
        inner = ", ".join([*filter(None, fields[:_MAX_NAMES]), *more])
        if fields:
            texts.append(f"{name} ({inner})" if inner else name)
    return ", ".join(texts)


def _fields(old: Any, new: Any, name: str = "") -> Iterator[str]:
    if isinstance(old, dict) and isinstance(new, dict):
        for key in {**old, **new}:
            yield from _fields(old.get(key), new.get(key), f"{name}.{key}".lstrip("."))
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for k, pair in enumerate(zip(old, new, strict=True)):
            yield from _fields(*pair, f"{name}[{k + 1}]")
    elif old != new:
        yield name
