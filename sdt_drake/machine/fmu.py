"""Export a scenario's loop as a functional mock-up unit (FMI 2, co-simulation)."""

import json
import tempfile
from collections.abc import Iterator
from pathlib import Path

from sdt_drake.io.arguments import one_of
from sdt_drake.io.errors import InputError, needing
from sdt_drake.io.files import replacing, write_text
from sdt_drake.io.names import value_of
from sdt_drake.io.resources import PACKAGE_PREFIX, find_file
from sdt_drake.io.versions import versions
from sdt_drake.io.yaml_files import yaml_text
from sdt_drake.run.design import Design
from sdt_drake.run.loop import Loop, make_loop
from sdt_drake.run.loop_checks import EXTERNAL
from sdt_drake.run.scenario import Scenario

FMU_INPUTS = ("torque", "reference")
"""Inputs that an FMU can have: the torque command of the drives, or the reference."""

SCENARIO, ABOUT = "scenario.yaml", "about.json"

_SLAVE = """\
# Needs a Python with the version of sdt_drake that wrote this.
from sdt_drake.machine.fmu_slave import LoopSlave, give_reference

give_reference(globals())  # PythonFMU's loader executes this once per instance, then releases one


class Loop(LoopSlave):
    pass
"""


def write_fmu(design: Design, path: Path, inputs: str = "torque") -> None:
    """Write a loop as an FMU. It runs only where Python has the same version of sdt_drake.

    Args:
        design: design of the loop, on the coupled plant. The files of its scenario are copied.
        path: path of the .fmu file.
        inputs: one of FMU_INPUTS.

    Raises:
        InputError: if the loop cannot have these inputs, its controller comes from a Python file,
            or the FMU cannot be written.
    """
    one_of(inputs, "inputs", FMU_INPUTS)
    if design.scenario.controller.file:
        raise InputError(
            f"{design.scenario.controller.file}, but an FMU runs no such code; expected none",
            place="controller.file",
        )
    open_loop(design, inputs)  # raises if the loop cannot have these inputs
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
    """Return the loop of a design whose torque or reference, one of FMU_INPUTS, is an input."""
    if inputs == "torque":
        return make_loop(design, controller=EXTERNAL)
    return make_loop(design, reference=EXTERNAL)


def _with_files(scenario: Scenario, folder: Path) -> Iterator[Path]:
    """Write a scenario and copies of the files that it names; yield the paths."""
    changes = {}
    for k, field in enumerate(FILE_FIELDS):
        text = value_of(scenario, field)
        if text and not text.startswith(PACKAGE_PREFIX):
            file = find_file(text)
            place = folder / f"{k}_{file.name}"
            place.write_bytes(file.read_bytes())
            changes[field] = place.name
            yield place
    yield write_text(folder / SCENARIO, yaml_text(scenario.changed(changes)))


FILE_FIELDS = (
    "robot", "motion", "learned", "device.catalogue", "plant.deviation.spread",
    "controller.model.spread",
)  # fmt: skip
"""Fields of a scenario that name a data file."""
