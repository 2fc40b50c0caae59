"""Export the block diagram of a scenario's loop."""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from sdt_drake.cli import common
from sdt_drake.cli.common import say
from sdt_drake.io.errors import checked_choice

EXAMPLE = "sdt-drake diagram axis_pi_ctc --format svg --out loop.svg"


def add(parser: argparse.ArgumentParser) -> None:
    common.add_scenario(parser)
    parser.add_argument("--format", help="dot, svg, png or pdf (default: by --out, or dot)")
    parser.add_argument(
        "--depth",
        type=common.number(int, minimum=0, maximum=100),
        default=2,
        help="levels of diagrams to open",
    )
    parser.add_argument(
        "--drake", action="store_true", help="Drake's own graph; its pictures need Graphviz"
    )
    common.add_out(parser, "file; by default the scenario's name")


def run(options: argparse.Namespace) -> None:
    from sdt_drake.run.loop import make_loop
    from sdt_drake.show.block_diagrams import FORMATS, write_diagram

    suffix = options.out.suffix.removeprefix(".") if options.out else ""
    format_ = options.format or (suffix if suffix in FORMATS else "dot")
    checked_choice(format_, FORMATS, "--format")
    if options.out is not None:
        common.check_file(
            options.out, [f".{format_}"] if options.format else [f".{f}" for f in FORMATS]
        )
    design = common.design_of(options)
    name = re.sub(r"[^\w.-]+", "_", design.scenario.name).strip(".")
    path = options.out or Path(f"{name}.{format_}")
    loop = make_loop(design)
    write_diagram(loop, path, format_=format_, max_depth=options.depth, drake=options.drake)
    say(f"{path} written")
