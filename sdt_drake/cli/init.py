"""The command `init`."""

import shlex
from pathlib import Path
from typing import Annotated

from sdt_drake.cli.common import Held, Target, check_folder, one_of, refuse
from sdt_drake.cli.printing import echo
from sdt_drake.io.errors import InputError
from sdt_drake.io.files import replacing_files, write_text
from sdt_drake.io.resources import models_dir

_STARTER = Path(__file__).with_name("starter")

_NEXT = """
sdt-drake simulate scenario.yaml --out run.png        errors of the joints
sdt-drake view scenario.yaml --out run.html           the device in 3D, in the browser
sdt-drake tune scenario.yaml                          inertia and controller gains
sdt-drake pilot scenario.yaml                         motion that the pilot feels
sdt-drake plan motion.yaml --robot robot.sdf          torques and speeds of the motors
sdt-drake study run study.yaml --workers 2 --out mc   many devices; needs sdt_drake[study]

Edit the files, or change single fields: --set plant.kind=axis
All fields of all files: sdt-drake docs files"""

_NEXT_OF_OWN = (
    ("view {robot} --out robot.html", "check axes, limits and masses"),
    ("simulate scenario.yaml --out run.html", "errors of the joints"),
    ("plan motion.yaml --robot {robot}", "torques and speeds of the motors"),
    ("size sizing.yaml --workers 2 --out sizing", "sufficient motors; needs sdt_drake[study]"),
    ("stops scenario.yaml --stops stops.yaml --out stopped", "what happens if power fails"),
    ("accept predict scenario.yaml --spec acceptance.yaml --out accepted", "an acceptance test"),
    ("accept plan scenario.yaml --spec acceptance.yaml --drive drives.yaml", "its motions"),
    ("export scenario.yaml --drive drives.yaml --out exported", "the motion as files for drives"),
    ("excite {robot} --out excite.yaml", "a motion to identify masses and friction"),
    ("simulate scenario.yaml --set motion=excite.yaml --out run.csv", "its simulated recording"),
    ("identify {robot} run.csv --columns columns.yaml --out found", "the identified robot"),
    ("study run study.yaml --workers 2 --out mc", "many robots; needs sdt_drake[study]"),
)
_LAST_OF_OWN = "Replace the values marked ASSUMED. All fields of all files: sdt-drake docs files"


def run(
    folder: Target,
    /,
    *,
    robot: Annotated[
        str | None,
        one_of("robot", help="SDF or URDF file of your own robot (default: a new example robot)"),
    ] = None,
    held: Held = Held(),
) -> None:
    """Write a robot, a motion, motors, a scenario and a study into a folder, for you to edit.

    With --robot, the files are for your own robot, with a sizing, stops, drives, columns and an
    acceptance test.

    example: sdt-drake init my_trainer

    Args:
        folder: new or empty folder
    """
    if robot is None:
        refuse("needs --robot", hold=held.hold, tip=held.tip)
    check_folder(folder)
    if folder.is_dir() and any(folder.iterdir()):
        raise InputError(f"{folder}: is not empty, expected a new or an empty folder")
    notes = list[str]()
    with replacing_files(folder) as new:
        if robot is None:
            names, then = [file.name for file in sorted(_STARTER.iterdir())], _NEXT
            for name in names:
                write_text(new / name, (_STARTER / name).read_text(encoding="utf-8"))
        else:
            from sdt_drake.machine.new_robot import notes_of, write_own

            own = held.load(robot)
            names, notes = write_own(own, new, folder), notes_of(own)
            quoted = shlex.quote(own.path.name)
            rows = [(command.format(robot=quoted), text) for command, text in _NEXT_OF_OWN]
            width = max(len(command) for command, _ in rows)
            lines = [f"sdt-drake {command:{width}}   {text}" for command, text in rows]
            then = "\n".join(["", *lines, "", _LAST_OF_OWN])
        # The schemas are copied, so that editors find them wherever the folder is moved.
        for file in sorted((models_dir() / "schemas").iterdir()):
            write_text(new / "schemas" / file.name, file.read_text(encoding="utf-8"))
    model = "a new example robot" if robot is None else f"the robot of {robot}"
    echo(f"{folder}: {len(names)} files for {model} written, and schemas for editors")
    for name in names:
        echo(f"  {name}")
    for line in notes:
        echo(f"note: {line}")
    echo(f"\ncd {shlex.quote(str(folder))}{then}")
