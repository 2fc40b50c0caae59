"""A functional mock-up unit (FMI 2, co-simulation) of a scenario's loop, for other simulators."""

from __future__ import annotations

import copy
import json
import tempfile
from collections.abc import Iterator
from pathlib import Path

from sdt_drake.io.errors import InputError, checked_choice, needing
from sdt_drake.io.files import replacing, write_text
from sdt_drake.io.resources import PACKAGE_PREFIX, find_file
from sdt_drake.io.versions import versions
from sdt_drake.io.yaml_files import yaml_text
from sdt_drake.run.design import Design
from sdt_drake.run.loop import EXTERNAL, Loop
from sdt_drake.run.scenario import Scenario

FMU_INPUTS = ("torque", "reference")
"""What comes from outside: the torque that is asked of the drives, or the reference."""

SCENARIO, ABOUT = "scenario.yaml", "about.json"

_SLAVE = """\
# Needs a Python with the version of sdt_drake that wrote this.
from sdt_drake.machine.fmu_slave import LoopSlave

# The loader of PythonFMU gives up a reference to these names, which it does not hold, with each
# instance: the second would find them gone.
_kept = [globals()] * 10_000


class Loop(LoopSlave):
    pass
"""


def write_fmu(design: Design, path: Path, inputs: str = "torque") -> None:
    """Write a loop as an FMU, which runs where Python has sdt_drake: it is coupled to that tool.

    Args:
        design: of the loop, on the coupled plant; with the files that its scenario names.
        path: of the .fmu file.
        inputs: one of FMU_INPUTS.

    Raises:
        InputError: if the loop cannot be closed from outside, has a controller of a file, or the
            file cannot be written.
    """
    checked_choice(inputs, FMU_INPUTS, "inputs")
    if design.scenario.controller.file:
        raise InputError(
            f"{design.scenario.controller.file}, code that no FMU runs; expected none",
            place="controller.file",
        )
    open_loop(design, inputs)  # refuses what cannot be
    with needing("an FMU needs pythonfmu", "sdt_drake[fmi]"):
        from pythonfmu import FmuBuilder
    with tempfile.TemporaryDirectory() as temporary, replacing(path) as partial:
        folder = Path(temporary)
        slave = write_text(folder / "sdt_drake_loop.py", _SLAVE)
        about = {"inputs": inputs, "version": versions()["package"]}
        write_text(folder / ABOUT, json.dumps(about))
        files = [folder / ABOUT, *_with_files(design.scenario, folder)]
        built = FmuBuilder.build_FMU(slave, folder / "out", files)
        partial.write_bytes(built.read_bytes())


def open_loop(design: Design, inputs: str) -> Loop:
    """Make the loop of a design with one of FMU_INPUTS from outside."""
    if inputs == "torque":
        return Loop(design, controller=EXTERNAL)
    return Loop(design, reference=EXTERNAL)


def _with_files(scenario: Scenario, folder: Path) -> Iterator[Path]:
    """Write a scenario, and copies of the files that it names beside it."""
    scenario = copy.deepcopy(scenario)
    for k, (owner, field) in enumerate(file_fields(scenario)):
        text = getattr(owner, field)
        if text and not text.startswith(PACKAGE_PREFIX):
            file = find_file(text)
            place = folder / f"{k}_{file.name}"
            place.write_bytes(file.read_bytes())
            setattr(owner, field, place.name)
            yield place
    yield write_text(folder / SCENARIO, yaml_text(scenario))


def file_fields(scenario: Scenario) -> list[tuple[object, str]]:
    """The fields of a scenario that name a file of data, each with the object that has it."""
    return [
        (scenario, "robot"),
        (scenario, "motion"),
        (scenario, "learned"),
        (scenario.device, "catalogue"),
        (scenario.plant.deviation, "spread"),
        (scenario.controller.model, "spread"),
    ]
