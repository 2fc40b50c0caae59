"""Running a study into its folder, from the start or from where it was interrupted."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any

import numpy as np

from sdt_drake.studies.folder import claim, save_study
from sdt_drake.studies.job import Job
from sdt_drake.studies.journal import Journal
from sdt_drake.studies.results import require_packages, write_results

if TYPE_CHECKING:
    from sdt_drake.studies.cluster import Cluster
    from sdt_drake.studies.workers import Workers

ReportRuns = Callable[[int, int, int], None]
"""Called with the numbers of runs that are done now, were done before, and are wanted."""

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Inbox:
    """Where a study waits: for rows, for errors, and for Ctrl-C, which comes nowhere else.

    Elsewhere it would come between a run and its line on the disk, or into the start or the end of
    a process, or into a library that does not expect it. In threads other than the main one, which
    Python gives no signals, it is a queue.
    """

    def __init__(self) -> None:
        self._messages: SimpleQueue[object] = SimpleQueue()
        self._handlers: dict[int, Any] = {}
        self._number: int | None = None  # of the signal that came
        self.put = self._messages.put

    def __enter__(self) -> Inbox:
        if threading.current_thread() is threading.main_thread():
            for number in _SIGNALS:
                if callable(signal.getsignal(number)):  # what is ignored stays so
                    self._handlers[number] = signal.signal(number, self._on_signal)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._handlers.items():
            signal.signal(number, handler)
        if self._number is not None:
            self._handlers[self._number](self._number, None)

    def _on_signal(self, number: int, frame: object) -> None:
        self._number = self._number or number
        self.put(KeyboardInterrupt())

    def get(self) -> Any:
        """The next message; raised if it is an exception."""
        message = self._messages.get()
        if isinstance(message, BaseException):
            raise message
        return message

    def result_of(self, function: Callable[[], Any]) -> Any:
        """What a function returns or raises, run in a thread, where no signal disturbs it."""

        def run() -> None:
            try:
                self.put(function())
            except Exception as error:
                self.put(error)

        threading.Thread(target=run, daemon=True).start()
        return self.get()


def run_study(
    job: Job,
    folder: Path,
    *,
    workers: int = 1,
    cluster: str | None = None,
    resume: bool = False,
    report: ReportRuns = lambda done, before, count: None,
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
    require_packages()
    with (
        Inbox() as inbox,
        closing(inbox.result_of(lambda: _backend(job, workers, cluster))) as backend,
    ):
        claim(job, folder, resume)
        with Journal(folder, len(job.study), len(job.outcomes)) as journal:
            save_study(job, folder)
            missing = np.flatnonzero(~journal.done).tolist()
            before = len(job.study) - len(missing)
            report(before, before, len(job.study))
            backend.start(missing, inbox.put)
            for done in range(before + 1, len(job.study) + 1):
                journal.append(inbox.get())
                report(done, before, len(job.study))
            return write_results(job, journal.rows(), folder)


def _backend(job: Job, workers: int, cluster: str | None) -> Workers | Cluster:
    if cluster is None:
        from sdt_drake.studies.workers import Workers

        return Workers(job, workers)
    from sdt_drake.studies.cluster import Cluster

    return Cluster(job, cluster)
