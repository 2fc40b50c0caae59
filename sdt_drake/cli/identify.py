"""The command `identify`."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.cli.common import (
    Columns,
    Cutoff,
    Held,
    OutFolder,
    Robot,
    Side,
    Trust,
    number,
    one_of,
)
from sdt_drake.cli.printing import asked, echo, print_document_table
from sdt_drake.io.errors import InputError
from sdt_drake.io.shown import listed


def run(
    robot: Robot,
    recordings: Annotated[list[str], Parameter(name="RECORDING")],
    /,
    *,
    out: OutFolder = Path("identified"),
    columns: Columns = None,
    side: Side = None,
    validate: Annotated[list[str] | None, Parameter(consume_multiple=True)] = None,
    held_out: Annotated[float | None, number(gt=0, lt=1)] = None,
    only: Literal["payload", "friction"] | None = None,
    payload: str | None = None,
    cutoff: Cutoff = None,
    scenario: Annotated[str | None, one_of("scenario")] = None,
    anyway: bool = False,
    trust: Trust = False,
    held: Held = Held(),
) -> None:
    """Identify the parameters of a robot from recordings, and write the identified robot.

    example: sdt-drake identify sdt run.csv --out identified

    Args:
        recordings: CSV files with time, q_k and tau_k for every joint k, or recordings of
            `simulate`
        out: folder for the results
        validate: held-out recordings (default: the end of each recording is held out)
        held_out: share of each recording, at its end, that is held out without --validate
            (default: 1/3)
        only: identify this alone, and take all else from the robot's file
        payload: link that `--only payload` identifies (default: payload)
        cutoff: frequency below which torques are compared [Hz] (default: the one that predicts
            held-out torques best)
        anyway: write the files although findings say that the recording must be corrected first
        scenario: scenario whose motion, drives and controller the written scenario gets (default:
            real_device for the shipped robot, else the drives' cascade with the recorded motion)
    """
    from sdt_drake.machine.identify.files import base_scenario
    from sdt_drake.machine.identify.filtering import HELD_OUT
    from sdt_drake.machine.identify.model import identified_robot
    from sdt_drake.show.reports import identification as analysis

    if validate:
        common.refuse("has no effect with --validate", held_out=held_out)
    if only != "payload":
        common.refuse("has an effect with --only payload only", payload=payload)
    common.check_folder(out, analysis.FILES)
    model = held.load(robot)
    base = base_scenario(model, scenario)
    found = sdt.identify(
        model,
        recordings,
        validate=validate or (),
        columns=columns,
        side=side,
        only=only,
        payload=payload or "payload",
        cutoff=cutoff,
        held_out=held_out or HELD_OUT,
    )
    better, files = identified_robot(found), found.plant_friction
    for line in analysis.result(found):
        echo(line)
    for one in found.findings:
        echo(f"warning: {one}")
    echo()
    print_document_table(analysis.errors_table(found, better))
    echo()
    print_document_table(analysis.friction_table(found, files))
    for line in (*analysis.in_short(found), *analysis.friction_notes(found, files)):
        echo(f"note: {line}")
    kinds = dict.fromkeys(one.kind for one in found.findings if one.spoils)
    if kinds and not anyway and not asked("Write the identified robot anyway?"):
        raise InputError(
            f"{out}: nothing is written: {listed([*kinds])} (see the warnings) would spoil it, "
            "expected a corrected recording or mapping, or --anyway"
        )
    page, notes = analysis.write_identified(found, better, files, out, base)
    for line in notes:
        echo(f"note: {line}")
    echo(f"\n{page} written")
