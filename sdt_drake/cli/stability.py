"""The command `stability`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING, Annotated, Any

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.cli.common import Given, OmegaR, Out, Scenario, Show, number
from sdt_drake.cli.printing import echo, print_joints
from sdt_drake.io.arguments import finite_number
from sdt_drake.io.errors import InputError
from sdt_drake.io.progress import with_progress
from sdt_drake.io.results import RESULT_TABLES, Results

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from sdt_drake.analysis.stability import StabilitySweep
    from sdt_drake.io.arrays import Array
    from sdt_drake.run.design import Design

SHOWN = (0.1, 0.25, 0.5, 0.75, 1.0, 1.5)


def run(
    scenario: Scenario,
    /,
    *,
    omega_r: OmegaR = None,
    damping: Annotated[float | None, number(gte=0)] = None,
    out: Out = None,
    show: Show = False,
    given: Given = Given(),
) -> None:
    """Find the largest stable gains with elastic joints: sweep omega_n / omega_r.

    example: sdt-drake stability coupled_pi --out stability.png

    Args:
        omega_r: lowest natural frequency of the structure [rad/s] (default: that of the scenario)
        damping: damping ratio of the elastic joints [-] (default: that of the scenario's
            plant.elasticity, or 0.01)
        out: file for the sweeps (.csv, .json), or for a figure of them (.png, .svg, .pdf)
    """
    from sdt_drake.analysis.stability import IDEAL, MIN_OMEGA_R, own_ratio, stability_sweep
    from sdt_drake.robot.device import ENCODERS
    from sdt_drake.run.controllers import feedback_of

    common.check_out(out, show, RESULT_TABLES)
    if omega_r is not None:
        finite_number(omega_r, "--omega-r", minimum=MIN_OMEGA_R)
    design = common.design_of(scenario, given.changes)
    chosen, choice = design.scenario, design.scenario.controller
    frequency, source = _omega_r(design, scenario, omega_r)
    if damping is None:
        damping = chosen.plant.elasticity.damping_ratio
    drives = {"ideal drive": IDEAL}
    if chosen.drive != IDEAL:
        drives["the scenario's drive"] = chosen.drive
    sweeps: dict[str, dict[str, StabilitySweep]] = {encoder: {} for encoder in ENCODERS}
    for encoder, label in with_progress([*product(ENCODERS, drives)]):
        sweeps[encoder][label] = stability_sweep(
            design, frequency, encoder=encoder, drive=drives[label], damping_ratio=damping
        )
    own, names = own_ratio(design, frequency), design.device.simulated.joint_names
    for place, by_drive in sweeps.items():
        limit = by_drive[label].unstable_from  # of the last drive, the scenario's
        echo(f"{chosen.name}, encoder on the {place}: {_verdict(own, limit, names)}")
    echo(f"{choice.label}: {feedback_of(design).in_words(design)}")
    echo(f"elastic joints: omega_r = {frequency:g} rad/s ({source}), damping ratio {damping:g}")
    echo()
    for place, by_drive in sweeps.items():
        for drive, sweep in by_drive.items():
            echo(f"encoder on the {place}, {drive}: damping ratio, and overshoot of the link's")
            echo("speed, over omega_n / omega_r")
            _print_sweep(sweep, design.device.simulated.joint_names)
            echo()
    for line in _notes(design, frequency):
        echo(line)
    title = f"{chosen.name}: {choice.label}, elastic joints of {frequency:g} rad/s"
    about = {"title": title, "omega_r": frequency, "damping_ratio": damping}
    common.deliver(
        out,
        show,
        lambda: sdt.plots.stability(title, sweeps, design.device.simulated.joint_names),
        Results(about, _columns(sweeps)).write,
    )


def _verdict(own: Array, limit: Array, names: Sequence[str]) -> str:
    """Return whether the scenario's own gains are stable, and the ratios that show it."""
    beyond = own >= limit
    descriptions = (
        f"joint {k + 1} '{name}' (omega_n / omega_r = {own[k]:.3f}, unstable from {limit[k]:.3f})"
        for k, name in enumerate(names)
        if beyond[k]
    )
    if beyond.any():
        return f"the scenario's own gains are unstable for {', '.join(descriptions)}"
    k = int((limit / own).argmin())
    least = "" if limit[k] == float("inf") else f", unstable from {limit[k]:.3f} (joint {k + 1})"
    return f"the scenario's own gains are stable at omega_n / omega_r = {own[k]:.3f}{least}"


