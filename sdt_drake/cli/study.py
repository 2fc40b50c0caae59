"""The command `study`."""

import shlex
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from sdt_drake.cli import common
from sdt_drake.cli.common import Given, Integer, Out, Target, Trust, number, one_of
from sdt_drake.cli.printing import bar, echo, errors, print_document_table, print_table
from sdt_drake.io.errors import InputError
from sdt_drake.io.shown import duration

if TYPE_CHECKING:
    from sdt_drake.run.scenario import Scenario
    from sdt_drake.studies.job import Job
    from sdt_drake.studies.study import Study
    from sdt_drake.studies.table import StudyTable

FAILED = 1
"""Exit code if runs failed and left the study without an answer."""

_FEW = 10
"""Runs that start without an estimate of their time, which costs a run."""

Workers = Annotated[
    Integer | None, Parameter(metavar="N", help="processes on this machine (default: 1)")
]
Cluster = Annotated[
    str | None, Parameter(metavar="ADDRESS", help="address of a Dask scheduler, tcp://HOST:8786")
]
Quick = Annotated[
    bool, Parameter(show_default=False, help="a first look: fewer runs, speeds to 0.01 rad/s")
]
Resume = Annotated[bool, Parameter(show_default=False, help="finish the study in the folder")]

Folder = Annotated[Target, Parameter(name="DIR", help="folder of the study")]


def run(
    study: Annotated[str, one_of("study")],
    /,
    *,
    out: Out = None,
    workers: Workers = None,
    cluster: Cluster = None,
    resume: Resume = False,
    draws: Annotated[Integer | None, number(gte=1)] = None,
    quick: Quick = False,
    given: Given = Given(),
) -> int:
    """Run many variants of a scenario.

    example: sdt-drake study run monte_carlo --workers 2 --out mc

    Args:
        study: shipped name or .yaml file of a study
        out: folder for the study (default: its name)
        draws: number of draws of the random variables (default: that of the file)
        quick: a first look: at most two draws, speeds to 0.01 rad/s
    """

    from sdt_drake.studies.results import read_study_table
    from sdt_drake.studies.study import load_study, shortened
    from sdt_drake.studies.table import ANSWERS

    loaded, base = load_study(study, dict(given.changes))
    loaded = shortened(loaded, draws, quick=quick)
    folder = out or Path(loaded.name + "_quick" * quick)
    results = run_into(folder, loaded, base, workers, cluster, resume)
    table = read_study_table(folder)
    echo(study_summary(loaded.name, table))
    echo(f"{results} written; next: sdt-drake study show {shlex.quote(str(folder))}")
    return 0 if table.status.isin(ANSWERS).any() else FAILED


def study_summary(name: str, table: "StudyTable") -> str:
    """Return the number of runs with a result, and those without and their cause."""
    from sdt_drake.studies.summary import failures
    from sdt_drake.studies.table import ANSWERS

    count, answered = len(table) + table.missing, table.status.isin(ANSWERS).sum()
    parts = f"{name}: {answered} of {count} runs have a result", failures(table)
    return "; ".join(filter(None, parts))


def run_into(
    folder: Path,
    study: "Study",
    base: "Scenario",
    workers: int | None,
    cluster: str | None,
    resume: bool,
) -> Path:
    """Run all rows that a study's folder does not contain yet, and return the file of results."""
    from sdt_drake.studies.execute import run_study
    from sdt_drake.studies.folder import holds_study
    from sdt_drake.studies.job import make_job

    if cluster is not None:
        common.refuse(
            "has no effect with --cluster, whose processes run the study", workers=workers
        )
    common.check_folder(folder)
    job = make_job(study, base)
    try:
        return run_study(
            job,
            folder,
            workers=1 if workers is None else workers,
            cluster=cluster,
            resume=resume,
            report=Progress(job, None if cluster else workers or 1),
        )
    except KeyboardInterrupt:
        bar.end()
        if holds_study(folder):
            where = shlex.quote(str(folder))
            echo(f"interrupted; finished runs are kept. To continue, add --resume --out {where}")
        raise


class Progress:
    """The progress of a study: a bar on a terminal, a few lines elsewhere."""

    def __init__(self, job: "Job", workers: int | None) -> None:
        """Make the progress of a study on `workers` processes; None for those of a cluster."""
        self._job, self._workers = job, workers
        self._said = -1

    def _begin(self, left: int) -> None:
        """Print the number of runs and, of more than a few, about how long they take."""
        from sdt_drake.studies.runs import Runner

        text = f"{self._job.study.name}: {left} run{'s' * (left != 1)}"
        if left > _FEW:
            start = time.perf_counter()
            Runner(self._job.study, self._job.base).run(0)
            whole = (time.perf_counter() - start) * left
            if self._workers is None:
                text += f", about {duration(whole)} of computing"
            else:
                text += f", about {duration(whole / self._workers)} with {self._workers} at once"
        echo(text)
        self._start = time.monotonic()

    def __call__(self, done: int, before: int, count: int) -> None:
        if self._said == -1:
            self._begin(count - before)
        text = f"{done} of {count} runs"
        if new := done - before:
            pace = new / (time.monotonic() - self._start)
            text += f", {pace:.3g} per second, {duration((count - done) / pace)} left"
        tenth = 10 * done // count
        if not errors.is_terminal and tenth != self._said:
            echo(text)
        self._said = tenth
        bar.report(done / count, text)


# --- repeat and show -------------------------------------------------------------------------


def repeat(
    folder: Folder,
    /,
    *,
    row: Annotated[Integer, Parameter(metavar="N")],
    out: Out = None,
    trust: Trust = False,
) -> None:
    """Repeat one of a study's runs exactly.

    example: sdt-drake study repeat mc --row 47 --out row47.csv

    Args:
        row: row of the run, from 0
        out: CSV file for the recording
    """
    from sdt_drake.show.reports.study_tables import cell, outcome_tables
    from sdt_drake.studies.folder import load_runner
    from sdt_drake.studies.store import Store

    runner, names, other = load_runner(folder)
    study = runner.study
    if not 0 <= row < len(study):
        raise InputError(f"{row}, expected 0 to {len(study) - 1}", place="--row")
    if out is not None:
        common.check_file(out, [".csv"])
    with Store(folder) as store:
        inputs = store.inputs(row) or study.inputs(row)
    outcomes, recording, wrong = runner.repeat(row, inputs)
    echo(f"{study.name}, row {row}: {f'the run failed: {wrong}' if wrong else 'repeated exactly'}")
    print_table(("input", "value"), [(k, cell(v)) for k, v in inputs.items()])
    for table in outcome_tables(names, outcomes):
        echo()
        print_document_table(table)
    if other:
        echo(f"The study was run with {other}, so numbers may differ.")
    if out is not None:
        recording.save(out)
        echo(f"{out} written")


def show(folder: Folder, /, *, out: Out = None) -> None:
    """Print the results of a study, and write a report of them.

    example: sdt-drake study show mc

    Args:
        out: folder for the report (default: that of the study)
    """
    from sdt_drake.show.reports.study import write_study_report
    from sdt_drake.studies.results import read_study_table

    if out is not None:
        common.check_folder(out)
    table = read_study_table(folder)
    page, tables = write_study_report(folder, out)
    echo(study_summary(table.name, table))
    echo(f"{page} written")
    echo(f"next, to repeat a run: sdt-drake study repeat {shlex.quote(str(folder))} --row N")
    echo()
    for shown in tables:
        echo(shown.title)
        print_document_table(shown)
        echo()
