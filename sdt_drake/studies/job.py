"""A study with the contents of all its files, which a process on any machine can run."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from sdt_drake.io.errors import InputError
from sdt_drake.io.files import replacing
from sdt_drake.io.names import value_of
from sdt_drake.io.resources import PACKAGE_PREFIX, find_file, named
from sdt_drake.io.trust import accept, trusted_code, trusting
from sdt_drake.io.versions import versions
from sdt_drake.io.yaml_files import yaml_text
from sdt_drake.motion import load_commanded
from sdt_drake.robot.robot import load_robot
from sdt_drake.run.design import load_device, make_design
from sdt_drake.run.scenario import Scenario
from sdt_drake.studies.fields import Field
from sdt_drake.studies.outcomes import outcome_names
from sdt_drake.studies.runs import FILE_FIELDS, Runner, moved
from sdt_drake.studies.study import Study


@dataclass(frozen=True)
class Job:
    """A study that can be sent to another machine."""

    study: Study
    """The study, as loaded."""
    base: Scenario
    """The base scenario of the study, as loaded."""
    files: dict[str, bytes]
    """Contents of the files outside the package, by their names in the study and its base."""
    outcomes: tuple[str, ...]
    """Names of the outcomes of a run."""
    fingerprint: str
    """Hash of study, base scenario and files. Equal fingerprints give equal rows."""
    versions: dict[str, str]
    """Versions of the packages that compute the rows."""

    def runner(self, folder: Path) -> Runner:
        """Return a runner of rows that uses copies of the files, which are written to `folder`."""
        places = self.save_files(folder)
        for name, place in places.items():  # `make_job` has checked that they are trusted
            accept(Path(place), self.files[name])
        return Runner(self.study, self.base, places)

    def save_files(self, folder: Path) -> dict[str, str]:
        """Write the files into a folder and return the path of each by its name.

        Raises:
            InputError: if a file cannot be written.
        """
        places = {name: f"{folder / place}" for name, place in places_of(self.files).items()}
        for name, place in places.items():
            with replacing(Path(place)) as partial:
                partial.write_bytes(self.files[name])
        return places


def places_of(files: Mapping[str, bytes]) -> dict[str, str]:
    """Return a path for each file, by its name in the study: each in a folder of its own."""
    return {name: f"{i + 1}/{Path(name).name}" for i, name in enumerate(files)}


def make_job(study: Study, base: Scenario, *, trust: bool = False) -> Job:
    """Check that the base scenario can be run, and read all files that the study needs.

    Args:
        study: the study, as loaded.
        base: its base scenario, as loaded.
        trust: whether Python files that variables name are run without a question.

    Raises:
        InputError: if the base scenario cannot be run, a file is missing or cannot be used, or
            the numbers of joints differ.
    """
    n = make_design(base).robot.n
    files, hashes = {}, []
    for field, name in _references(study, base):
        reference = named(name, field.file)
        file = find_file(reference, field.file, base=study.folder)
        joints = _joints(field.name, file, base)
        if joints not in (None, n):
            raise InputError(f"{name}: {joints} joint(s), expected {n} as in the base scenario")
        with trusting(trust):
            content = trusted_code(file) if field.file == "controllers" else file.read_bytes()
        hashes.append(hashlib.sha256(content).hexdigest())
        if not reference.startswith(PACKAGE_PREFIX):
            files[name] = content
    # Rows depend neither on the paths of files nor on the time-out.
    same_study = dataclasses.replace(study, scenario="", timeout=1.0)
    depends = {
        "study": yaml_text(same_study),
        "base": yaml_text(base, moved(base, places_of(files))),
        "files": hashes,
    }
    fingerprint = hashlib.sha256(json.dumps(depends, sort_keys=True).encode()).hexdigest()
    return Job(study, base, files, outcome_names(base, n), fingerprint, versions())


def _joints(field: str, file: Path, base: Scenario) -> int | None:
    """Return the number of joints of a robot or a motion; None for other files.

    Raises:
        InputError: for a file that cannot be used. Every run of it would fail.
    """
    if field == "robot":
        return load_robot(file).n
    if field == "motion":
        return load_commanded(file, load_device(base), base.period).n
    return None


def _references(study: Study, base: Scenario) -> Iterator[tuple[Field, str]]:
    """Yield the field and the name of each file of the base scenario and its variants."""
    for field in FILE_FIELDS:
        if name := value_of(base, field.name):
            yield field, name
        for variable in study.variables:
            if field in variable.targets:
                yield from ((field, str(name)) for name in variable.examples)
