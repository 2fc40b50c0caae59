"""The command `stops`."""

from typing import Annotated, Literal

from cyclopts import Parameter

import sdt_drake as sdt
from sdt_drake.cli import common
from sdt_drake.cli.common import Given, Integer, Out, Scenario, Show, number, one_of
from sdt_drake.cli.printing import echo, print_document_table
from sdt_drake.io.formats import TABLES


def run(
    scenario: Scenario,
    /,
    *,
    stops: Annotated[str, one_of("stops")] = "stops",
    category: Annotated[Integer | None, number(gte=0, lte=2)] = None,
    ramp: Literal["joint", "coordinated"] | None = None,
    failed_motor: Annotated[Integer | None, Parameter(metavar="K"), number(gte=1)] = None,
    every: Annotated[float | None, number(gt=0)] = None,
    out: Out = None,
    show: Show = False,
    given: Given = Given(),
) -> None:
    """Simulate an emergency stop from every instant of a run. No statement on safety.

    example: sdt-drake stops coupled_pi --category 1 --out stops

    Args:
        stops: file of brakes, ramps and limits, or the name of a shipped one
        category: stop category of IEC 60204-1: 0 power off and brakes, 1 ramps and then brakes, 2
            ramps with power on (default: that of the file)
        ramp: own deceleration of each joint, or all joints together (default: that of the file)
        failed_motor: motor that has no torque in the stop, counted from the base, 1
        every: time between the instants at which stops begin [s] (default: that of the file)
        out: folder for report, plots, table and the hardest stop in 3D; or file for the table
            alone (.csv, .mat, .parquet) or a figure (.png, .svg, .pdf)
    """
    from sdt_drake.analysis.stopping import load_stopping
    from sdt_drake.show.reports.stops import CAUTION, FILES, stop_findings, stop_tables, write_stops

    common.check_out(out, show, ["", *TABLES])
    if out is not None and not out.suffix:
        common.check_folder(out, FILES)
    design = common.design_of(scenario, given.changes)
    options = {"category": category, "ramp": ramp, "failed_motor": failed_motor, "every": every}
    changes = {name: value for name, value in options.items() if value is not None}
    found = sdt.stops(design, load_stopping(stops, design.nominal.n).changed(changes))
    for line in stop_findings(found):
        echo(line)
    for table in stop_tables(found).values():
        echo()
        print_document_table(table)
    echo(f"\n{CAUTION}")
    if out is not None and not out.suffix:
        period = design.reference.held.period
        echo(f"{write_stops(found, design.scenario.summary().title, period, out)} written")
        out = None
    common.deliver(out, show, found.plot, found.save)
