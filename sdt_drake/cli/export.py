"""Write a motion as the files that drives and robot controllers read."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.io.errors import InputError
from sdt_drake.io.shown import numbered

if TYPE_CHECKING:
    from sdt_drake.machine.drive_files.export import Fed
    from sdt_drake.run.design import Design

EXAMPLE = "sdt-drake export graveyard_spin --drive drives --out exported"


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "motion",
        metavar="SCENARIO|MOTION",
        nargs="?",
        default=common.MOTION,
        help="a scenario, or a motion: name of one that ships, or file (default: %(default)s)",
    )
    parser.add_argument(
        "--drive",
        required=True,
        metavar="DRIVE.yaml",
        help="encoders, signs, rated torques, units, cycle of the drives; `drives` is an example",
    )
    common.add_out(parser, "folder for the files", default="exported")
    parser.add_argument(
        "--scenario",
        metavar="SCENARIO",
        help="of a motion: its robot, its planner, and the loop that is fed with what the files "
        "hold (default: training: the shipped device, position loops, torque feedforward)",
    )
    common.add_changes(parser)
    parser.add_argument(
        "--cam-points",
        type=common.number(int, minimum=2),
        default=1000,
        help="most points of the cam table (default: 1000)",
    )


def run(options: argparse.Namespace) -> None:
    from sdt_drake.machine.drive_files import FILES, cycles_in_a_period, load_drives
    from sdt_drake.run.design import make_design
    from sdt_drake.run.scenario import load_scenario

    common.check_folder(options.out, FILES)
    source, changes = options.motion, dict(options.changes)
    if not common.is_scenario(source):
        changes["motion"] = source
        source = options.scenario or "training"
    elif options.scenario is not None:
        raise InputError(f"--scenario: of a motion, {source} is a scenario itself")
    with common.naming_robot("--scenario"), common.naming_changes(options):
        design = make_design(load_scenario(source, changes))
    scenario, robot = design.scenario, design.nominal
    drives = load_drives(options.drive, robot.n)
    fed = sdt.export(
        design, options.drive, options.out, cam_points=options.cam_points, title=options.motion
    )
    period, cycle = design.motion.period, drives.cycle_time
    common.say(
        f"{options.motion}: {design.motion.duration:g} s for drives with a cycle of "
        f"{1e3 * cycle:g} ms, written into {options.out}"
    )
    if abs(period / cycle - round(period / cycle)) > 1e-6:
        common.say(
            f"note: the cycle is no whole part of the motion's period, {1e3 * period:g} ms: "
            "resampled, its speeds linear in between; the loop runs every "
            f"{1e3 * cycle * cycles_in_a_period(design, drives):g} ms, but from trajectory.yaml"
        )
    if not design.scenario.controller.takes_feedforward:
        common.say(
            f"note: {scenario.controller.label} has no place for a torque feedforward: its "
            "loop is fed without the torques of the files"
        )
    _print_read_back(design, fed, options.cam_points)


def _print_read_back(design: Design, fed: Sequence[Fed], cam_points: int) -> None:
    import numpy as np

    scenario, joints = design.scenario, numbered(design.nominal.joint_names)
    common.say(
        f"what the files hold, fed to {scenario.controller.label} on the {scenario.plant.kind} "
        "plant: largest error from the planned motion"
    )
    common.print_table(
        ("from", *(f"{joint} [deg]" for joint in joints)),
        [(x.source, *(f"{error:.2g}" for error in np.degrees(x.position_error))) for x in fed],
    )
    common.say(
        f"cam.csv: up to {cam_points} points, cubics between them are at most "
        f"{np.degrees(fed[-1].position_off.max()):.2g} deg from the motion; it has no torques"
    )
