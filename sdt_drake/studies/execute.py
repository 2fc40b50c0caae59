"""Running a study into its folder, from the start or from where it was interrupted."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from itertools import islice
from pathlib import Path
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any

from sdt_drake.studies.folder import opened
from sdt_drake.studies.job import Job
from sdt_drake.studies.results import write_results

if TYPE_CHECKING:
    from sdt_drake.studies.cluster import Cluster
    from sdt_drake.studies.pool import Pool

ReportRuns = Callable[[int, int, int], None]
"""Called with the numbers of runs that are done now, were done before, and are wanted."""

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
    """Run the rows of a study that its folder does not have yet, and write its results.

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
    study, inbox = job.study, SimpleQueue[Any]()
    backend = _backend(job, workers, cluster, inbox.put)
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


def _backend(
    job: Job, workers: int, cluster: str | None, put: Callable[[Exception], None]
) -> Pool | Cluster:
    """Make what takes rows by `submit(number, inputs)`, and gives a future of each."""
    if cluster is None:
        from sdt_drake.studies.pool import Pool

        return Pool(job, workers)
    from sdt_drake.studies.cluster import Cluster

    return Cluster(job, cluster, put)


@contextmanager
def _signals_into(put: Callable[[KeyboardInterrupt], None]) -> Iterator[None]:
    """Make Ctrl-C a message: it comes where the study waits for one, and nowhere else.

    Elsewhere it would come between a run and its row on the disk, or into the start or the end of
    a process, or into a library that does not expect it. Only the main thread gets signals.
    """
    heard: list[int] = []

    def hear(number: int, frame: object) -> None:
        heard.append(number)
        put(KeyboardInterrupt())

    before: dict[int, Any] = {}
    if threading.current_thread() is threading.main_thread():
        handlers = {number: signal.getsignal(number) for number in _SIGNALS}
        before = {number: own for number, own in handlers.items() if callable(own)}
    for number in before:
        signal.signal(number, hear)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if heard:
            before[heard[0]](heard[0], None)
