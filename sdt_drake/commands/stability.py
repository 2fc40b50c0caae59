"""Sweep omega_n / omega_r: how stiff the structure has to be."""

from __future__ import annotations

import argparse
import re

from sdt_drake.commands.common import (
    add_command,
    add_omega_r,
    add_out,
    add_scenario,
    add_show,
    check_out,
    deliver,
    design_of,
    print_table,
    say,
)
from sdt_drake.errors import InputError, checked_number

SHOWN = (0.1, 0.25, 0.5, 0.75, 1.0, 1.5)


def add(commands) -> None:
    parser = add_command(
        commands,
        "stability",
        run,
        "sweep omega_n / omega_r with elastic joints: damping, overshoot, border of stability",
        "sdt-drake stability package://sdt/scenarios/coupled_pi.yaml --out stability.png",
    )
    add_scenario(parser)
    add_omega_r(parser)
    parser.add_argument(
        "--damping", type=float, default=0.01, help="damping ratio of the elastic joints [-]"
    )
    add_out(parser, "figure (.png, .svg, .pdf)")
    add_show(parser)


def run(options: argparse.Namespace) -> None:
    import numpy as np

    from sdt_drake.analysis import plots
    from sdt_drake.analysis.stability import SLOWEST, stability_sweep
    from sdt_drake.device import ENCODERS

    checked_number(options.omega_r, "--omega-r", minimum=SLOWEST)
    checked_number(options.damping, "--damping", minimum=0)
    check_out(options.out, show=options.show)
    design = design_of(options.scenario)
    names = design.robot.joint_names
    drives = {"ideal drive": None}
    if design.scenario.drive is not None:
        drives["the scenario's drive"] = design.scenario.drive
    try:
        sweeps = {
            encoder: {
                label: stability_sweep(
                    design,
                    options.omega_r,
                    encoder=encoder,
                    drive=drive,
                    damping_ratio=options.damping,
                )
                for label, drive in drives.items()
            }
            for encoder in ENCODERS
        }
    except InputError as error:
        # The fields of the springs are options here.
        text = re.sub(r"^scenario '.*?': ", "", str(error))
        text = text.replace("plant.elasticity.natural_frequency", "--omega-r")
        raise InputError(text.replace("plant.elasticity.damping_ratio", "--damping")) from None
    cases = [(e, d, sweep) for e, by_drive in sweeps.items() for d, sweep in by_drive.items()]
    for encoder, drive, sweep in cases:
        say(f"encoder on the {encoder}, {drive}: damping ratio, and overshoot of the link's speed,")
        say("over omega_n / omega_r")
        shown = [int(np.argmin(np.abs(sweep.ratio - ratio))) for ratio in SHOWN]
        print_table(
            ("joint", *(f"{sweep.ratio[i]:g}" for i in shown), "unstable from"),
            [
                (
                    f"{k + 1} {names[k]}",
                    *(
                        f"{sweep.damping[i, k]:.2f}, {sweep.overshoot_percent[i, k]:.0f} %"
                        if sweep.damping[i, k] > 0
                        else "unstable"
                        for i in shown
                    ),
                    "–" if np.isinf(sweep.border[k]) else f"{sweep.border[k]:.3f}",
                )
                for k in range(design.robot.n)
            ],
        )
        say()
    say("each axis alone, with its largest inertia; a sampled drive at its own period")
    title = f"{design.scenario.name}: elastic joints of {options.omega_r:g} rad/s"
    deliver(options, lambda: plots.stability(title, sweeps, names))
