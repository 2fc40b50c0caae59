"""Processes that run rows, each on its own: one may hang or die, and the study goes on."""

from __future__ import annotations

import logging
import multiprocessing
import os
import shutil
import signal
import tempfile
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, TimeoutError, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import resource_tracker, util
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pebble import ProcessPool

from sdt_drake.io.errors import InputError
from sdt_drake.studies.journal import Row

if TYPE_CHECKING:
    from sdt_drake.studies.job import Job
    from sdt_drake.studies.runs import Runner

_START = 120.0  # s; for a process to import all that it needs
_IDLE = 60  # s; after which a process without rows ends
_PER_PROCESSOR = 8  # processes; more would but need memory
_MOST_ROWS = 50  # of a process: Drake never frees a diagram of Python classes, 9 MB for each run
_TRIES = 2  # before a row that ends its process is given up, or a process that does not start


class Worker:
    """Runs rows of a job in a process, one at a time; in a new one if that has died."""

    def __init__(self, job: Job, stopping: Future[Any] | None = None) -> None:
        """For a job; `stopping`, once it is done, ends the waiting for a row."""
        self._job = job
        self._stopping = Future() if stopping is None else stopping
        self._folder = tempfile.TemporaryDirectory(prefix="sdt-drake-")
        self._pool: ProcessPool | None = None
        self._rows = 0  # that the process has begun
        self.close = util.Finalize(None, self._close, exitpriority=1)  # at exit, or earlier

    def run(self, number: int) -> Row | None:
        """What becomes of a row; None if it was stopped.

        A row that ends its process is run once more; if that ends, too, it is "crashed". One that
        takes longer than the study allows is "timed_out".

        Raises:
            InputError: if the process does not even start.
        """
        timeout = self._job.study.timeout
        longest = min(_START + timeout, threading.TIMEOUT_MAX)
        deaths = failed_starts = 0
        while True:
            running = self._schedule(number, timeout)
            wait([running, self._stopping], longest, FIRST_COMPLETED)
            if self._stopping.done():
                return None
            error = running.exception() if running.done() else BrokenProcessPool()
            if error is None:
                return running.result()
            if isinstance(error, TimeoutError):
                return Row(number, "timed_out", f"not done after {timeout:g} s", float(timeout), ())
            words = self._last_words()
            if isinstance(error, BrokenProcessPool):
                failed_starts += 1
                self._end()
            else:
                deaths += 1
            if failed_starts == _TRIES:
                raise InputError(
                    f"workers: a process that should run the study did not start{words}; a script "
                    "of your own needs if __name__ == '__main__'"
                )
            if deaths == _TRIES:
                reason = f"the process that ran it ended {_TRIES} times{words}"
                return Row(number, "crashed", reason, 0.0, ())

    def _schedule(self, number: int, timeout: float) -> Future[Row]:
        if self._pool is None or not self._pool.active or self._rows == _MOST_ROWS:
            self._end()
            self._rows = 0
            # The workers of Dask may have no children; ours end with them.
            multiprocessing.current_process().daemon = False
            self._pool = ProcessPool(
                max_workers=1,
                initializer=_begin,
                initargs=(self._job, self._folder.name),
                context=multiprocessing.get_context("spawn"),
            )
        self._rows += 1
        resource_tracker.ensure_running()  # later it would unblock what is blocked here
        # What is started here inherits this: Ctrl-C is for the main process.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            return self._pool.schedule(_run, [number], timeout=timeout)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def _last_words(self) -> str:
        """What the process said last, in brackets; "" if it said nothing."""
        log = _log_in(self._folder.name)
        text = log.read_text(errors="replace").strip() if log.exists() else ""
        log.write_text("")
        return f" ({text.splitlines()[-1].strip()})" if text else ""

    def _end(self) -> None:
        if self._pool is not None:
            self._pool.stop()
            self._pool.join()
            self._pool = None

    def _close(self) -> None:
        self._end()
        self._folder.cleanup()


class Workers:
    """Processes on this machine, each with a thread here that waits for it."""

    def __init__(self, job: Job, count: int) -> None:
        """For a job; nothing is started yet.

        Raises:
            InputError: if there are more processes than the machine bears.
        """
        most = _PER_PROCESSOR * (os.cpu_count() or 1)
        if not 1 <= count <= most:
            expected = f"expected a whole number >= 1, at most {most} on this machine"
            raise InputError(f"--workers: {count}, {expected}")
        self._job, self._count = job, count
        self._stopping: Future[Any] = Future()
        self._threads: list[threading.Thread] = []

    def start(self, numbers: Sequence[int], put: Callable[[object], None]) -> None:
        """Begin to run rows; `put` takes what becomes of each, or the error that ends it all."""
        coming = iter(numbers)
        for _ in range(min(self._count, len(numbers))):
            thread = threading.Thread(target=self._work, args=(coming, put), daemon=True)
            thread.start()
            self._threads.append(thread)

    def _work(self, coming: Iterator[int], put: Callable[[object], None]) -> None:
        worker = Worker(self._job, self._stopping)
        try:
            for number in coming:
                row = worker.run(number)
                if row is None:
                    return
                put(row)
        except Exception as error:
            put(error)
        finally:
            worker.close()

    def close(self) -> None:
        """End the processes, whatever they do."""
        self._stopping.set_result(None)
        for thread in self._threads:
            thread.join()


# --- in the process --------------------------------------------------------------------------

_runner: Runner


def _begin(job: Job, folder: str) -> None:
    global _runner
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # at once, in the middle of Drake's steps too
    parent = multiprocessing.parent_process()
    if parent is None or not parent.is_alive():  # it takes a second to get here
        _end_with_parent(folder)
    for descriptor, file in ((1, os.devnull), (2, _log_in(folder))):
        with open(file, "ab") as target:
            os.dup2(target.fileno(), descriptor)
    logging.getLogger("drake").addFilter(lambda record: False)  # it also logs what it raises
    _runner = job.runner(Path(folder))
    watching = threading.Thread(target=_end_with_parent, args=(folder,), daemon=True)
    watching.start()
    # The end of its pipe lets the main thread leave, too, which must not cut that short.
    util.Finalize(None, watching.join, exitpriority=0)


def _log_in(folder: str) -> Path:
    return Path(folder) / "log"


def _end_with_parent(folder: str) -> None:
    if parent := multiprocessing.parent_process():
        parent.join()
    shutil.rmtree(folder, ignore_errors=True)
    os._exit(1)


def _run(number: int) -> Row:
    signal.alarm(0)
    row = _runner.run(number)
    signal.alarm(_IDLE)  # ends the process, if nobody wants another row
    return row
