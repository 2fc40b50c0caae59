"""Tell the frequency response of each joint's loop: bandwidth, margins, peak."""

from __future__ import annotations

import argparse

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.cli.common import say
from sdt_drake.io.tables import RESULT_TABLES

EXAMPLE = "sdt-drake bode coupled_pi --out bode.png"


def add(parser: argparse.ArgumentParser) -> None:
    common.add_scenario(parser)
    parser.add_argument(
        "--time",
        type=common.number(minimum=0),
        help="linearise where the motion is at that time [s] (default: for each joint where its "
        "inertia is largest for the first time)",
    )
    text = "the responses (.csv, .json), or a figure of them (.png, .svg, .pdf)"
    common.add_figure(parser, text, RESULT_TABLES)


def run(options: argparse.Namespace) -> None:
    from sdt_drake.analysis.frequency_response import left_out

    design = common.design_of(options)
    with common.naming_fields({"time": "--time"}):
        response = sdt.bode(design, time=options.time)
    scenario = design.scenario
    title = f"{scenario.name}: {scenario.controller.label}"
    say(f"{title} on the {scenario.plant.kind} plant")
    common.print_joints(design.robot.joint_names, response.columns())
    cut = f"the loop cut at {response.cut}"
    if response.at_positions:
        cut += f", sampled every {design.motion.period:g} s"
    say(f"speed of the link over its reference, without feedforward; {cut}")
    times = design.motion.time[response.sample]
    if options.time is None:
        joints = ", ".join(f"{t:.3f}" for t in times)
        say(f"linear at rest on the motion, where each joint's inertia is largest, at {joints} s")
    else:
        say(f"linear at rest where the motion is at {times[0]:.3f} s")
    for clause in left_out(design, response):
        say(f"note: {clause}")
    common.deliver(
        options,
        lambda: sdt.plots.bode(title, response, design.robot.joint_names),
        response.results(title).write,
    )
