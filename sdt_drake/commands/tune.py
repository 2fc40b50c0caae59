"""Tell the effective inertia along a motion, and the gains that follow."""

from __future__ import annotations

import argparse
import re

from sdt_drake import paper
from sdt_drake.commands.common import (
    ROBOT,
    add_motion,
    add_omega_r,
    add_out,
    add_period,
    add_robot,
    add_show,
    check_out,
    deliver,
    print_table,
    say,
)
from sdt_drake.errors import InputError

EXAMPLE = "sdt-drake tune --omega-r 65.991 --zeta 0.95 0.98 0.99 0.95"


_PUBLISHED = "published for the shipped device"


def add(parser: argparse.ArgumentParser) -> None:
    add_motion(parser)
    add_robot(parser)
    add_period(parser)
    add_omega_r(parser, f"{paper.OMEGA_R}, published, for the shipped device; else none")
    parser.add_argument(
        "--zeta",
        type=float,
        nargs="+",
        help="damping ratio at the largest inertia, each joint [-] (default: published, for the "
        "shipped device; else 1)",
    )
    add_out(parser, "figure of the effective inertia along the motion (.png, .svg, .pdf)")
    add_show(parser)


def run(options: argparse.Namespace) -> None:
    from sdt_drake.analysis import plots
    from sdt_drake.control import damping_ratio, natural_frequency, oscillation_frequency
    from sdt_drake.design import make_design
    from sdt_drake.dynamics import effective_inertia
    from sdt_drake.resources import find_file
    from sdt_drake.scenario import ControllerChoice, Scenario

    check_out(options.out, show=options.show)
    shipped = find_file(options.robot).resolve() == find_file(ROBOT).resolve()
    omega_r, zeta = options.omega_r, options.zeta
    whose_omega_r, whose_zeta = "--omega-r", "--zeta"
    if omega_r is None:
        if not shipped:
            raise InputError(
                f"--omega-r: missing; {options.robot} needs the lowest natural frequency of its "
                f"own structure [rad/s], {paper.OMEGA_R} is that of the shipped device"
            )
        omega_r, whose_omega_r = paper.OMEGA_R, _PUBLISHED
    if zeta is None:
        zeta, whose_zeta = (paper.table1("zeta_max"), _PUBLISHED) if shipped else (None, "default")
    try:
        design = make_design(
            Scenario(
                robot=options.robot,
                motion=options.motion,
                period=options.period,
                controller=ControllerChoice(omega_r=omega_r, zeta=zeta),
            )
        )
    except InputError as error:
        raise InputError(*map(_as_option, error.args)) from None
    inertia, gains = design.inertia, design.gains
    at = (inertia.maximum, inertia.median, inertia.minimum)
    oscillation = oscillation_frequency(gains, inertia.maximum)
    slowest, fastest = (
        natural_frequency(gains, values) / omega_r for values in (inertia.maximum, inertia.minimum)
    )
    print_table(
        ("joint", "I_eff max", "median", "min [kg m²]", "var. [%]", "K_PS", "K_IS",
         "zeta at max", "median", "min", "omega_0", "omega_n/omega_r"),
        [
            (
                f"{k + 1} {design.robot.joint_names[k]}",
                *(f"{values[k]:.5g}" for values in at),
                f"{inertia.variation_percent[k]:.2f}",
                f"{gains.kp[k]:.4g}",
                f"{gains.ki[k]:.4g}",
                *(f"{damping_ratio(gains, values)[k]:.3f}" for values in at),
                f"{oscillation[k]:.2f}",
                f"{slowest[k]:.3f} to {fastest[k]:.3f}",
            )
            for k in range(design.robot.n)
        ],
    )  # fmt: skip
    say("motor side; K_PS [N m s/rad], K_IS [N m/rad]; omega_0 [rad/s] at the largest inertia")
    say(
        f"omega_r = {omega_r:g} rad/s ({whose_omega_r}), zeta at the largest inertia ({whose_zeta})"
    )
    too_fast = [str(k + 1) for k in range(design.robot.n) if fastest[k] > 0.5 * (1 + 1e-9)]
    if too_fast:
        say(
            f"note: omega_n exceeds 0.5 omega_r where the inertia is small, joint "
            f"{', '.join(too_fast)}"
        )
    deliver(
        options,
        lambda: plots.effective_inertia(
            f"{options.motion}: effective inertia, motor side",
            design.motion.time,
            effective_inertia(design.robot, design.torques.d_kk),
            design.robot.joint_names,
            paper.table1("i_eff_max") if shipped else None,
        ),
    )


def _as_option(line: str) -> str:
    """What a line about a scenario is here, where its fields are options."""
    line = re.sub(r"^scenario: (?:controller\.)?", "", line)
    return re.sub(r"^(zeta|omega_r|period)\b", r"--\1", line).replace("--omega_r", "--omega-r")
