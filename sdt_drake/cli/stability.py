"""The command `stability`."""

from typing import TYPE_CHECKING, Annotated

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.cli.common import Flag, Given, OmegaR, Out, Scenario, Show, number
from sdt_drake.cli.printing import echo, print_joints
from sdt_drake.io.results import RESULT_TABLES

if TYPE_CHECKING:
    from sdt_drake.analysis.stability import StabilitySweep
    from sdt_drake.run.design import Design

SHOWN = (0.1, 0.25, 0.5, 0.75, 1.0, 1.5)


def run(
    scenario: Scenario,
    /,
    *,
    omega_r: OmegaR = None,
    damping: Annotated[float | None, number(gte=0)] = None,
    at_rest: Flag = False,
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
        at_rest: linearise the coupled plant at rest, for controllers that need it
        out: file for the sweeps (.csv, .json), or for a figure of them (.png, .svg, .pdf)
    """

    common.check_out(out, show, RESULT_TABLES)
    design = common.design_of(scenario, given.changes)
    found = sdt.stability(design, omega_r=omega_r, damping=damping, at_rest=at_rest)
    name, choice = design.scenario.name, design.scenario.controller
    for encoder in found.sweeps:
        echo(f"{name}, encoder on the {encoder}: {found.verdict(encoder)}")
    echo(f"{choice.label}: {choice.in_words(design)}")
    factor = design.device.nominal.frequency_factor
    times = "" if factor == 1 else f", {choice.omega_r:g}, times {factor:.4g} for the device"
    source = f"controller.omega_r{times}" if omega_r is None else "--omega-r"
    echo(
        f"elastic joints: omega_r = {found.omega_r:g} rad/s ({source}), "
        f"damping ratio {found.damping_ratio:g}"
    )
    echo()
    for encoder, by_drive in found.sweeps.items():
        for drive, sweep in by_drive.items():
            echo(f"encoder on the {encoder}, {drive}: damping ratio, and overshoot of the link's")
            echo("speed, over omega_n / omega_r")
            _print_sweep(sweep, design.device.simulated.joint_names)
            echo()
    for line in _notes(design, found.omega_r):
        echo(line)
    common.deliver(out, show, found.plot, found.results().write)


def _print_sweep(sweep: "StabilitySweep", joint_names: tuple[str, ...]) -> None:
    import numpy as np

    shown = [int(np.argmin(np.abs(sweep.ratio - ratio))) for ratio in SHOWN]

    def cells(i: int) -> list[str]:
        by_joint = zip(sweep.damping[i], sweep.overshoot_percent[i], strict=True)
        return [f"{zeta:.2f}, {over:.0f} %" if zeta > 0 else "unstable" for zeta, over in by_joint]

    columns = [(f"{sweep.ratio[i]:g}", "", cells(i)) for i in shown]
    first = np.where(np.isinf(sweep.unstable_from), np.nan, sweep.unstable_from)
    print_joints(joint_names, [*columns, ("unstable from", ".3f", first)])


def _notes(design: "Design", omega_r: float) -> list[str]:
    """Return notes on the sweep: inertia, sampling, and what of the scenario is left out."""
    from sdt_drake.analysis.stability import own_ratio, stands_alone
    from sdt_drake.run.options import option_names

    plant, choice = design.scenario.plant, design.scenario.controller
    inertia = "its largest inertia" if plant.i_eff is None else "the inertia of plant.i_eff"
    notes = [f"Each axis stands alone, with {inertia}."]
    if not stands_alone(design):
        notes = [
            f"{choice.kind} needs the coupled plant: one joint at a time is elastic, the others "
            "are rigid. The plant is linearised where the joint's inertia is largest."
        ]
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
