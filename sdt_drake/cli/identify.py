"""Find the parameters of a robot in recordings, and write the robot that they say."""

from __future__ import annotations

import argparse
from pathlib import Path

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.cli.common import say

EXAMPLE = "sdt-drake identify sdt run.csv --out identified"


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("robot", metavar="ROBOT", help="SDF or URDF file to start from")
    parser.add_argument(
        "recordings", nargs="+", metavar="RECORDING",
        help="CSV file with time, q_k and tau_k for every joint k, or of `simulate`",
    )  # fmt: skip
    common.add_out(parser, "folder for what is found", "identified")
    common.add_recorded(parser)
    parser.add_argument(
        "--validate", nargs="+", default=[], metavar="FILE",
        help="recordings to judge by (default: the last third of each of the others)",
    )  # fmt: skip
    parser.add_argument(
        "--held-out", type=common.number(above=0, below=1), default=1 / 3, metavar="SHARE",
        help="of each recording, at its end, to judge by (default: 1/3)",
    )  # fmt: skip
    parser.add_argument(
        "--only", choices=("payload", "friction"), help="find this, and take all else from the file"
    )
    parser.add_argument("--payload", default="payload", metavar="LINK", help="what --only means")
    parser.add_argument(
        "--cutoff", type=common.number(minimum=0.1, maximum=1000, unit="Hz"), metavar="HZ",
        help="compare torques below it (default: twice where 99.9 %% of their power is)",
    )  # fmt: skip
    parser.add_argument(
        "--scenario", dest="base", metavar="NAME|FILE",
        help="whose motion, drives and controller the written scenario has (default: real_device "
        "for the shipped robot, else a PI controller on what was recorded)",
    )  # fmt: skip


def run(options: argparse.Namespace) -> None:
    from sdt_drake.machine.identify.files import base_scenario
    from sdt_drake.machine.identify.model import identified_robot, plant_friction
    from sdt_drake.show.reports import identification as analysis

    folder: Path = options.out
    common.check_folder(folder, analysis.FILES)
    robot = sdt.load_robot(options.robot)
    scenario = base_scenario(robot, options.base)
    found = sdt.identify(
        robot,
        options.recordings,
        validate=options.validate,
        columns=options.columns,
        side=options.side,
        only=options.only,
        payload=options.payload,
        cutoff=options.cutoff,
        held_out=options.held_out,
    )
    better, files = identified_robot(found), plant_friction(found)
    for line in analysis.in_short(found):
        say(line)
    for line in found.warnings:
        say(f"warning: {line}")
    say()
    common.print_document_table(analysis.errors_table(found, better))
    say()
    common.print_document_table(analysis.friction_table(found, files))
    for line in analysis.undecided_laws(found, files):
        say(f"note: {line}")
    say()
    say(f"{analysis.write_identified(found, better, files, folder, scenario)} written")
