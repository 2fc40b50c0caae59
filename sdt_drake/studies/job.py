"""A study with the contents of all its files, which a process on any machine can run."""

import dataclasses
import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from sdt_drake.analysis.stops import setting_of
from sdt_drake.io.errors import InputError, within
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
from sdt_drake.studies.store import About
from sdt_drake.studies.study import Study

STUDY, BASE = "study.yaml", "scenario.yaml"
"""Places of the study and its base scenario in the folder of the study."""


@dataclass(frozen=True)
class Job:
    """A study that can be sent to another machine."""

    study: Study
    """The study, as loaded."""
    base: Scenario
    """The base scenario of the study, as loaded."""
    files: dict[str, bytes]
    """Contents of the files outside the package, by their places in the folder of the study."""
    outcomes: tuple[str, ...]
    """Names of the outcomes of a run."""
    about: About
    """Identity of the study."""

    def runner(self, folder: Path) -> Runner:
        """Return a runner of rows that uses copies of the files, which are written to `folder`."""
        self.save_files(folder)
        places = {name: f"{folder / place}" for name, place in self.about.files.items()}
        for name, place in self.about.files.items():  # `make_job` has checked them
            accept(Path(places[name]), self.files[place])
        return Runner(self.study, self.base, places)

    def save_files(self, folder: Path) -> None:
        """Write the files into a folder.

        Raises:
            InputError: if a file cannot be written.
        """
        for place, content in self.files.items():
            with replacing(folder / place) as partial:
                partial.write_bytes(content)


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
    design = make_design(base)
    n = design.nominal.n
    if study.stops is not None:
        with within(place="stops"):
            setting_of(design, study.stops)
    places: dict[str, str] = {}  # of the files outside the package, by name
    contents: dict[str, bytes] = {}
    for field, name in _references(study, base):
        place = reference = named(name, field.file)
        file = find_file(reference, field.file, base=study.folder)
        joints = _joints(field.name, file, base)
        if joints not in (None, n):
            raise InputError(f"{name}: {joints} joint(s), expected {n} as in the base scenario")
        if not reference.startswith(PACKAGE_PREFIX):  # each in a folder of its own
            place = places.setdefault(name, f"files/{len(places) + 1}/{Path(name).name}")
        with trusting(trust):
            is_code = field.file == "controllers"
            contents[place] = trusted_code(file) if is_code else file.read_bytes()
    texts = {
        STUDY: yaml_text(dataclasses.replace(study, scenario=BASE)),
        BASE: yaml_text(base, moved(base, places)),
        **{place: digest(content) for place, content in contents.items()},
    }
    files = {place: contents[place] for place in places.values()}
    outcomes = outcome_names(base, n, study.stops)
    return Job(study, base, files, outcomes, About(texts, places, versions()))


def digest(content: bytes) -> str:
    """Return the SHA-256 of a file's content, as `About.contents` has it."""
    return hashlib.sha256(content).hexdigest()


def _joints(field: str, file: Path, base: Scenario) -> int | None:
    """Return the number of joints of a robot or a motion; None for other files.

    Raises:
        InputError: for a file that cannot be used. Every run of it would fail.
    """
    if field == "robot":
        return load_robot(file, hold=base.hold or "", tip=base.tip).n
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
