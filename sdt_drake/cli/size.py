"""Find the motors that are enough, for each controller."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path

from sdt_drake.cli.common import check_folder, naming_changes, say
from sdt_drake.cli.study import FAILED, add_running, run_into
from sdt_drake.io.files import replacing_files, write_text

EXAMPLE = "sdt-drake size sizing --workers 2 --out sizing"


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("study", metavar="SIZING", help="name of one that ships, or .yaml file")
    add_running(parser)


def run(options: argparse.Namespace) -> None:
    from sdt_drake.show.figures.fronts import sizing_front
    from sdt_drake.show.style import pictures, save_both
    from sdt_drake.studies.results import read_study_table
    from sdt_drake.studies.sizing import load_sizing
    from sdt_drake.studies.summary import failures
    from sdt_drake.studies.verdicts import judge_candidates, sizing_lines, write_verdicts

    with naming_changes(options):
        sizing, base = load_sizing(options.study, dict(options.changes))
    folder = options.out or Path(sizing.name)
    check_folder(folder, ("sizing.txt", "candidates.csv", *pictures("front")))
    run_into(folder, sizing.study(), base, options)
    table = read_study_table(folder)
    verdicts = judge_candidates(sizing, table)
    failed = failures(table)
    lines = [*filter(None, [failed]), *sizing_lines(sizing, verdicts)]
    for line in lines:
        say(line)
    say()
    with replacing_files(folder) as new:
        write_text(new / "sizing.txt", "\n".join(lines) + "\n")
        write_verdicts(verdicts, new / "candidates.csv")
        figure = sizing_front(f"{sizing.name}: motors and tracking", verdicts)
        save_both(figure, new / "front")
    say(f"sizing.txt, candidates.csv, front.png and front.svg written to {folder}")
    say(f"its runs: sdt-drake study show {shlex.quote(str(folder))}")
    if failed:
        raise SystemExit(FAILED)
