"""The command `init`."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import sdt_drake as sdt
from sdt_drake.cli.common import Target, check_folder, one_of
from sdt_drake.cli.printing import say
from sdt_drake.io.errors import InputError
from sdt_drake.io.files import replacing_files, write_text
from sdt_drake.io.resources import models_dir

_STARTER = Path(__file__).with_name("starter")

_NEXT = """
sdt-drake simulate scenario.yaml --out run.png     how well the joints follow
sdt-drake view scenario.yaml --record run.html     the device in 3D, in the browser
sdt-drake tune scenario.yaml                       inertia and gains
sdt-drake pilot scenario.yaml                      what the pilot feels
sdt-drake plan motion.yaml --robot robot.sdf       what the motion takes of the motors
sdt-drake study study.yaml --workers 2 --out mc    many devices; needs sdt_drake[study]

Change a file, or a field on the way: --set controller.kind=pi
Every field of every file: sdt-drake reference"""

_NEXT_OF_OWN = (
    ("view {robot} --out robot.html", "axes, limits and masses: are they right?"),
    ("simulate scenario.yaml --out run.html", "how well the joints follow"),
    ("plan motion.yaml --robot {robot}", "what the motion takes of the motors"),
    ("size sizing.yaml --workers 2 --out sizing", "motors that are enough; needs sdt_drake[study]"),
    ("export scenario.yaml --drive drives.yaml --out exported", "the motion, as drives read it"),
    ("excite {robot} --out excite.yaml", "a motion that shows masses and friction"),
    ("simulate scenario.yaml --out run.csv", "a recording, to try the next on"),
    ("identify {robot} run.csv --columns columns.yaml --out found", "what recordings tell"),
    ("study study.yaml --workers 2 --out mc", "many robots; needs sdt_drake[study]"),
)


def _next_of_own(robot: str) -> str:
    """What to run in the folder of a robot of one's own."""
    commands = [command.format(robot=shlex.quote(robot)) for command, _ in _NEXT_OF_OWN]
    width = max(map(len, commands))
    lines = [
        f"sdt-drake {command:{width}}   {text}"
        for command, (_, text) in zip(commands, _NEXT_OF_OWN, strict=True)
    ]
    last = "What is ASSUMED says so in its file. Every field of every file: sdt-drake reference"
    return "\n".join(["", *lines, "", last])


def run(
    folder: Target,
    /,
    *,
    robot: Annotated[
        str | None,
        one_of("robot", help="SDF or URDF file of a robot of your own (default: a new one)"),
    ] = None,
) -> None:
    """Put a robot, a motion, motors, a scenario and a study into a folder, to make them your own.

    With --robot, they are those of a robot that you have, with sizing, drives and columns.

    example: sdt-drake init my_trainer

    Args:
        folder: new, or empty
    """
    check_folder(folder)
    if folder.is_dir() and any(folder.iterdir()):
        raise InputError(f"{folder}: is not empty, expected a new folder, or an empty one")
    with replacing_files(folder) as new:
        if robot is None:
            names, then = _start(new), _NEXT
        else:
            from sdt_drake.cli.starting import write_own

            own = sdt.load_robot(robot)
            names = write_own(own, new, folder)
            then = _next_of_own(own.path.name)
        # Beside the files, so that editors check them wherever the folder is copied to.
        for file in sorted((models_dir() / "schemas").iterdir()):
            write_text(new / "schemas" / file.name, file.read_text(encoding="utf-8"))
    for name in names:
        say(f"{folder / name} written")
    say(f"{folder / 'schemas'} written: what editors check the files against")
    say(f"\ncd {shlex.quote(str(folder))}{then}")


def _start(folder: Path) -> list[str]:
    """Write the files of an invented device; their names."""
    files = sorted(_STARTER.iterdir())
    for file in files:
        write_text(folder / file.name, file.read_text(encoding="utf-8"))
    return [file.name for file in files]
