"""The command `view`."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.cli.common import (
    Changes,
    Flag,
    Given,
    Held,
    Integer,
    OtherRobot,
    Out,
    number,
    one_of,
)
from sdt_drake.cli.printing import echo, print_document_table
from sdt_drake.io.errors import InputError, within
from sdt_drake.io.formats import TABLES

if TYPE_CHECKING:
    from sdt_drake.io.arrays import Array
    from sdt_drake.motion import Story
    from sdt_drake.robot.robot import Robot as RobotModel


def run(
    what: Annotated[str, one_of("scenario", "motion", "robot", name="SCENARIO|MOTION|ROBOT")],
    /,
    *,
    robot: OtherRobot = None,
    pilot: Flag = False,
    rate: Annotated[float | None, number(gte=0.01, lte=1000)] = None,
    port: Annotated[Integer | None, number(gte=1024, lte=65535)] = None,
    once: Flag = False,
    out: Annotated[Out, Parameter(metavar="FILE.html")] = None,
    held: Held = Held(),
    given: Given = Given(),
) -> None:
    """Show a motion, or a robot with its axes and masses, in 3D: in a browser or as a page.

    example: sdt-drake view coupled_pi_ctc --out run.html

    Args:
        what: scenario to simulate, motion profile to plan, motion file or recording to play, or
            robot to turn with sliders: shipped name, or .yaml, .csv, .sdf or .urdf file
        pilot: start with the pilot's own view
        rate: live view: speed of the playback, 2 for twice as fast, 0.01 to 1000 (default: 1)
        port: live view: port, 1024 to 65535 (default: a free one)
        once: live view: stop at the end of the motion
        out: page (.html) to write in place of the live view
    """
    from sdt_drake.io.resources import named
    from sdt_drake.pilot.head import has_head
    from sdt_drake.robot.xml_files import is_robot
    from sdt_drake.show.view3d.scene import check_angles
    from sdt_drake.show.view3d.viewer import PAGES, play, record_html

    if out is not None:
        common.check_file(out, PAGES)
        common.refuse("has no effect with --out", rate=rate, port=port, once=once)
    if is_robot(named(what, "scenario", "motion", "robot")):
        unused = "has no effect on a robot"
        common.refuse(unused, robot=robot, pilot=pilot, rate=rate, changes=given.changes)
        _robot(what, held, out, port, once)
        return
    title, model, time, q, story = _motion(what, robot, held, pilot, given.changes)
    with within(what):
        check_angles(model, time, q)
    if out is not None:
        record_html(model, time, q, out, title=title, pilot=pilot, story=story)
        echo(f"{out} written")
        return
    announce = _announcing(title, once, has_head(model))
    play(model, time, q, rate=rate or 1.0, pilot=pilot, port=port, once=once, announce=announce)


def _announcing(title: str, once: bool, has_head: bool) -> Callable[[str], None]:
    """Return a function that prints the address of a live view, and what its violet head is."""
    from sdt_drake.pilot.orientation import CAUTION

    def announce(address: str) -> None:
        echo(f"{title}: {address}" + ("" if once else "; end it with Ctrl-C"))
        if has_head:
            echo(f"The violet head shows the felt attitude. {CAUTION}")

    return announce


def _robot(what: str, held: Held, out: Path | None, port: int | None, once: bool) -> None:
    """Show a robot by itself."""
    from sdt_drake.show.view3d import robot_page as shown

    model = held.load(what)
    links = shown.moving_links(model)
    title = shown.sentence(model, links)
    if out is None:
        echo(f"{title}.")
        for table in (shown.joint_table(model), shown.link_table(links)):
            echo()
            print_document_table(table)
        for line in shown.limits_of_use(model):
            echo(f"note: {line}")
        echo()
        echo("Press Open Controls for sliders of the joints and, under Scene, the masses.")
        announce = _announcing(model.name, once, has_head=False)
        shown.show_robot(model, port=port, once=once, announce=announce)
        return
    shown.robot_html(model, out)
    echo(f"{title}; {out} written")
    for line in shown.limits_of_use(model):
        echo(f"note: {line}")
    if not model.lacks:
        options = shlex.join(["--robot", what, *held.words])
        echo(f"next, for files to run it: sdt-drake init {options} DIR")


def _motion(
    what: str, robot: str | None, held: Held, pilot: bool, changes: Changes
) -> tuple[str, RobotModel, Array, Array, Story]:
    """Return title, robot, time [s], joint angles [rad] and story of a motion or a scenario."""
    from sdt_drake.io.resources import find_file, named
    from sdt_drake.io.tables import check_limits, read_table
    from sdt_drake.motion import INTERPOLATION_PERIOD, Story, load_plan, story_of
    from sdt_drake.pilot.head import check_head

    kinds = ("scenario", "motion")
    if Path(named(what, *kinds)).suffix not in ("", ".yaml", ".yml", *TABLES):
        raise InputError(
            f"{what}: expected a .yaml, .csv, .mat or .parquet file, or a shipped name"
        )
    if common.is_scenario(what):
        common.refuse(f"has no effect on a scenario, use --set robot={robot}", robot=robot)
        common.refuse("has no effect on a scenario, use --set hold=...", hold=held.hold)
        common.refuse("has no effect on a scenario, use --set tip=...", tip=held.tip)
        return _simulated(what, check_head if pilot else None, changes)
    file = find_file(what, *kinds)
    common.refuse_changes(changes, what)
    model = held.load(robot)
    if pilot:
        check_head(model)
    if file.suffix in TABLES:
        time, columns = read_table(file)
        q = columns.get("q", columns.get("q_ref"))
        if q is None:
            raise InputError(f"{file}: no columns q_1.. or q_ref_1.., the joint angles [rad]")
        if q.shape[1] != model.n:
            raise InputError(
                f"{file}: angles of {q.shape[1]} joint(s), robot '{model.name}' has {model.n}; "
                "give the robot of the table with --robot"
            )
        check_limits(file, time, columns)
        return file.stem, model, time, q, Story()
    motion = load_plan(file, model, period=INTERPOLATION_PERIOD, torque_margin=1.0).motion
    return file.stem, model, motion.time, motion.q, story_of(file, model, motion)


def _simulated(
    path: str, check: Callable[[RobotModel], None] | None, changes: Changes
) -> tuple[str, RobotModel, Array, Array, Story]:
    """Simulate a scenario and return the same as `_motion`; check its duration before."""
    from sdt_drake.motion import story_of
    from sdt_drake.show.view3d.scene import check_duration

    design = common.design_of(path, changes, check)
    with within(path):
        check_duration(design.reference.tracked.duration)
    recording = sdt.simulate(design)
    story = story_of(design.scenario.motion, design.device.simulated, design.reference.tracked)
    return design.scenario.name, design.device.simulated, recording.time, recording.q, story
