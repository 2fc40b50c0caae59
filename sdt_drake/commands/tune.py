"""Tell the effective inertia along a motion, and the gains that follow."""

from __future__ import annotations

import argparse
import re
from typing import TYPE_CHECKING

from sdt_drake import paper
from sdt_drake.commands import common
from sdt_drake.errors import InputError

if TYPE_CHECKING:
    from sdt_drake.design import Design

EXAMPLE = "sdt-drake tune --omega-r 65.991 --zeta 0.95 0.98 0.99 0.95"


_PUBLISHED = "published for the shipped device"


def add(parser: argparse.ArgumentParser) -> None:
    common.add_motion(parser)
    common.add_robot(parser)
    common.add_period(parser)
    common.add_omega_r(parser, f"{paper.OMEGA_R}, published, for the shipped device; else none")
    parser.add_argument(
        "--zeta",
        type=float,
        nargs="+",
        help="damping ratio at the largest inertia, each joint [-] (default: published, for the "
        "shipped device; else 1)",
    )
    common.add_figure(parser, "figure of the effective inertia along the motion (.png, .svg, .pdf)")


def run(options: argparse.Namespace) -> None:
    import numpy as np

    from sdt_drake.analysis import plots
    from sdt_drake.control import natural_frequency
    from sdt_drake.dynamics import effective_inertia
    from sdt_drake.resources import find_file

    common.check_out(options.out, show=options.show)
    shipped = find_file(options.robot).resolve() == find_file(common.ROBOT).resolve()
    omega_r, zeta = options.omega_r, options.zeta
    if omega_r is None and not shipped:
        raise InputError(
            f"--omega-r: missing; {options.robot} needs the lowest natural frequency of its own "
            f"structure [rad/s], {paper.OMEGA_R} is that of the shipped device"
        )
    whose_omega_r = "--omega-r" if omega_r is not None else _PUBLISHED
    whose_zeta = "--zeta" if zeta is not None else _PUBLISHED if shipped else "default"
    if omega_r is None:
        omega_r = paper.OMEGA_R
    if zeta is None and shipped:
        zeta = paper.table1("zeta_max")
    design = _design(options, omega_r, zeta)
    _print_gains(design, omega_r)
    common.say(
        f"omega_r = {omega_r:g} rad/s ({whose_omega_r}), zeta at the largest inertia ({whose_zeta})"
    )
    fastest = natural_frequency(design.gains, design.inertia.minimum)
    too_fast = np.flatnonzero(fastest > 0.5 * omega_r * (1 + 1e-9)) + 1
    if len(too_fast):
        joints = ", ".join(map(str, too_fast))
        common.say(f"note: omega_n exceeds 0.5 omega_r where the inertia is small, joint {joints}")
    common.deliver(
        options,
        lambda: plots.effective_inertia(
            f"{options.motion}: effective inertia, motor side",
            design.motion.time,
            effective_inertia(design.robot, design.torques.d_kk),
            design.robot.joint_names,
            paper.table1("i_eff_max") if shipped else None,
        ),
    )


def _design(options: argparse.Namespace, omega_r: float, zeta: list[float] | None) -> Design:
    from sdt_drake.design import make_design
    from sdt_drake.scenario import ControllerChoice, Scenario

    scenario = Scenario(
        robot=options.robot,
        motion=options.motion,
        period=options.period,
        controller=ControllerChoice(omega_r=omega_r, zeta=zeta),
    )
    try:
        return make_design(scenario)
    except InputError as error:
        raise InputError(*map(_as_option, error.args)) from None


def _as_option(line: str) -> str:
    """What a line about a scenario is here, where its fields are options."""
    line = re.sub(r"^scenario: (?:controller\.)?", "", line)
    return re.sub(r"^(zeta|omega_r|period)\b", r"--\1", line).replace("--omega_r", "--omega-r")


def _print_gains(design: Design, omega_r: float) -> None:
    import numpy as np

    from sdt_drake.control import damping_ratio, natural_frequency, oscillation_frequency

    inertia, gains = design.inertia, design.gains
    largest, median, smallest = inertia.maximum, inertia.median, inertia.minimum
    omega_n = np.array([natural_frequency(gains, i_eff) for i_eff in (largest, smallest)])
    ratios = [f"{slow:.3f} to {fast:.3f}" for slow, fast in omega_n.T / omega_r]
    common.print_joints(
        design.robot.joint_names,
        [
            ("I_eff max", ".5g", largest),
            ("median", ".5g", median),
            ("min [kg m²]", ".5g", smallest),
            ("var. [%]", ".2f", inertia.variation_percent),
            ("K_PS", ".4g", gains.kp),
            ("K_IS", ".4g", gains.ki),
            ("zeta at max", ".3f", damping_ratio(gains, largest)),
            ("median", ".3f", damping_ratio(gains, median)),
            ("min", ".3f", damping_ratio(gains, smallest)),
            ("omega_0", ".2f", oscillation_frequency(gains, largest)),
            ("omega_n/omega_r", "", ratios),
        ],
    )
    common.say(
        "motor side; K_PS [N m s/rad], K_IS [N m/rad]; omega_0 [rad/s] at the largest inertia"
    )
