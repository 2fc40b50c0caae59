"""Recompute the study of the paper: tables, figures, diagrams, claims."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from sdt_drake.cli.common import add_out, check_folder, say, say_wrapped

EXAMPLE = "sdt-drake reproduce --out out"


def add(parser: argparse.ArgumentParser) -> None:
    add_out(parser, "folder for the results", default="out")


def run(options: argparse.Namespace) -> None:
    from sdt_drake.analysis.reproduction import Stopwatch, reproduce
    from sdt_drake.show.documents import REPORT, plain
    from sdt_drake.show.reports.paper import count_verdicts, findings
    from sdt_drake.show.reports.paper_files import FILES, write_reproduction

    start = time.perf_counter()
    folder: Path = options.out
    check_folder(folder, FILES)
    watch = Stopwatch(say)
    summary = write_reproduction(reproduce(watch), folder, watch)
    counts = (f"{n} {verdict}" for verdict, n in count_verdicts(summary["claims"]).items())
    say(f"\nOf {len(summary['claims'])} claims of the paper: {', '.join(counts)}")
    for finding in findings(summary):
        say_wrapped(plain(finding), "- ")
    seconds = time.perf_counter() - start
    say(f"\nOpen {folder / REPORT}; {seconds:.1f} s in all")
