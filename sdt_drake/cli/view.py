"""Show a motion in 3D, live in a browser or as a web page."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.cli.common import say
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.tables import TABLES, check_limits, read_table

if TYPE_CHECKING:
    from sdt_drake.motion import Story
    from sdt_drake.robot.robot import Robot

EXAMPLE = "sdt-drake view coupled_pi_ctc --record run.html"


def add(parser: argparse.ArgumentParser) -> None:
    common.add_scenario(
        parser,
        "a scenario, which is simulated; a motion, which is planned; a recording or a planned "
        "motion: .yaml or .csv file, or the name of a scenario or motion that ships",
        "SCENARIO|MOTION|FILE.csv",
    )
    text = "SDF or URDF file (default: the shipped device, or the scenario's)"
    common.add_robot(parser, text, None)
    parser.add_argument(
        "--record", type=common.some_path, metavar="FILE.html", help="write a page that plays"
    )
    parser.add_argument("--pilot", action="store_true", help="start with the pilot's own view")
    parser.add_argument(
        "--rate",
        type=common.number(minimum=0.01, maximum=1000),
        default=1.0,
        help="live: 2 for twice as fast, 0.01 to 1000",
    )
    parser.add_argument(
        "--port",
        type=common.number(int, minimum=1024, maximum=65535),
        help="live: 1024 to 65535 (default: a free one)",
    )
    parser.add_argument("--once", action="store_true", help="live: stop at the end of the motion")


def run(options: argparse.Namespace) -> None:
    from sdt_drake.show.view3d.scene import check_angles
    from sdt_drake.show.view3d.viewer import PAGES, play, record_html

    if options.record is not None:
        common.check_file(options.record, PAGES)
        common.refuse_options(options, "has no effect with --record", "rate", "port", "once")
    title, robot, time, q, story = _motion(options)
    with common.naming(options.scenario):
        check_angles(robot, time, q)
    if options.record is not None:
        record_html(robot, time, q, options.record, title=title, pilot=options.pilot, story=story)
        say(f"{options.record} written")
        return
    end = "" if options.once else "; Ctrl-C ends it"
    play(
        robot,
        time,
        q,
        rate=options.rate,
        pilot=options.pilot,
        port=options.port,
        once=options.once,
        announce=lambda address: say(f"{title}: {address}{end}"),
    )


def _motion(options: argparse.Namespace) -> tuple[str, Robot, Array, Array, Story]:
    """Title, robot, time [s], joint angles [rad] and story of what was asked for."""
    from sdt_drake.io.resources import find_file, named
    from sdt_drake.motion import INTERPOLATION_PERIOD, Story, load_plan, story_of
    from sdt_drake.robot.head import check_head

    kinds = ("scenario", "motion")
    if Path(named(options.scenario, *kinds)).suffix not in ("", ".yaml", ".yml", *TABLES):
        raise InputError(
            f"{options.scenario}: expected a .yaml, .csv, .mat or .parquet file, or a shipped name"
        )
    if common.is_scenario(options.scenario):
        return _simulated(options)
    file = find_file(options.scenario, *kinds)
    common.refuse_changes(options)
    robot = sdt.load_robot(options.robot or common.ROBOT)
    if options.pilot:
        check_head(robot)
    if file.suffix in TABLES:
        return file.stem, robot, *_angles(file, robot), Story()
    motion = load_plan(file, robot, period=INTERPOLATION_PERIOD, torque_margin=1.0).motion
    return file.stem, robot, motion.time, motion.q, story_of(file, robot, motion)


def _simulated(options: argparse.Namespace) -> tuple[str, Robot, Array, Array, Story]:
    """The same of a scenario; one that is too long is not run in vain."""
    from sdt_drake.motion import story_of
    from sdt_drake.robot.head import check_head
    from sdt_drake.show.view3d.scene import check_duration

    instead = f"the scenario names the robot, expected --set robot={options.robot}"
    common.refuse_options(options, instead, "robot")
    design = common.design_of(options, check_head if options.pilot else None)
    with common.naming(options.scenario):
        check_duration(design.motion.duration)
    recording = sdt.simulate(design)
    story = story_of(design.scenario.motion, design.robot, design.motion)
    return design.scenario.name, design.robot, recording.time, recording.q, story


def _angles(path: Path, robot: Robot) -> tuple[Array, Array]:
    """Time [s] and joint angles [rad] of a table."""
    time, columns = read_table(path)
    q = columns.get("q", columns.get("q_ref"))
    if q is None:
        raise InputError(f"{path}: no columns q_1.. or q_ref_1.., the joint angles [rad]")
    if q.shape[1] != robot.n:
        raise InputError(
            f"{path}: angles of {q.shape[1]} joint(s), robot '{robot.name}' has {robot.n}; "
            "--robot names that of the table"
        )
    check_limits(path, time, columns)
    return time, q
