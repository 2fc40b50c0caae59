"""Test a device for acceptance: plan the motions, judge recordings, or predict both.

The subcommands are functions of this module; the command has no other form.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.cli.common import Columns, Given, Out, Scenario, Side, Target, one_of
from sdt_drake.cli.printing import echo, print_document_table, print_table

if TYPE_CHECKING:
    from sdt_drake.machine.accept.results import Accepted

Spec = Annotated[str, one_of("acceptance tests")]


def plan(
    robot: Annotated[str, one_of("scenario", "robot", name="ROBOT|SCENARIO")],
    /,
    *,
    spec: Spec = "acceptance",
    drive: Annotated[str | None, one_of("drives")] = None,
    out: Target = Path("acceptance"),
    given: Given = Given(),
) -> None:
    """Write the motions of an acceptance test, within all limits of a device.

    example: sdt-drake accept plan training --drive drives --out acceptance

    Args:
        robot: a robot, or a scenario with its chosen motors and drives: shipped name or file
        spec: file of tests and limits, or the name of a shipped one
        drive: file of the drives, for the files that they read (default: motion files alone)
        out: folder for the files
    """
    from sdt_drake.io.resources import find_file
    from sdt_drake.machine.accept.plan import FILES, scenario_of, write_plan
    from sdt_drake.machine.drive_files.drives import load_drives
    from sdt_drake.robot.xml_files import is_robot
    from sdt_drake.run.scenario import robot_of

    common.check_folder(out, FILES)
    if is_robot(find_file(robot, "scenario", "robot")):
        common.refuse_changes(given.changes, robot)
        scenario = scenario_of(robot)
    else:
        scenario = sdt.load(robot, dict(given.changes))
    if drive is not None:  # before the motions are planned, which takes longer
        load_drives(drive, robot_of(scenario).n)
    planned = sdt.accept_plan(scenario, spec)
    echo(f"Acceptance test {planned.summary().title}")
    for line in planned.left_out:
        echo(f"note: {line}")
    print_table(*planned.summary()[1:3])
    write_plan(planned, out, drive)
    echo(f"{out} written")
    echo("Obstacles and people in the machine are not taken into account.")
    echo(
        f"next: record each motion with q and q_ref, then sdt-drake accept judge {out} RECORDING..."
    )


def judge(
    folder: Annotated[str, Parameter(name="DIR")],
    recordings: Annotated[list[str], Parameter(name="RECORDING")],
    /,
    *,
    spec: Annotated[str | None, one_of("acceptance tests")] = None,
    columns: Columns = None,
    side: Side = None,
    out: Out = None,
) -> None:
    """Judge recordings of the motions: characteristics with intervals, against the limits.

    example: sdt-drake accept judge acceptance run_1.csv run_2.csv --out accepted

    Args:
        folder: folder of `accept plan`
        recordings: CSV files with time, q_k and q_ref_k for every joint k, one of each motion in
            any order, or recordings of `simulate`
        spec: file of limits (default: that of the folder)
        out: folder for two sheets and the table of all numbers; or file for the table alone (.csv,
            .json) or the figure (.png, .svg, .pdf)
    """
    _check(out)
    accepted = sdt.accept_judge(folder, recordings, spec=spec, columns=columns, side=side)
    _deliver(accepted, accepted.robot.name, out)


def predict(
    scenario: Scenario,
    /,
    *,
    spec: Spec = "acceptance",
    out: Out = None,
    given: Given = Given(),
) -> None:
    """Plan an acceptance test, simulate it with the loop of a scenario, and judge it.

    example: sdt-drake accept predict training --out predicted

    Args:
        spec: file of tests and limits, or the name of a shipped one
        out: as for `accept judge`
    """
    from sdt_drake.machine.accept.predict import predicted

    _check(out)
    accepted = predicted(sdt.load(scenario, dict(given.changes)), spec, echo)
    _deliver(accepted, f"{accepted.robot.name}, simulated as {scenario}", out)


def _check(out: Path | None) -> None:
    from sdt_drake.io.results import RESULT_TABLES
    from sdt_drake.show.reports.accept import FILES

    common.check_out(out, False, ["", *RESULT_TABLES])
    if out is not None and not out.suffix:
        common.check_folder(out, FILES)


def _deliver(accepted: "Accepted", title: str, out: Path | None) -> None:
    from sdt_drake.show.reports.accept import accept_findings, accept_tables, write_accepted

    for line in accept_findings(accepted):
        echo(line)
    for line in accepted.left_out:
        echo(f"note: {line}")
    for table in filter(None, accept_tables(accepted).values()):
        echo()
        print_document_table(table)
    if out is not None and not out.suffix:
        echo(f"\n{write_accepted(accepted, title, out)} written")
        out = None
    common.deliver(out, False, accepted.plot, accepted.save)
