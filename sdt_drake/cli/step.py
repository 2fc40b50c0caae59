"""The command `step`."""

import math
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.cli.common import Changes, Given, Integer, OmegaR, Out, Show, number, one_of
from sdt_drake.cli.printing import echo, print_table
from sdt_drake.io.results import RESULT_TABLES, UNITS, Results
from sdt_drake.io.shown import formatted
from sdt_drake.paper.published import OMEGA_R, table1


def run(
    scenario: Annotated[
        str | None, one_of("scenario", help="scenario of the loop (default: that of Figure 4)")
    ] = None,
    /,
    *,
    input: Literal["reference", "extra_load_torque", "tau_cmd"] | None = None,
    joint: Integer | None = None,
    size: Annotated[float | None, number()] = None,
    at: Annotated[float | None, number(gte=0)] = None,
    duration: Annotated[float | None, number(gt=0)] = None,
    inertia: Annotated[float | None, number(gt=0)] = None,
    setpoint_weight: Annotated[float | None, number(gte=0, lte=1)] = None,
    omega_r: OmegaR = None,
    zeta: float | None = None,
    out: Out = None,
    show: Show = False,
    given: Given = Given(),
) -> None:
    """Simulate the response to a step: at an input of a scenario's loop, or of one speed loop.

    example: sdt-drake step coupled_pi --input extra_load_torque --joint 2 --at 4 --out step.png

    Args:
        input: speed reference, load of the motor, or torque command (default: reference)
        joint: number of the joint whose input steps (default: 1)
        size: size of the step, joint side [rad/s] or motor side [N m] (default: a tenth of the
            motor's torque, or the speed error for which K_PS commands it)
        at: time of the step [s] (default: 0)
        duration: time after the step [s] (default: 50 / omega_n of the slowest loop)
        inertia: without a scenario, effective inertia, motor side [kg m²] (default: published
            value of joint 1)
        setpoint_weight: without a scenario, weight of the reference in the proportional part: 1 is
            PI on the error, 0 is I-P with P in the feedback (default: 0)
        omega_r: without a scenario, lowest natural frequency of the structure [rad/s] (default:
            65.991, published)
        zeta: without a scenario, damping ratio [-] (default: 1)
        out: file for the response (.csv, .json), or for a figure of it (.png, .svg, .pdf)
    """
    common.check_out(out, show, RESULT_TABLES)
    of_loop = {"input": input, "joint": joint, "size": size, "at": at, "duration": duration}
    of_axis = {"inertia": inertia, "omega_r": omega_r, "zeta": zeta}
    of_axis["setpoint_weight"] = setpoint_weight
    if scenario is None:
        common.refuse("needs a SCENARIO, whose loop steps", **of_loop, changes=given.changes)
        _axis(**_given(of_axis), out=out, show=show)
    else:
        common.refuse("is that of the single speed loop, which has no SCENARIO", **of_axis)
        _loop(scenario, given.changes, _given(of_loop), out, show)


def _given(options: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in options.items() if value is not None}


def _loop(
    scenario: str, changes: Changes, options: dict[str, Any], out: Path | None, show: bool
) -> None:
    """Step an input of a scenario's loop."""
    design = common.design_of(scenario, changes)
    step = sdt.step(design, **options)
    m = step.metrics["v"][step.joint - 1]
    settles = "does not settle"
    if math.isfinite(m.settling_time):
        settles = f"settles in {m.settling_time:.4g} s"
    size = f"deviates by {abs(m.peak):.4g} rad/s"
    if step.input == "reference":
        size = f"overshoots by {m.overshoot_percent:.2g} %"
    echo(f"{step.title.removeprefix('of ')}: the speed {settles} and {size}")
    print_table(*step.summary()[1:])
    echo("Responses are those with the step, less those without.")
    common.deliver(out, show, step.plot, step.results().write)


def _axis(
    *,
    inertia: float | None = None,
    setpoint_weight: float = 0.0,
    omega_r: float | None = None,
    zeta: float = 1.0,
    out: Path | None,
    show: bool,
) -> None:
    """Step the reference of one speed loop (Figure 4)."""
    from sdt_drake.paper.reproduction import step_response
    from sdt_drake.systems.gains import tune

    taken = [name for name, value in (("inertia", inertia), ("omega_r", omega_r)) if value is None]
    if inertia is None:
        inertia = table1("i_eff_max")[0]
    if omega_r is None:
        omega_r = OMEGA_R
    step = step_response(setpoint_weight, zeta, inertia, omega_r)
    published = f" ({' and '.join(taken)} published for the shipped device)" if taken else ""
    gains, metrics = tune([inertia], omega_r, [zeta]), asdict(step.metrics)
    kp, ki = gains.kp[0], gains.ki[0]
    settling, overshoot = step.metrics.settling_time, step.metrics.overshoot_percent
    echo(
        f"set-point weight {setpoint_weight:g}: the speed settles in {settling:.4g} s and "
        f"overshoots by {overshoot:.2g} %"
    )
    echo(
        f"inertia {inertia:g} kg m², omega_r = {omega_r:g} rad/s, zeta {zeta:g}{published}: "
        f"K_PS = {kp:.5g} N m s/rad, K_IS = {ki:.5g} N m/rad, motor side"
    )
    for name, value in metrics.items():
        label = name.removesuffix("_percent").replace("_", " ")
        echo(f"{label:20s} {formatted(value, '.5g')} {UNITS[name]}")
    about = {"inertia": inertia, "omega_r": omega_r, "zeta": step.zeta, "kp": kp, "ki": ki}
    about = {"setpoint_weight": setpoint_weight, **about, **metrics}
    results = Results(about, {"time": step.time, "v": step.speed})
    title, steps = "Step response", {"step": step}
    common.deliver(out, show, lambda: sdt.plots.step_responses(title, steps), results.write)
