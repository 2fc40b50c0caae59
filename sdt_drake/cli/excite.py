"""Find a motion from which a robot can be identified best, and say how well, before it moves."""

from __future__ import annotations

import argparse
from pathlib import Path

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.cli.common import say
from sdt_drake.io.errors import whole_periods

EXAMPLE = "sdt-drake excite sdt --duration 30 --out excite.yaml"


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "robot", metavar="ROBOT", nargs="?", default=common.ROBOT, help="SDF or URDF file"
    )
    parser.add_argument(
        "--duration", type=common.number(minimum=1), default=30.0, help="of the motion [s]"
    )
    parser.add_argument(
        "--payload",
        nargs="?",
        const="payload",
        metavar="LINK",
        help="excite for a payload alone, gently, all else being known (default: link 'payload')",
    )
    parser.add_argument(
        "--margin",
        type=common.number(above=0, maximum=1),
        help="share of the limits of position, speed, acceleration and torque that may be taken "
        "(default: 0.8)",
    )
    parser.add_argument(
        "--noise",
        type=common.number(above=0, maximum=1),
        help="standard deviation of the torques, over the largest torque of each joint "
        "(default: 0.01)",
    )
    common.add_out(parser, "motion file (.yaml)")


def run(options: argparse.Namespace) -> None:
    from sdt_drake.analysis.metrics import PARAMETERS_IN_WORDS
    from sdt_drake.io.shown import formatted
    from sdt_drake.machine.identify.excitation import GENTLY, MARGIN, RATE, excite
    from sdt_drake.machine.identify.targets import NOISE, Target
    from sdt_drake.motion import INTERPOLATION_PERIOD

    whole_periods(options.duration, INTERPOLATION_PERIOD, "--duration")
    out: Path | None = options.out
    if out is not None:
        common.check_file(out, (".yaml", ".yml"))
    margin, noise = options.margin or MARGIN, options.noise or NOISE
    robot = sdt.load_robot(options.robot)
    gently = 1.0
    target = Target.everything(robot, noise)
    if options.payload is not None:
        target, gently = Target.payload(robot, options.payload, noise), GENTLY
    found = excite(target, options.duration, margin=margin, gently=gently)
    say(
        f"{robot.name}: {options.duration:g} s in harmonics of {found.base_frequency:g} Hz, "
        f"condition number {found.condition:.3g}"
    )
    columns = [(f"{name} [%]", ".1f", 100 * use) for name, use in found.used.items()]
    common.print_joints(robot.joint_names, columns)
    say("of the limits; what the arm may hit, and people in it, are not known here")
    say()
    say(f"{'deviation':>12}{'in the file':>14}  identifiable")
    for name, value, sigma in zip(target.names, target.expected, found.sigma, strict=True):
        known = formatted(0.0 if abs(value) < 1e-9 else value, ".5g")
        say(f"{sigma:12.3g}{known:>14}  {name}")
    say(
        f"standard deviations to be expected of a recording at {RATE:g} Hz with a noise of "
        f"{100 * noise:g} % of each joint's largest torque"
    )
    common.say(PARAMETERS_IN_WORDS)
    if out is not None:
        found.save(out)
        say(f"{out} written")