def _columns(sweeps: Mapping[str, Mapping[str, StabilitySweep]]) -> dict[str, NDArray[Any]]:
    """Return the columns of --out, with a row for each encoder, drive and ratio."""
    import numpy as np

    every = [(encoder, drive, s) for encoder, by in sweeps.items() for drive, s in by.items()]
    encoders, drives, of_each = zip(*every, strict=True)
    counts = [len(sweep.ratio) for sweep in of_each]
    columns = {"encoder": np.repeat(encoders, counts), "drive": np.repeat(drives, counts)}
    for name in ("ratio", "damping", "overshoot_percent"):
        columns[name] = np.concatenate([getattr(sweep, name) for sweep in of_each])
    return columns | {
        "unstable_from": np.repeat([s.unstable_from for s in of_each], counts, axis=0)
    }


def _omega_r(design: Design, path: str, given: float | None) -> tuple[float, str]:
    """Return the lowest natural frequency of the structure [rad/s] and its source."""
    if given is not None:
        return given, "--omega-r"
    if design.tuning.omega_r is None:
        raise InputError(
            f"--omega-r: missing, expected the lowest natural frequency of the structure [rad/s], "
            f"since {path} has kp and ki but no controller.omega_r"
        )
    own, factor = design.scenario.controller.omega_r, design.device.nominal.frequency_factor
    times = "" if factor == 1 else f", {own:g}, times {factor:.4g} for the device"
    return design.tuning.omega_r, f"controller.omega_r{times}"


def _print_sweep(sweep: StabilitySweep, joint_names: tuple[str, ...]) -> None:
    import numpy as np

    shown = [int(np.argmin(np.abs(sweep.ratio - ratio))) for ratio in SHOWN]
    columns = [
        (
            f"{sweep.ratio[i]:g}",
            "",
            [
                f"{damping:.2f}, {overshoot:.0f} %" if damping > 0 else "unstable"
                for damping, overshoot in zip(
                    sweep.damping[i], sweep.overshoot_percent[i], strict=True
                )
            ],
        )
        for i in shown
    ]
    first = np.where(np.isinf(sweep.unstable_from), np.nan, sweep.unstable_from)
    print_joints(joint_names, [*columns, ("unstable from", ".3f", first)])


def _notes(design: Design, omega_r: float) -> list[str]:
    """Return notes on the sweep: inertia, sampling, and what of the scenario is left out."""
    from sdt_drake.analysis.stability import own_ratio, stands_alone
    from sdt_drake.run.options import option_names

    plant, choice = design.scenario.plant, design.scenario.controller
    if not stands_alone(design):
        notes = [
            f"{choice.kind} needs the coupled plant: one joint at a time is elastic, the others "
            "are rigid. The plant is linearised where the joint's inertia is largest."
        ]
    elif plant.i_eff is None:
        notes = ["Each axis stands alone, with its largest inertia."]
    else:
        notes = ["Each axis stands alone, with the inertia of plant.i_eff."]
    own = " ".join(f"{ratio:.3f}" for ratio in own_ratio(design, omega_r))
    notes.append(f"omega_n / omega_r of the scenario's own gains: {own}")
    if design.drive.period is not None and stands_alone(design):
        notes.append("The scenario's drive samples with its own period.")
    if "position_gain" in option_names(type(choice)):
        notes.append(f"Positions are sampled every {design.reference.tracked.period:g} s.")
    if choice.feedforward_in_use != "none":
        notes.append("note: the feedforward is left out; it does not affect damping or stability")
    if not plant.friction.is_none:
        notes.append("note: only the viscous part of friction is included")
    if not plant.elasticity.is_rigid:
        notes.append(
            "note: each joint in turn is elastic with omega_r, in place of plant.elasticity, whose "
            f"encoder is on the {plant.elasticity.encoder}"
        )
    return notes
