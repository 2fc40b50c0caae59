"""Running a study into its folder, from the start or from where it was interrupted."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from sdt_drake.studies.folder import claim, save_study
from sdt_drake.studies.interrupts import Interrupts, Waiting
from sdt_drake.studies.job import Job
from sdt_drake.studies.journal import Journal
from sdt_drake.studies.results import require_parquet, write_results
from sdt_drake.studies.workers import Pool

Report = Callable[[int, int, int], None]
"""Called with the numbers of runs that are done now, were done before, and are wanted."""


def run_study(
    job: Job,
    folder: Path,
    *,
    workers: int = 1,
    cluster: str | None = None,
    resume: bool = False,
    report: Report = lambda done, before, count: None,
) -> Path:
    """Run the rows of a study that its folder does not have yet, and write results.parquet.

    Rows do not depend on where, in which order, or how often interrupted they are run.

    Args:
        job: the study.
        folder: of the study, made if it is not there.
        workers: processes on this machine.
        cluster: address of a Dask scheduler, whose workers run the rows instead.
        resume: whether the folder holds a part of this study.
        report: told of progress.

    Returns:
        The file of results.

    Raises:
        InputError: if the folder has a study and `resume` is not set, or has another study, or
            none; for more workers than the machine bears; if the cluster cannot be reached, or has
            no workers any more; if the disk is full.
        KeyboardInterrupt: between two rows, with all that were done on the disk.
    """
    require_parquet()
    with Interrupts() as interrupts, _backend(job, workers, cluster, interrupts.allowed) as backend:
        claim(job, folder, resume)
        with Journal(folder, len(job.study), len(job.outcomes)) as journal:
            save_study(job, folder)
            before = int(journal.done.sum())
            done = before
            report(done, before, len(job.study))
            for rows in backend.map([number] for number in np.flatnonzero(~journal.done).tolist()):
                journal.append(rows)
                done += len(rows)
                report(done, before, len(job.study))
            return write_results(job, journal.rows(), folder)


@contextmanager
def _backend(job: Job, workers: int, cluster: str | None, waiting: Waiting) -> Iterator:
    if cluster is None:
        with Pool(job, workers, waiting) as pool:
            yield pool
    else:
        from sdt_drake.studies.cluster import Cluster

        with Cluster(job, cluster, waiting) as distributed:
            yield distributed
