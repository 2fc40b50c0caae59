"""The command `compare`."""

from typing import Annotated

from cyclopts import Parameter

import sdt_drake as sdt
from sdt_drake.cli import common, completion
from sdt_drake.cli.common import Given, Out, Scenario, Show
from sdt_drake.cli.printing import echo, print_table

CONTROLLERS = {
    "axis": "pi,pi_ctc,pi_id,p_pi+id,pi_scheduled",
    "coupled": "pi,pi_ctc,pi_id,p_pi,p_pi+id,pi_scheduled,inverse_dynamics",
}


def run(
    scenario: Scenario,
    /,
    *,
    controllers: Annotated[str | None, Parameter(completer=completion.controllers)] = None,
    out: Out = None,
    show: Show = False,
    given: Given = Given(),
) -> None:
    """Run a scenario with several controllers and compare their errors.

    example: sdt-drake compare coupled_pi --controllers pi,pi_id,p_pi+id

    Args:
        controllers: kinds of controllers, separated by commas; add +none, +ctc or +id to a kind
            with a choice of feedforward (default: all that the plant allows)
        out: page of errors and torques over time to zoom (.html), CSV file for the table, or a
            figure of it (.png, .svg, .pdf)
    """
    from sdt_drake.analysis import comparison
    from sdt_drake.show.reports.compare import notes, verdict

    common.check_out(out, show, [".csv", ".html"])
    design = common.design_of(scenario, given.changes)
    name, plant = design.scenario.name, design.scenario.plant.kind
    text = CONTROLLERS[plant] if controllers is None else controllers
    labels = [label.strip() for label in text.split(",") if label.strip()]
    comparison.check_labels(labels, "--controllers")
    compared = sdt.compare(design, labels)
    echo(f"{name}: {verdict(compared)}")
    print_table(*comparison.comparison_rows(compared), keys=2)
    echo("Speeds and positions: joint side. Torques: motor side, in % of the motor's torque limit.")
    for line in notes(compared):
        echo(f"note: {line}")
    echo()
    header, rows = comparison.felt_rows(compared)
    if rows:
        print_table(header, rows)
        echo(
            "felt: share of the time in which the pilot could feel the error; largest: multiple of"
        )
        echo("the threshold of feeling, about and along the axes of the head")
        echo()
    rows = [[c.label, ", ".join(c.needs)] for c in compared]
    print_table(("controller", "needs to know"), rows)
    title = f"{name}: controllers"
    common.deliver(
        out,
        show,
        lambda: sdt.plots.comparison(title, compared),
        lambda path: (
            compared.page(path)
            if path.suffix == ".html"
            else comparison.write_comparison(compared, path)
        ),
    )
