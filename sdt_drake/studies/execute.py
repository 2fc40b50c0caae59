"""Run a study into its folder, from the start or from the point of interruption."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from itertools import islice
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from sdt_drake.studies.folder import opened
from sdt_drake.studies.job import Job
from sdt_drake.studies.results import write_results
from sdt_drake.studies.table import pandas

ReportRuns = Callable[[int, int, int], None]
"""Callback with three numbers of runs: done now, done before this call, in the whole study."""

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def run_study(
    job: Job,
    folder: Path,
    *,
    workers: int = 1,
    cluster: str | None = None,
    resume: bool = False,
    report: ReportRuns = lambda done, before, count: None,
) -> Path:
    """Run the rows of a study that its folder does not contain yet, and write the results.

    Rows do not depend on the machine, the order of runs, or interruptions.

    Args:
        job: the study.
        folder: folder of the study; made if it does not exist.
        workers: number of processes on this machine.
        cluster: address of a Dask scheduler, whose workers run the rows instead.
        resume: whether the folder may already contain a part of this study.
        report: callback for progress.

    Returns:
        Path of the file of results.

    Raises:
        InputError: if the folder contains this study (without `resume`), another one or other
            files; for too many workers; for a lost cluster; for a full disk.
        KeyboardInterrupt: on Ctrl-C. It comes between two rows; all finished rows are on the disk.
    """
    pandas()  # writes the results: without it nothing is run
    study, inbox = job.study, SimpleQueue[Any]()
    backend: Pool | Cluster
    if cluster is None:
        from sdt_drake.studies.pool import Pool

        backend = Pool(job, workers)
    else:
        from sdt_drake.studies.cluster import Cluster

        backend = Cluster(job, cluster, inbox.put)
    with (
        _signals_into(inbox.put),
        closing(backend),
        opened(job, folder, resume) as store,
    ):
        done = store.done()
        missing = (number for number in range(len(study)) if number not in done)
        before = len(done)

        def submit(count: int) -> None:
            for number in islice(missing, count):
                backend.submit(number, study.inputs(number)).add_done_callback(inbox.put)

        report(before, before, len(study))
        submit(backend.ahead)
        for count in range(before + 1, len(study) + 1):
            message = inbox.get()
            if isinstance(message, BaseException):
                raise message
            row = message.result()
            store.append(row, study.inputs(row.number))
            submit(1)
            report(count, before, len(study))
        return write_results(store, folder)


@contextmanager
def _signals_into(put: Callable[[KeyboardInterrupt], None]) -> Iterator[None]:
    """Turn signals such as Ctrl-C into messages, so that they come only where the study waits.

    An exception elsewhere could come between a run and its row on the disk, or in the start or the
    end of a process. Only the main thread receives signals. The last handler runs at the end.
    """
    received: list[int] = []

    def receive(number: int, frame: object) -> None:
        received.append(number)
        put(KeyboardInterrupt())

    before: dict[int, Any] = {}
    if threading.current_thread() is threading.main_thread():
        handlers = {number: signal.getsignal(number) for number in _SIGNALS}
        before = {number: own for number, own in handlers.items() if callable(own)}
    for number in before:
        signal.signal(number, receive)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if received:
            before[received[0]](received[0], None)
