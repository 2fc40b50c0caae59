"""Split the speed error of an axis scenario into its causes."""

from __future__ import annotations

import argparse

from sdt_drake.commands.common import (
    add_out,
    add_scenario,
    add_show,
    check_out,
    deliver,
    design_of,
    naming,
    print_table,
    say,
)

EXAMPLE = "sdt-drake budget package://sdt/scenarios/axis_pi_ctc.yaml --out budget.png"


def add(parser: argparse.ArgumentParser) -> None:
    add_scenario(parser)
    add_out(parser, "CSV file for the parts, or a figure of them (.png, .svg, .pdf)")
    add_show(parser)


def run(options: argparse.Namespace) -> None:
    import numpy as np

    from sdt_drake.analysis import plots
    from sdt_drake.analysis.budget import error_budget
    from sdt_drake.tables import write_table

    check_out(options.out, csv=True, show=options.show)
    design = design_of(options.scenario)
    with naming(options.scenario):
        budget = error_budget(design)
    signals = {"whole": budget.whole, **budget.parts, "remainder": budget.remainder}
    names = design.robot.joint_names
    say(f"{design.scenario.name}: RMS of the speed error and of its parts [rad/s]; in brackets the")
    say("largest. The parts add up to the whole at every instant; their sizes do not.")

    def size(values, k: int) -> str:
        return f"{np.sqrt(np.mean(values[:, k] ** 2)):.2g} ({np.abs(values[:, k]).max():.2g})"

    print_table(
        ("part", *(f"{k + 1} {name}" for k, name in enumerate(names))),
        [
            (label, *(size(values, k) for k in range(len(names))))
            for label, values in signals.items()
        ],
    )
    title = f"{design.scenario.name}: parts of the speed error"
    columns = {name.replace(" ", "_"): values for name, values in signals.items()}
    deliver(
        options,
        lambda: plots.error_budget(title, budget, names),
        lambda path: write_table(path, budget.time, columns),
    )
