"""Processes on this machine that run rows. A process that hangs or dies costs only its row."""

from __future__ import annotations

import logging
import multiprocessing
import os
import shutil
import signal
import tempfile
import threading
from collections.abc import Mapping
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import resource_tracker, util
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import TYPE_CHECKING

from sdt_drake.io.errors import InputError, needing
from sdt_drake.studies.table import Row, Value

with needing("studies need pebble", "sdt_drake[study]"):
    from pebble import ProcessExpired, ProcessPool

if TYPE_CHECKING:
    from sdt_drake.studies.job import Job
    from sdt_drake.studies.runs import Runner

_IDLE_TIMEOUT = 60  # s; a process without rows ends after this time
_MAX_PER_PROCESSOR = 8  # processes; more of them would only need memory
_MAX_ROWS = 50  # per process, which grows by 1 MB a row; by 9 MB with diagrams of Python classes
_PARENT_TIMEOUT = 0.2  # s; the main process ends within it after its pipe has closed
_TRIES = 2  # runs of a row whose process ends, or starts of a pool that breaks


class Pool:
    """A pool of processes that run rows of a job, with a temporary folder of its own."""

    def __init__(self, job: Job, count: int = 1) -> None:
        """Make a pool of `count` processes. They start with the first row.

        Raises:
            InputError: for more than 8 processes per processor.
        """
        most = _MAX_PER_PROCESSOR * (os.cpu_count() or 1)
        if not 1 <= count <= most:
            expected = f"expected a whole number >= 1, at most {most} on this machine"
            raise InputError(f"{count}, {expected}", place="workers")
        self.ahead = 2 * count  # rows that keep all processes busy
        self._job, self._count = job, count
        self._folder = Path(tempfile.mkdtemp(prefix="sdt-drake-"))
        self._pools: list[ProcessPool] = []  # the current one is last, after broken ones
        self._lock = threading.Lock()
        self.close = util.Finalize(None, self._close, exitpriority=1)  # at exit, or earlier

    def submit(self, number: int, inputs: Mapping[str, Value]) -> Future[Row]:
        """Run a row in one of the processes.

        A row whose process dies is run once more. If that process dies too, the row is "crashed".
        A row that takes longer than the study's time-out is "timed_out".

        Returns:
            Future of the row; its result is an InputError if no process can be started.
        """
        row: Future[Row] = Future()
        self._try(row, number, inputs, _TRIES)
        return row

    def _try(self, row: Future[Row], number: int, inputs: Mapping[str, Value], tries: int) -> None:
        timeout = self._job.study.timeout

        def done(running: Future[Row]) -> None:
            error = running.exception()
            if error is None:
                row.set_result(running.result())
            elif isinstance(error, TimeoutError):
                reason = f"not done after {timeout:g} s"
                row.set_result(Row(number, "timed_out", reason, float(timeout), ()))
            elif tries > 1:
                self._try(row, number, inputs, tries - 1)
            elif isinstance(error, BrokenProcessPool):
                row.set_exception(
                    InputError(
                        f"workers: a process of the study did not start{self._last_line('*')}; "
                        "in a script of your own, run the study below if __name__ == '__main__'"
                    )
                )
            else:
                line = self._last_line(error.pid) if isinstance(error, ProcessExpired) else ""
                reason = f"its process ended {_TRIES} times{line}"
                row.set_result(Row(number, "crashed", reason, 0.0, ()))

        self._running().schedule(_run, [number, inputs], timeout=timeout).add_done_callback(done)

    def _running(self) -> ProcessPool:
        """Return the current pool of processes; start a new one if the last one broke."""
        with self._lock:
            if not (self._pools and self._pools[-1].active):
                self._pools.append(self._started())
            return self._pools[-1]

    def _started(self) -> ProcessPool:
        """Start a pool of processes, which ignore Ctrl-C: the main process handles it."""
        # Workers of Dask are daemons, which may not start processes.
        multiprocessing.current_process().daemon = False
        pool = ProcessPool(
            max_workers=self._count,
            max_tasks=_MAX_ROWS,
            initializer=_begin,
            initargs=(self._job, self._folder),
            context=multiprocessing.get_context("spawn"),
        )
        resource_tracker.ensure_running()  # it unblocks signals, which are blocked from here on
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # inherited
        try:
            pool.active  # noqa: B018  # this property starts the pool
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        return pool

    def _last_line(self, process: int | str) -> str:
        """Return the last error line of a process, or of any ("*"), in brackets; "" if none."""
        texts = (log.read_text(errors="replace") for log in self._folder.glob(f"{process}.log"))
        lines = "\n".join(texts).split("\n")
        return next((f" ({line.strip()})" for line in reversed(lines) if line.strip()), "")

    def _close(self) -> None:
        for pool in self._pools:
            pool.stop()
            pool.join()
        shutil.rmtree(self._folder, ignore_errors=True)


# --- in the process --------------------------------------------------------------------------

_runner: Runner


def _begin(job: Job, folder: Path) -> None:
    global _runner
    """Prepare a process for rows: redirect its output, and end it when the main process ends."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # ends the process even within a step of Drake
    parent = multiprocessing.parent_process()
    assert parent is not None
    if not parent.is_alive():  # it may have ended while this process started
        _end_with_parent(parent, folder)
    for descriptor, file in ((1, os.devnull), (2, folder / f"{os.getpid()}.log")):
        with open(file, "ab") as target:
            os.dup2(target.fileno(), descriptor)
    logging.getLogger("drake").addFilter(lambda record: False)  # Drake raises what it logs
    _runner = job.runner(folder)
    watching = threading.Thread(target=_end_with_parent, args=(parent, folder), daemon=True)
    watching.start()
    util.Finalize(None, _leave, [parent, watching], exitpriority=0)


def _leave(parent: BaseProcess, watching: threading.Thread) -> None:
    """Wait for the thread that removes the folder, if this process ends with the main process."""
    parent.join(_PARENT_TIMEOUT)
    if not parent.is_alive():
        watching.join()


def _end_with_parent(parent: BaseProcess, folder: Path) -> None:
    """Wait for the end of the main process, remove the pool's folder and end this process."""
    parent.join()
    shutil.rmtree(folder, ignore_errors=True)
    os._exit(1)


def _run(number: int, inputs: Mapping[str, Value]) -> Row:
    """Run a row. Afterwards an alarm ends the process unless another row comes in time."""
    signal.alarm(0)
    row = _runner.run(number, inputs)
    signal.alarm(_IDLE_TIMEOUT)
    return row
