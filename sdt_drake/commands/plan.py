"""Plan a motion within the motors' torques."""

from __future__ import annotations

import argparse

from sdt_drake.commands.common import (
    add_command,
    add_motion,
    add_out,
    add_period,
    add_robot,
    print_table,
    say,
)
from sdt_drake.errors import InputError


def add(commands) -> None:
    parser = add_command(
        commands,
        "plan",
        run,
        "plan a motion within the motors' torques",
        "sdt-drake plan package://sdt/motions/reference.yaml --out motion.csv",
    )
    add_motion(parser)
    add_robot(parser)
    add_period(parser)
    parser.add_argument(
        "--margin", type=float, default=1.0, help="share of the motors' torque to use, in (0, 1]"
    )
    add_out(parser, "CSV file for the motion")


def run(options: argparse.Namespace) -> None:
    import numpy as np

    from sdt_drake.design import load_plan
    from sdt_drake.robot import load_robot

    if options.out and options.out.suffix != ".csv":
        raise InputError(f"{options.out}: expected a .csv file")
    if not 0 < options.margin <= 1:
        raise InputError(f"--margin: {options.margin:g}, expected a share in (0, 1]")
    robot = load_robot(options.robot)
    plan = load_plan(options.motion, robot, period=options.period, margin=options.margin)
    motion = plan.motion
    say(f"{options.motion}: {motion.duration:g} s, {len(motion.time)} samples, feasible")
    peak, use = np.abs(plan.torque).max(axis=0), plan.peak_use(robot)
    print_table(
        ("joint", "peak torque [N m]", "of the motor [%]", "limited [s]", "speed [rad/s]",
         "from [deg]", "to [deg]"),
        [
            (
                f"{k + 1} {robot.joint_names[k]}", f"{peak[k]:.1f}",
                f"{100 * use[k]:.1f}",
                f"{plan.limited[:, k].sum() * motion.period:.3f}",
                f"{np.abs(motion.v[:, k]).max():.3f}",
                f"{np.degrees(motion.q[:, k].min()):.1f}",
                f"{np.degrees(motion.q[:, k].max()):.1f}",
            )
            for k in range(robot.n)
        ],
    )  # fmt: skip
    say("torques are joint side, with the motors' inertia")
    if options.out:
        motion.to_csv(options.out)
        say(f"{options.out} written")
