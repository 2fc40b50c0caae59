"""The command `tune`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.cli.common import Given, OmegaR, OtherRobot, Out, Show, one_of
from sdt_drake.cli.printing import echo, print_joints
from sdt_drake.io.errors import InputError
from sdt_drake.io.results import RESULT_TABLES, Results
from sdt_drake.paper.published import OMEGA_R, table1

if TYPE_CHECKING:
    from sdt_drake.io.arrays import Array
    from sdt_drake.run.design import Design

_PUBLISHED = "published for the shipped device"
_TOLERANCE = 0.01
"""Share of 0.5 omega_r that omega_n may exceed without a note: omega_r is not known better."""


def run(
    what: Annotated[str, one_of("scenario", "motion", name="SCENARIO|MOTION")] = common.MOTION,
    /,
    *,
    robot: OtherRobot = None,
    period: float | None = None,
    omega_r: OmegaR = None,
    zeta: Annotated[list[float] | None, Parameter(consume_multiple=True)] = None,
    out: Out = None,
    show: Show = False,
    given: Given = Given(),
) -> None:
    """Compute the effective inertia along a motion, and tune the controller gains.

    example: sdt-drake tune coupled_pi --zeta 0.95 0.98 0.99 0.95

    Args:
        what: scenario, or motion (with --robot): shipped name or file
        period: interpolation period [s] (default: 0.005)
        omega_r: lowest natural frequency of the structure [rad/s] (default: that of the scenario;
            65.991, published, for the shipped device)
        zeta: damping ratio at the largest inertia, each joint [-] (default: that of the scenario;
            published, for the shipped device; else 1)
        out: file for the numbers (.csv, .json), or for a figure of the effective inertia (.png,
            .svg, .pdf)
    """
    common.check_out(out, show, RESULT_TABLES)
    is_scenario = common.is_scenario(what)
    own = {"omega_r": omega_r, "zeta": zeta}
    if is_scenario:
        for name, value in (("robot", robot), ("period", period)):
            common.refuse(f"has no effect on a scenario, use --set {name}=...", **{name: value})
        fields = ((f"controller.{name}", x) for name, x in own.items() if x is not None)
        design = common.design_of(what, (*given.changes, *fields))
    else:
        common.refuse_changes(given.changes, what)
        design = _of_motion(what, robot or common.ROBOT, period, own)
    tuning, numbers = design.tuning, design.tuning.numbers
    _print_gains(design, numbers)
    for line in _notes(design, is_scenario, own):
        echo(line)
    names = design.device.simulated.joint_names
    columns: dict[str, Any] = {"joint": range(1, len(names) + 1), "name": names, **numbers}
    about = {"title": what, "omega_r": tuning.omega_r}
    published = table1("i_eff_max") if _is_shipped(design.scenario.robot) else None
    title = f"{what}: effective inertia, motor side"
    along = tuning.motion.time, tuning.i_eff, names, published
    results = Results(about, columns)
    common.deliver(out, show, lambda: sdt.plots.effective_inertia(title, *along), results.write)


def _of_motion(motion: str, robot: str, period: float | None, given: Mapping[str, Any]) -> Design:
    from sdt_drake.motion import INTERPOLATION_PERIOD
    from sdt_drake.run.controllers import Pi
    from sdt_drake.run.scenario import Scenario

    omega_r, zeta = given.values()
    if omega_r is None and not _is_shipped(robot):
        raise InputError(
            "--omega-r: missing, expected the lowest natural frequency of the structure of "
            f"{robot} [rad/s]; {OMEGA_R} is that of the shipped device"
        )
    if omega_r is None:
        omega_r = OMEGA_R
    if zeta is None and _is_shipped(robot):
        zeta = table1("zeta_max")
    scenario = Scenario(
        robot=robot,
        motion=motion,
        period=period or INTERPOLATION_PERIOD,
        controller=Pi(omega_r=omega_r, zeta=zeta),
    )
    return sdt.design(scenario)


def _is_shipped(robot: str) -> bool:
    from sdt_drake.io.resources import find_file

    return find_file(robot, "robot").resolve() == find_file(common.ROBOT, "robot").resolve()


def _notes(design: Design, is_scenario: bool, given: Mapping[str, Any]) -> Iterator[str]:
    """Yield lines with the sources of the numbers, and joints that break the rule for omega_n."""
    import numpy as np

    from sdt_drake.systems.gains import natural_frequency

    omega_r = design.tuning.omega_r
    if omega_r is None:
        yield "K_PS and K_IS are kp and ki of the scenario."
        return
    elsewhere = "the scenario's" if is_scenario else _PUBLISHED
    omega_r_from = elsewhere if given["omega_r"] is None else "--omega-r"
    zeta_from = elsewhere if given["zeta"] is None else "--zeta"
    if design.scenario.controller.zeta is None:
        zeta_from = "default"
    yield f"omega_r = {omega_r:g} rad/s ({omega_r_from}), zeta at the largest inertia ({zeta_from})"
    fastest = natural_frequency(design.tuning.gains, design.tuning.inertia.minimum)
    too_fast = np.flatnonzero(fastest > 0.5 * omega_r * (1 + _TOLERANCE)) + 1
    if len(too_fast):
        joints = ", ".join(map(str, too_fast))
        yield (
            f"note: omega_n exceeds 0.5 omega_r by more than {100 * _TOLERANCE:g} % where the "
            f"inertia is small, joint {joints}"
        )


def _print_gains(design: Design, numbers: Mapping[str, Array]) -> None:
    omega_r = design.tuning.omega_r
    kp, ki = (", ".join(f"{x:.4g}" for x in numbers[name]) for name in ("kp", "ki"))
    echo(f"K_PS = {kp} N m s/rad, K_IS = {ki} N m/rad (motor side, joint by joint)")
    unit = " [rad/s]" if omega_r is None else "/omega_r"
    ends = zip(*(numbers[f"omega_n_{x}"] / (omega_r or 1.0) for x in ("max", "min")), strict=True)
    print_joints(
        design.device.simulated.joint_names,
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
    echo("motor side; K_PS [N m s/rad], K_IS [N m/rad]; omega_0 [rad/s] at the largest inertia")
