"""Tell the effective inertia along a motion, and the gains that follow."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

import sdt_drake as sdt
from sdt_drake.analysis import paper
from sdt_drake.cli import common
from sdt_drake.cli.common import say
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.tables import RESULT_TABLES, Results

if TYPE_CHECKING:
    from sdt_drake.run.design import Design

EXAMPLE = "sdt-drake tune coupled_pi --zeta 0.95 0.98 0.99 0.95"


_OPTIONS = {"omega_r": "--omega-r", "zeta": "--zeta"}  # of the controller
_PUBLISHED = "published for the shipped device"
_BEYOND = 0.01  # of 0.5 omega_r; nobody knows omega_r better


def add(parser: argparse.ArgumentParser) -> None:
    text = "a scenario, or a motion and its robot: name of one that ships, or file "
    text += "(default: %(default)s)"
    common.add_scenario(parser, text, "SCENARIO|MOTION", nargs="?", default=common.MOTION)
    common.add_robot(parser)
    common.add_period(parser)
    parser.set_defaults(robot=None, period=None)  # a scenario has its own
    common.add_omega_r(
        parser, f"that of the scenario; {paper.OMEGA_R}, published, for the shipped device"
    )
    parser.add_argument(
        "--zeta",
        type=float,
        nargs="+",
        help="damping ratio at the largest inertia, each joint [-] (default: that of the scenario; "
        "published, for the shipped device; else 1)",
    )
    text = "the numbers (.csv, .json), or a figure of the effective inertia (.png, .svg, .pdf)"
    common.add_figure(parser, text, RESULT_TABLES)


def run(options: argparse.Namespace) -> None:
    from sdt_drake.robot.dynamics import effective_inertia

    is_scenario = common.is_scenario(options.scenario)
    design = _of_scenario(options) if is_scenario else _of_motion(options)
    numbers = sdt.tune(design)
    _print_gains(design, numbers)
    for line in _notes(options, design, is_scenario):
        say(line)
    joints = range(1, design.robot.n + 1)
    columns: dict[str, Any] = {"joint": joints, "name": design.robot.joint_names, **numbers}
    about = {"title": options.scenario, "omega_r": design.omega_r}
    common.deliver(
        options,
        lambda: sdt.plots.effective_inertia(
            f"{options.scenario}: effective inertia, motor side",
            design.motion.time,
            effective_inertia(design.robot, design.torques.d_kk),
            design.robot.joint_names,
            paper.table1("i_eff_max") if _is_shipped(design.scenario.robot) else None,
        ),
        Results(about, columns).write,
    )


def _of_scenario(options: argparse.Namespace) -> Design:
    for name in ("robot", "period"):
        if getattr(options, name) is not None:
            raise InputError(f"--{name}: the scenario has it, expected --set {name}=...")
    given = [name for name in _OPTIONS if getattr(options, name) is not None]
    options.changes += [(f"controller.{name}", getattr(options, name)) for name in given]
    with common.naming_fields({f"--set controller.{name}": _OPTIONS[name] for name in given}):
        return common.design_of(options)


def _of_motion(options: argparse.Namespace) -> Design:
    from sdt_drake.motion import INTERPOLATION_PERIOD
    from sdt_drake.run.scenario import ControllerChoice, Scenario

    common.refuse_changes(options)
    robot = options.robot or common.ROBOT
    omega_r, zeta = options.omega_r, options.zeta
    if omega_r is None and not _is_shipped(robot):
        raise InputError(
            f"--omega-r: missing; {robot} needs the lowest natural frequency of its own "
            f"structure [rad/s], {paper.OMEGA_R} is that of the shipped device"
        )
    if omega_r is None:
        omega_r = paper.OMEGA_R
    if zeta is None and _is_shipped(robot):
        zeta = paper.table1("zeta_max")
    scenario = Scenario(
        robot=robot,
        motion=options.scenario,
        period=options.period or INTERPOLATION_PERIOD,
        controller=ControllerChoice(omega_r=omega_r, zeta=zeta),
    )
    names = {f"controller.{name}": option for name, option in _OPTIONS.items()}
    with (
        common.naming_robot("--robot"),
        common.naming_fields(names | _OPTIONS | {"period": "--period"}),
    ):
        return sdt.design(scenario)


def _is_shipped(robot: str) -> bool:
    from sdt_drake.io.resources import find_file

    return find_file(robot, "robot").resolve() == find_file(common.ROBOT, "robot").resolve()


def _notes(options: argparse.Namespace, design: Design, is_scenario: bool) -> Iterator[str]:
    """Where the numbers are from, and where the rule for omega_n does not hold."""
    from sdt_drake.systems.gains import natural_frequency

    omega_r = design.omega_r
    if omega_r is None:
        yield "K_PS, K_IS: the scenario's kp and ki"
        return
    elsewhere = "the scenario's" if is_scenario else _PUBLISHED
    omega_r_from = elsewhere if options.omega_r is None else "--omega-r"
    zeta_from = elsewhere if options.zeta is None else "--zeta"
    if design.scenario.controller.zeta is None:
        zeta_from = "default"
    yield f"omega_r = {omega_r:g} rad/s ({omega_r_from}), zeta at the largest inertia ({zeta_from})"
    fastest = natural_frequency(design.gains, design.inertia.minimum)
    too_fast = np.flatnonzero(fastest > 0.5 * omega_r * (1 + _BEYOND)) + 1
    if len(too_fast):
        joints = ", ".join(map(str, too_fast))
        yield (
            f"note: omega_n exceeds 0.5 omega_r by more than {100 * _BEYOND:g} % where the "
            f"inertia is small, joint {joints}"
        )


def _print_gains(design: Design, numbers: Mapping[str, Array]) -> None:
    omega_r = design.omega_r
    unit = " [rad/s]" if omega_r is None else "/omega_r"
    ends = zip(*(numbers[f"omega_n_{x}"] / (omega_r or 1.0) for x in ("max", "min")), strict=True)
    common.print_joints(
        design.robot.joint_names,
        [
            ("I_eff max", ".5g", numbers["i_eff_max"]),
            ("median", ".5g", numbers["i_eff_median"]),
            ("min [kg m²]", ".5g", numbers["i_eff_min"]),
            ("var. [%]", ".2f", numbers["variation_percent"]),
            ("K_PS", ".4g", numbers["kp"]),
            ("K_IS", ".4g", numbers["ki"]),
            ("zeta at max", ".3f", numbers["zeta_max"]),
            ("median", ".3f", numbers["zeta_median"]),
            ("min", ".3f", numbers["zeta_min"]),
            ("omega_0", ".2f", numbers["omega_0"]),
            (f"omega_n{unit}", "", [f"{a:.3f} to {b:.3f}" for a, b in ends]),
        ],
    )
    say("motor side; K_PS [N m s/rad], K_IS [N m/rad]; omega_0 [rad/s] at the largest inertia")
