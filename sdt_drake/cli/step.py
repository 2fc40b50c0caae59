"""The command `step`."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Literal

import sdt_drake as sdt
from sdt_drake.analysis import paper
from sdt_drake.cli import common
from sdt_drake.cli.common import OmegaR, Out, Show, number
from sdt_drake.cli.printing import echo
from sdt_drake.io.results import RESULT_TABLES, UNITS, Results


def run(
    *,
    inertia: Annotated[float | None, number(gt=0)] = None,
    structure: Literal["pi", "p_in_feedback"] = "p_in_feedback",
    omega_r: OmegaR = None,
    zeta: float = 1.0,
    out: Out = None,
    show: Show = False,
) -> None:
    """Simulate the step response of one speed loop.

    example: sdt-drake step --inertia 4.26 --structure p_in_feedback --zeta 0.95 --out step.png

    Args:
        inertia: effective inertia, motor side [kg m²] (default: published value of joint 1)
        structure: structure of the controller: P and I on the error, or P in the feedback
        omega_r: lowest natural frequency of the structure [rad/s] (default: 65.991, published)
        zeta: damping ratio [-]
        out: file for the response (.csv, .json), or for a figure of it (.png, .svg, .pdf)
    """
    from sdt_drake.analysis.reproduction import step_response
    from sdt_drake.systems.gains import tune

    common.check_out(out, show, RESULT_TABLES)
    taken = [name for name, value in (("inertia", inertia), ("omega_r", omega_r)) if value is None]
    if inertia is None:
        inertia = paper.table1("i_eff_max")[0]
    if omega_r is None:
        omega_r = paper.OMEGA_R
    step = step_response(structure, zeta, inertia, omega_r)
    published = f" ({' and '.join(taken)} published for the shipped device)" if taken else ""
    gains, metrics = tune([inertia], omega_r, [zeta]), asdict(step.metrics)
    kp, ki = gains.kp[0], gains.ki[0]
    echo(
        f"{step.structure}: the speed settles in {step.metrics.settling_time:.4g} s and overshoots "
        f"by {step.metrics.overshoot_percent:.2g} %"
    )
    echo(
        f"inertia {inertia:g} kg m², omega_r = {omega_r:g} rad/s, zeta {zeta:g}{published}: "
        f"K_PS = {kp:.5g} N m s/rad, K_IS = {ki:.5g} N m/rad, motor side"
    )
    for name, value in metrics.items():
        label = name.removesuffix("_percent").replace("_", " ")
        echo(f"{label:20s} {value:.5g} {UNITS[name]}")
    about = {"inertia": inertia, "omega_r": omega_r, "zeta": step.zeta, "kp": kp, "ki": ki}
    response = {"time": step.time, "v": step.speed}
    common.deliver(
        out,
        show,
        lambda: sdt.plots.step_responses("Step response", {step.structure: step}),
        Results({"structure": step.structure, **about, **metrics}, response).write,
    )
