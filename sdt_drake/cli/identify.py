"""The command `identify`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.cli.common import Columns, Robot, Side, Target, Trust, number, one_of
from sdt_drake.cli.printing import echo, print_document_table
from sdt_drake.io.errors import InputError


def run(
    robot: Robot,
    recordings: Annotated[list[str], Parameter(name="RECORDING")],
    /,
    *,
    out: Target = Path("identified"),
    columns: Columns = None,
    side: Side = None,
    validate: Annotated[list[str] | None, Parameter(consume_multiple=True)] = None,
    held_out: Annotated[float, number(gt=0, lt=1), Parameter(show_default="1/3")] = 1 / 3,
    only: Literal["payload", "friction"] | None = None,
    payload: str = "payload",
    cutoff: Annotated[float | None, number(gte=0.1, lte=1000)] = None,
    scenario: Annotated[str | None, one_of("scenario")] = None,
    judge: Annotated[bool, Parameter(negative="")] = False,
    trust: Trust = False,
) -> None:
    """Identify the parameters of a robot from recordings, and write the identified robot.

    example: sdt-drake identify sdt run.csv --out identified

    Args:
        recordings: CSV files with time, q_k and tau_k for every joint k, or recordings of
            `simulate`; with --judge, friction.yaml may come first
        out: folder for the results
        validate: held-out recordings (default: the end of each recording is held out)
        held_out: share of each recording, at its end, that is held out
        only: identify this alone, and take all else from the robot's file
        payload: link that `--only payload` identifies
        cutoff: frequency below which torques are compared [Hz] (default: the one that predicts
            held-out torques best)
        scenario: scenario whose motion, drives and controller the written scenario gets (default:
            real_device for the shipped robot, else the drives' cascade with the recorded motion)
        judge: identify and write nothing; print the torque that ROBOT does not explain [%], with
            the friction of a file: identify --judge robot.sdf friction.yaml RECORDING
    """
    if judge:
        _judge(robot, recordings, columns, side, cutoff)
        return
    from sdt_drake.machine.identify.files import base_scenario
    from sdt_drake.machine.identify.model import identified_robot, plant_friction
    from sdt_drake.show.reports import identification as analysis

    common.check_folder(out, analysis.FILES)
    model = sdt.load_robot(robot)
    base = base_scenario(model, scenario)
    found = sdt.identify(
        model,
        recordings,
        validate=validate or (),
        columns=columns,
        side=side,
        only=only,
        payload=payload,
        cutoff=cutoff,
        held_out=held_out,
    )
    better, files = identified_robot(found), plant_friction(found)
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
    page, notes = analysis.write_identified(found, better, files, out, base)
    for line in notes:
        echo(f"note: {line}")
    echo(f"\n{page} written")


def _judge(
    robot: str, files: list[str], columns: Columns, side: Side, cutoff: float | None
) -> None:
    """Print the torque of recordings that a robot does not explain.

    The first of the files may contain the friction (.yaml).
    """
    from sdt_drake.show.reports.identification import judged_in_words, judged_table

    friction = None
    if Path(files[0]).suffix in (".yaml", ".yml"):
        friction, *files = files
    if not files:
        raise InputError("--judge: no recording, expected at least one after the friction file")
    judged = sdt.judge(robot, files, friction=friction, columns=columns, side=side, cutoff=cutoff)
    for line in judged_in_words(judged):
        echo(line)
    for one in judged.findings:
        echo(f"warning: {one}")
    echo()
    print_document_table(judged_table(judged))
