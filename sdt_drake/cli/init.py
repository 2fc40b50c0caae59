"""The command `init`."""

from __future__ import annotations

import shlex
from pathlib import Path

from sdt_drake.cli.common import Target, check_folder
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


def run(folder: Target, /) -> None:
    """Put a robot, a motion, motors, a scenario and a study into a folder, to make them your own.

    example: sdt-drake init my_trainer

    Args:
        folder: new, or empty
    """
    check_folder(folder)
    if folder.is_dir() and any(folder.iterdir()):
        raise InputError(f"{folder}: is not empty, expected a new folder, or an empty one")
    files = sorted(_STARTER.iterdir())
    schemas = sorted((models_dir() / "schemas").iterdir())
    with replacing_files(folder) as new:
        for file in files:
            write_text(new / file.name, file.read_text(encoding="utf-8"))
        # Beside the files, so that editors check them wherever the folder is copied to.
        for file in schemas:
            write_text(new / "schemas" / file.name, file.read_text(encoding="utf-8"))
    for file in files:
        say(f"{folder / file.name} written")
    say(f"{folder / 'schemas'} written: what editors check the files against")
    say(f"\ncd {shlex.quote(str(folder))}{_NEXT}")
