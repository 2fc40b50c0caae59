"""Split the speed error of an axis scenario into its causes."""

from __future__ import annotations

import argparse

import numpy as np

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.cli.common import say
from sdt_drake.io.arrays import Array
from sdt_drake.io.shown import numbered
from sdt_drake.io.tables import RESULT_TABLES, Results

EXAMPLE = "sdt-drake budget axis_pi_ctc --out budget.png"


def add(parser: argparse.ArgumentParser) -> None:
    common.add_scenario(parser)
    text = "the parts (.csv, .json), or a figure of them (.png, .svg, .pdf)"
    common.add_figure(parser, text, RESULT_TABLES)


def run(options: argparse.Namespace) -> None:
    from sdt_drake.analysis.budget import error_budget

    design = common.design_of(options)
    with common.naming(options.scenario):
        budget = error_budget(design)
    signals = {"whole": budget.whole, **budget.parts, "remainder": budget.remainder}
    names = design.robot.joint_names
    say(f"{design.scenario.name}: RMS of the speed error and of its parts [rad/s]; in brackets the")
    say("largest. The parts add up to the whole at every instant; their sizes do not.")

    def size(error: Array) -> str:
        return f"{np.sqrt(np.mean(error**2)):.2g} ({np.abs(error).max():.2g})"

    common.print_table(
        ("part", *numbered(names)),
        [(label, *map(size, values.T)) for label, values in signals.items()],
    )
    title = f"{design.scenario.name}: parts of the speed error"
    columns = {name.replace(" ", "_"): values for name, values in signals.items()}
    about = {
        "title": title,
        "rms": {x: np.sqrt(np.mean(values**2, axis=0)) for x, values in columns.items()},
        "largest": {x: np.abs(values).max(axis=0) for x, values in columns.items()},
    }
    units = dict.fromkeys(columns, "rad/s")
    results = Results(about, {"time": budget.time, **columns}, units)
    common.deliver(options, lambda: sdt.plots.error_budget(title, budget, names), results.write)
