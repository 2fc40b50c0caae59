"""Simulate the step response of one speed loop."""

from __future__ import annotations

import argparse
from dataclasses import asdict

import sdt_drake as sdt
from sdt_drake.analysis import paper
from sdt_drake.cli import common
from sdt_drake.cli.common import say
from sdt_drake.io.tables import RESULT_TABLES, UNITS, Results

EXAMPLE = "sdt-drake step --inertia 4.26 --structure p_in_feedback --zeta 0.95 --out step.png"


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--inertia",
        type=common.number(above=0),
        help="effective inertia, motor side [kg m²] (default: published, of joint 1)",
    )
    parser.add_argument("--structure", default="p_in_feedback", help="pi or p_in_feedback")
    common.add_omega_r(parser, f"{paper.OMEGA_R}, published")
    parser.add_argument("--zeta", type=float, default=1.0, help="damping ratio [-] (default: 1)")
    text = "the response (.csv, .json), or a figure of it (.png, .svg, .pdf)"
    common.add_figure(parser, text, RESULT_TABLES)


def run(options: argparse.Namespace) -> None:
    from sdt_drake.analysis.reproduction import step_response
    from sdt_drake.io.errors import checked_choice
    from sdt_drake.systems.gains import STRUCTURES, tune

    inertia, omega_r = options.inertia, options.omega_r
    taken = [name for name, value in (("inertia", inertia), ("omega_r", omega_r)) if value is None]
    if inertia is None:
        inertia = paper.table1("i_eff_max")[0]
    if omega_r is None:
        omega_r = paper.OMEGA_R
    checked_choice(options.structure, STRUCTURES, "--structure")
    step = step_response(options.structure, options.zeta, inertia, omega_r)
    published = f" ({' and '.join(taken)} published for the shipped device)" if taken else ""
    say(
        f"{step.structure}: inertia {inertia:g} kg m², omega_r = {omega_r:g} rad/s, "
        f"zeta {options.zeta:g}{published}"
    )
    gains = tune([inertia], omega_r, [options.zeta])
    kp, ki = gains.kp[0], gains.ki[0]
    say(f"K_PS = {kp:.5g} N m s/rad, K_IS = {ki:.5g} N m/rad, motor side")
    metrics = asdict(step.metrics)
    for name, value in metrics.items():
        label = name.removesuffix("_percent").replace("_", " ")
        say(f"{label:20s} {value:.5g} {UNITS[name]}")
    about = {"inertia": inertia, "omega_r": omega_r, "zeta": step.zeta, "kp": kp, "ki": ki}
    response = {"time": step.time, "v": step.speed}
    common.deliver(
        options,
        lambda: sdt.plots.step_responses("Step response", {step.structure: step}),
        Results({"structure": step.structure, **about, **metrics}, response).write,
    )
