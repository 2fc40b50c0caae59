"""The command `budget`."""

from typing import TYPE_CHECKING

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.cli.common import Given, Out, Scenario, Show
from sdt_drake.cli.printing import echo, print_table
from sdt_drake.io.errors import within
from sdt_drake.io.results import RESULT_TABLES, Results

if TYPE_CHECKING:
    from sdt_drake.io.arrays import Array
from sdt_drake.io.shown import formatted, numbered


def run(
    scenario: Scenario,
    /,
    *,
    out: Out = None,
    show: Show = False,
    given: Given = Given(),
) -> None:
    """Split the speed error of a scenario on the axis plant into its causes.

    example: sdt-drake budget axis_pi_ctc --out budget.png

    Args:
        out: file for the parts (.csv, .json), or for a figure of them (.png, .svg, .pdf)
    """
    import numpy as np

    from sdt_drake.analysis.budget import error_budget

    common.check_out(out, show, RESULT_TABLES)
    design = common.design_of(scenario, given.changes)
    with within(scenario):
        budget = error_budget(design)
    signals = {"whole": budget.whole, **budget.parts, "remainder": budget.remainder}
    names = design.device.simulated.joint_names
    rms = {name: np.sqrt(np.mean(values**2, axis=0)) for name, values in signals.items()}
    k = int(rms["whole"].argmax())
    cause = max((name for name in signals if name != "whole"), key=lambda name: float(rms[name][k]))
    echo(
        f"{design.scenario.name}: the speed error is largest at {design.device.nominal.joint(k)}, "
        f"{rms['whole'][k]:.2g} rad/s RMS; its largest part is the {cause}, "
        f"{rms[cause][k]:.2g} rad/s"
    )
    echo("RMS of the speed error and of its parts [rad/s]; the largest values are in brackets.")
    echo("The parts add up to the whole at every instant, but their RMS and largest values do not.")

    def size(error: "Array") -> str:
        rms, most = float(np.sqrt(np.mean(error**2))), float(np.abs(error).max())
        return f"{formatted(rms, '.2g')} ({formatted(most, '.2g')})"

    print_table(
        ("part", *numbered(names)),
        [(label, *map(size, values.T)) for label, values in signals.items()],
    )
    title = f"{design.scenario.name}: parts of the speed error"
    columns = {name.replace(" ", "_"): values for name, values in signals.items()}
    about = {
        "title": title,
        "rms": dict(zip(columns, rms.values(), strict=True)),
        "largest": {x: np.abs(values).max(axis=0) for x, values in columns.items()},
    }
    units = dict.fromkeys(columns, "rad/s")
    results = Results(about, {"time": budget.time, **columns}, units)
    common.deliver(out, show, lambda: sdt.plots.error_budget(title, budget, names), results.write)
