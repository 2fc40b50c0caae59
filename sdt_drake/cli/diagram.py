"""The command `diagram`."""

import re
from pathlib import Path
from typing import Annotated, Literal

from sdt_drake.cli import common
from sdt_drake.cli.common import Flag, Given, Integer, Out, Scenario, number
from sdt_drake.cli.printing import echo
from sdt_drake.io.errors import InputError


def run(
    scenario: Scenario,
    /,
    *,
    format: Literal["dot", "svg", "png", "pdf"] | None = None,
    depth: Annotated[Integer, number(gte=0, lte=100)] = 2,
    drake: Flag = False,
    paper: Flag = False,
    ports: Flag = False,
    out: Out = None,
    given: Given = Given(),
) -> None:
    """Export the block diagram of a scenario's loop.

    example: sdt-drake diagram axis_pi_ctc --format svg --out loop.svg

    Args:
        format: format of the file (default: that of --out, or dot)
        depth: number of levels of diagrams to open
        drake: write Drake's own graph; other formats than dot then need Graphviz
        paper: name signals as the paper does: tau_LD, tau_alleviate, q̇_mr
        ports: list the outputs of all blocks instead, which probes of a scenario may name
        out: file for the diagram (default: the scenario's name)
    """
    from sdt_drake.run.loop import make_loop
    from sdt_drake.run.probes import output_ports, unit_of
    from sdt_drake.show.block_diagrams import FORMATS, write_diagram
    from sdt_drake.show.symbols import PAPER

    if paper and (drake or ports):
        raise InputError("--paper: has no effect with --drake or --ports")
    if ports:
        if out is not None or format is not None:
            raise InputError("--ports: prints a list, remove --out and --format")
        loop = make_loop(common.design_of(scenario, given.changes)).diagram
        for path_, port in output_ports(loop).items():
            echo(f"{path_}{f' [{unit}]' if (unit := unit_of(path_)) else ''}, {port.size()}")
        return
    suffix = out.suffix.removeprefix(".") if out else ""
    format_ = format or (suffix if suffix in FORMATS else "dot")
    if out is not None:
        common.check_file(out, [f".{format_}"] if format else [f".{f}" for f in FORMATS])
    design = common.design_of(scenario, given.changes)
    name = re.sub(r"[^\w.-]+", "_", design.scenario.name).strip(".")
    path = out or Path(f"{name}.{format_}")
    loop = make_loop(design).diagram
    signals = PAPER if paper else None
    write_diagram(loop, path, format_=format_, max_depth=depth, drake=drake, signals=signals)
    echo(f"{path} written")
