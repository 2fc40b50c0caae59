"""Run many variants of a scenario, show what came out, or repeat one of them."""

from __future__ import annotations

import argparse
import shlex
import time
from pathlib import Path
from typing import TYPE_CHECKING

from sdt_drake.cli import common
from sdt_drake.cli.bar import bar, duration
from sdt_drake.cli.common import print_table, say
from sdt_drake.io.errors import InputError

if TYPE_CHECKING:
    from sdt_drake.run.scenario import Scenario
    from sdt_drake.studies.study import Study
    from sdt_drake.studies.table import StudyTable

EXAMPLE = "sdt-drake study monte_carlo --workers 2 --out mc"

FAILED = 1
"""Exit code where runs have failed, so that there is no answer."""

_USAGE = """sdt-drake study STUDY [--out DIR] [--workers N | --cluster ADDRESS] [--resume]
                 [--set FIELD=VALUE]
       sdt-drake study show DIR [--out DIR_OF_PAGE]
       sdt-drake study repeat DIR --row N [--out FILE.csv]"""


def add(parser: argparse.ArgumentParser) -> None:
    parser.usage = _USAGE
    parser.add_argument("what", nargs="+", metavar="STUDY | show DIR | repeat DIR")
    add_running(parser)
    parser.add_argument("--row", type=int, metavar="N", help="of the run to repeat")


def run(options: argparse.Namespace) -> None:
    match options.what:
        case ["show", folder]:
            _refuse_unused(options, "workers", "cluster", "resume", "changes", "row")
            show(Path(folder), options.out)
        case ["repeat", folder]:
            _refuse_unused(options, "workers", "cluster", "resume", "changes")
            repeat(Path(folder), options.row, options.out)
        case [path] if path not in ("show", "repeat"):
            _refuse_unused(options, "row")
            run_file(path, options)
        case what:
            raise InputError(f"study: '{' '.join(what)}', expected {' '.join(_USAGE.split())}")


def _refuse_unused(options: argparse.Namespace, *names: str) -> None:
    usage = " ".join(_USAGE.split())
    common.refuse_options(options, f"has no use here, expected {usage}", *names)


# --- run -------------------------------------------------------------------------------------


def add_running(parser: argparse.ArgumentParser) -> None:
    """Add the options of what runs a study."""
    parser.add_argument(
        "--out", type=common.some_path, help="folder of the study (default: its name)"
    )
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--workers", type=int, help="processes on this machine (default: 1)")
    where.add_argument("--cluster", metavar="ADDRESS", help="of a Dask scheduler, tcp://HOST:8786")
    parser.add_argument("--resume", action="store_true", help="finish the study that DIR holds")
    common.add_changes(parser)


def run_file(path: str, options: argparse.Namespace) -> None:
    import numpy as np

    from sdt_drake.studies.results import read_study_table
    from sdt_drake.studies.study import load_study
    from sdt_drake.studies.table import ANSWERS

    with common.naming_changes(options):
        study, base = load_study(path, dict(options.changes))
    folder = options.out or Path(study.name)
    results = run_into(folder, study, base, options)
    table = read_study_table(folder)
    say_failures(table)
    say(f"{results} written; sdt-drake study show {shlex.quote(str(folder))}")
    if not np.isin(table.status, ANSWERS).any():
        raise SystemExit(FAILED)


def say_failures(table: StudyTable) -> str:
    """Say what has failed in a study, and return it; "" if nothing has."""
    from sdt_drake.studies.summary import failures

    if failed := failures(table):
        say(failed)
    return failed


def run_into(folder: Path, study: Study, base: Scenario, options: argparse.Namespace) -> Path:
    """Run what a study's folder does not have yet, as the options of `add_running` say; returns the
    file of results."""
    from sdt_drake.studies.execute import run_study
    from sdt_drake.studies.folder import holds_study
    from sdt_drake.studies.job import make_job

    common.check_folder(folder)
    try:
        return run_study(
            make_job(study, base),
            folder,
            workers=1 if options.workers is None else options.workers,
            cluster=options.cluster,
            resume=options.resume,
            report=Progress(),
        )
    except KeyboardInterrupt:
        bar.end("\n")
        if holds_study(folder):
            where = shlex.quote(str(folder))
            say(f"interrupted; what is done is kept, --resume --out {where} goes on")
        raise
    finally:
        bar.end("\n")


class Progress:
    """How far a study is: a line that is drawn anew on a screen, a few lines elsewhere."""

    def __init__(self) -> None:
        self._start = time.monotonic()
        self._said = -1

    def __call__(self, done: int, before: int, count: int) -> None:
        tenth = 10 * done // count
        if not bar.has_terminal and tenth == self._said:
            return
        self._said = tenth
        text = f"{done} of {count} runs"
        if new := done - before:
            rate = new / (time.monotonic() - self._start)
            text += f", {rate:.3g} per second, {duration((count - done) / rate)} left"
        if bar.has_terminal:
            bar.draw(done / count, text)
        else:
            say(text)


# --- repeat and show -------------------------------------------------------------------------


def repeat(folder: Path, row: int | None, out: Path | None) -> None:
    from sdt_drake.show.reports.study import cell, outcome_tables
    from sdt_drake.studies.folder import load_runner
    from sdt_drake.studies.store import Store

    runner, names, other = load_runner(folder)
    study = runner.study
    if row is None or not 0 <= row < len(study):
        raise InputError(f"study repeat: --row {row}, expected 0 to {len(study) - 1}")
    if out is not None:
        common.check_file(out, [".csv"])
    with Store(folder) as store:
        inputs = store.inputs(row) or study.inputs(row)
    outcomes, recording, wrong = runner.repeat(row, inputs)
    if wrong:
        say(f"run failed: {wrong}")
        say()
    print_table(("input", "value"), [(k, cell(v)) for k, v in inputs.items()])
    for table in outcome_tables(names, outcomes):
        say()
        common.print_document_table(table)
    if other:
        say(f"The study was begun with {other}: numbers may differ.")
    if out is not None:
        recording.to_csv(out)
        say(f"{out} written")


def show(folder: Path, out: Path | None) -> None:
    from sdt_drake.show.reports.study import write_study_report
    from sdt_drake.studies.results import read_study_table

    if out is not None:
        common.check_folder(out)
    if say_failures(read_study_table(folder)):
        say()
    page, tables = write_study_report(folder, out)
    for table in tables:
        say(table.title)
        common.print_document_table(table)
        say()
    say(f"a run once more, exactly: sdt-drake study repeat {shlex.quote(str(folder))} --row N")
    say(f"{page} written")
