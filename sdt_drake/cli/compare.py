"""The command `compare`."""

from functools import partial
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

import sdt_drake as sdt
from sdt_drake.cli import common, completion
from sdt_drake.cli.common import Given, Out, Scenario, Show
from sdt_drake.cli.printing import echo, print_table

if TYPE_CHECKING:
    from sdt_drake.analysis.comparison import Comparison

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
        out: CSV file for the table, or a figure of it (.png, .svg, .pdf)
    """
    from sdt_drake.analysis import comparison
    from sdt_drake.analysis.tracking import stops_passed

    common.check_out(out, show, [".csv"])
    design = common.design_of(scenario, given.changes)
    name, plant = design.scenario.name, design.scenario.plant.kind
    text = CONTROLLERS[plant] if controllers is None else controllers
    labels = [label.strip() for label in text.split(",") if label.strip()]
    comparison.check_labels(labels, "--controllers")
    compared = sdt.compare(design, labels)
    count = f"{len(compared)} controller{'s' if len(compared) > 1 else ''}"
    echo(f"{name}: {count} on the {plant} plant{_ranking(compared)}")
    print_table(*comparison.comparison_rows(compared), keys=2)
    echo("Speeds and positions: joint side. Torques: motor side, in % of the motor's torque limit.")
    for c in compared:
        for line in stops_passed(c.recording, c.design.device.simulated.joint_names):
            echo(f"note: {c.label}: {line}")
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
    title, write = f"{name}: controllers", partial(comparison.write_comparison, compared)
    common.deliver(out, show, lambda: sdt.plots.comparison(title, compared), write)


def _ranking(compared: "Comparison") -> str:
    """Return the controllers with the smallest and the largest speed error."""
    errors = {c.label: float(c.tracking.max_abs_speed_error.max()) for c in compared}
    best, worst = min(errors, key=errors.__getitem__), max(errors, key=errors.__getitem__)
    verdict = f"; {best} follows best, with speed errors up to {errors[best]:.4g} rad/s"
    return verdict + (f" ({worst}: {errors[worst]:.4g} rad/s)" if best != worst else "")
