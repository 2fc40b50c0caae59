"""Recompute the study of the paper: tables, figures, diagrams, claims."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from sdt_drake.commands.common import add_out, check_folder, say
from sdt_drake.progress import part

EXAMPLE = "sdt-drake reproduce --out out"


def add(parser: argparse.ArgumentParser) -> None:
    add_out(parser, "folder for the results", default="out")


def run(options: argparse.Namespace) -> None:
    from sdt_drake.analysis.files import write_reproduction
    from sdt_drake.analysis.reproduction import Stopwatch, reproduce
    from sdt_drake.graphviz import NO_GRAPHVIZ, has_graphviz

    start = time.perf_counter()
    folder: Path = options.out
    check_folder(folder)
    folder.mkdir(parents=True, exist_ok=True)
    watch = Stopwatch(say)
    with part():
        claims = write_reproduction(reproduce(watch), folder, watch, say)
    say()
    for claim in claims:
        say(f"  {claim.id:29s} {claim.verdict}")
    if not has_graphviz():
        say(f"\nNo .svg of the block diagrams: {NO_GRAPHVIZ}")
    seconds = time.perf_counter() - start
    say(f"\n{folder / 'report.md'} and report.html written, {seconds:.1f} s in all")
