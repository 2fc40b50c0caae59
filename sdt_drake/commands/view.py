"""Show a motion in 3D, live or as a web page."""

from __future__ import annotations

import argparse
from pathlib import Path

from sdt_drake.commands.common import ROBOT, add_command, design_of, say
from sdt_drake.errors import InputError, checked_number

PERIOD = 0.005  # of the paper's planner [s]


def add(commands) -> None:
    parser = add_command(
        commands,
        "view",
        run,
        "show a motion in 3D, live in a browser or as a web page",
        "sdt-drake view package://sdt/scenarios/coupled_pi_ctc.yaml --record run.html",
    )
    parser.add_argument(
        "motion",
        metavar="SCENARIO.yaml|FILE.csv|NAME",
        help="a scenario, which is simulated; a recording or a motion; a motion that ships",
    )
    parser.add_argument("--robot", help="SDF file (default: the shipped device, or the scenario's)")
    parser.add_argument("--record", type=Path, metavar="FILE.html", help="write a page that plays")
    parser.add_argument("--pilot", action="store_true", help="start with the pilot's own view")
    parser.add_argument("--rate", type=float, default=1.0, help="live: 2 for twice as fast")
    parser.add_argument("--port", type=int, help="live: 1024 to 65535 (default: a free one)")
    parser.add_argument("--once", action="store_true", help="live: stop at the end of the motion")


def run(options: argparse.Namespace) -> None:
    from sdt_drake.pilot import check_head
    from sdt_drake.viewer import check_html, check_port, play, record_html

    checked_number(options.rate, "--rate", minimum=0.0, exclusive=True)
    check_port(options.port)
    if options.record is not None:
        check_html(options.record)
        _check_live_options(options)
    title, robot, time, q = _motion(options)
    if options.pilot:
        check_head(robot)
    if options.record is not None:
        record_html(robot, time, q, options.record, title=title, pilot=options.pilot)
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


def _check_live_options(options: argparse.Namespace) -> None:
    given = {
        "--rate": options.rate != 1,
        "--port": options.port is not None,
        "--once": options.once,
    }
    for name, is_given in given.items():
        if is_given:
            raise InputError(f"{name}: has no effect with --record")


def _motion(options: argparse.Namespace):
    """Title, robot, time [s] and joint angles [rad] of what was asked for."""
    from sdt_drake.design import load_plan
    from sdt_drake.robot import load_robot
    from sdt_drake.simulate import simulate
    from sdt_drake.tables import read_table

    given = Path(options.motion)
    if given.suffix == ".yaml":
        if options.robot is not None:
            raise InputError("--robot: the scenario names the robot")
        design = design_of(options.motion)
        recording = simulate(design)
        return design.scenario.name, design.robot, recording.time, recording.q
    robot = load_robot(options.robot or ROBOT)
    if given.suffix == ".csv":
        time, columns = read_table(given)
        q = columns.get("q", columns.get("q_ref"))
        if q is None:
            raise InputError(f"{given}: no columns q_1.. or q_ref_1.., the joint angles [rad]")
        if q.shape[1] != robot.n:
            raise InputError(
                f"{given}: angles of {q.shape[1]} joint(s), robot '{robot.name}' has {robot.n}"
            )
        return given.stem, robot, time, q
    if given.suffix:
        raise InputError(f"{given}: expected a .yaml or .csv file, or the name of a motion")
    motion = load_plan(options.motion, robot, period=PERIOD, margin=1.0).motion
    return options.motion, robot, motion.time, motion.q
