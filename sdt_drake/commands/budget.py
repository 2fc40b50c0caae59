"""Split the speed error of an axis scenario into its causes."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from sdt_drake.commands import common

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

EXAMPLE = "sdt-drake budget axis_pi_ctc --out budget.png"


def add(parser: argparse.ArgumentParser) -> None:
    common.add_scenario(parser)
    common.add_figure(parser, "the parts (.csv, .json), or a figure of them (.png, .svg, .pdf)")


def run(options: argparse.Namespace) -> None:
    import numpy as np

    from sdt_drake.analysis import plots
    from sdt_drake.analysis.budget import error_budget
    from sdt_drake.tables import RESULTS, Results

    common.check_out(options.out, tables=RESULTS, show=options.show)
    design = common.design_of(options)
    with common.naming(options.scenario):
        budget = error_budget(design)
    signals = {"whole": budget.whole, **budget.parts, "remainder": budget.remainder}
    names = design.robot.joint_names
    common.say(
        f"{design.scenario.name}: RMS of the speed error and of its parts [rad/s]; in brackets the"
    )
    common.say("largest. The parts add up to the whole at every instant; their sizes do not.")

    def size(values: NDArray[np.float64], k: int) -> str:
        return f"{np.sqrt(np.mean(values[:, k] ** 2)):.2g} ({np.abs(values[:, k]).max():.2g})"

    common.print_table(
        ("part", *(f"{k + 1} {name}" for k, name in enumerate(names))),
        [
            (label, *(size(values, k) for k in range(len(names))))
            for label, values in signals.items()
        ],
    )
    title = f"{design.scenario.name}: parts of the speed error"
    columns = {name.replace(" ", "_"): values for name, values in signals.items()}
    common.deliver(
        options,
        lambda: plots.error_budget(title, budget, names),
        numbers=lambda: Results(
            {
                "title": title,
                "rms": {x: np.sqrt(np.mean(values**2, axis=0)) for x, values in columns.items()},
                "largest": {x: np.abs(values).max(axis=0) for x, values in columns.items()},
            },
            {"time": budget.time, **columns},
            {"time": "s", **dict.fromkeys(columns, "rad/s")},
        ),
    )
