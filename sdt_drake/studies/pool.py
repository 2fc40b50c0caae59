"""Processes on this machine that run rows: one that hangs or dies costs its own row."""

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
from sdt_drake.studies.fields import Value
from sdt_drake.studies.table import Row

with needing("studies need pebble", "sdt_drake[study]"):
    from pebble import ProcessExpired, ProcessPool

if TYPE_CHECKING:
    from sdt_drake.studies.job import Job
    from sdt_drake.studies.runs import Runner

_IDLE = 60  # s; after which a process without rows ends
_PER_PROCESSOR = 8  # processes; more would but need memory
_MOST_ROWS = 50  # of a process: Drake never frees a diagram of Python classes, 9 MB for each run
_LEAVING = 0.2  # s; between the end of the pipe and that of the main process
_TRIES = 2  # before a row that ends its process is given up, or a pool that does not start


class Pool:
    """Processes that run rows of a job, in a folder of their own."""

    def __init__(self, job: Job, count: int = 1) -> None:
        """Make a pool of `count` processes; none is started yet.

        Raises:
            InputError: if there are more processes than the machine bears.
        """
        most = _PER_PROCESSOR * (os.cpu_count() or 1)
        if not 1 <= count <= most:
            expected = f"expected a whole number >= 1, at most {most} on this machine"
            raise InputError(f"--workers: {count}, {expected}")
        self.ahead = 2 * count  # rows that keep all processes busy
        self._job, self._count = job, count
        self._folder = Path(tempfile.mkdtemp(prefix="sdt-drake-"))
        self._pools: list[ProcessPool] = []  # the last one, and those that broke
        self._lock = threading.Lock()
        self.close = util.Finalize(None, self._close, exitpriority=1)  # at exit, or earlier

    def submit(self, number: int, inputs: Mapping[str, Value]) -> Future[Row]:
        """Run a row in one of the processes.

        A row that ends its process is run once more; if that ends, too, it is "crashed". One that
        takes longer than the study allows is "timed_out".

        Returns:
            The row; or an InputError, if the processes do not even start.
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
                        "workers: a process that should run the study did not start"
                        f"{self._last_words('*')}; a script of your own needs "
                        "if __name__ == '__main__'"
                    )
                )
            else:
                words = self._last_words(error.pid) if isinstance(error, ProcessExpired) else ""
                reason = f"the process that ran it ended {_TRIES} times{words}"
                row.set_result(Row(number, "crashed", reason, 0.0, ()))

        self._running().schedule(_run, [number, inputs], timeout=timeout).add_done_callback(done)

    def _running(self) -> ProcessPool:
        """Get the pool of processes, a new one if the last one broke."""
        with self._lock:
            if not (self._pools and self._pools[-1].active):
                self._pools.append(self._started())
            return self._pools[-1]

    def _started(self) -> ProcessPool:
        # The workers of Dask may have no children; ours end with them.
        multiprocessing.current_process().daemon = False
        pool = ProcessPool(
            max_workers=self._count,
            max_tasks=_MOST_ROWS,
            initializer=_begin,
            initargs=(self._job, self._folder),
            context=multiprocessing.get_context("spawn"),
        )
        resource_tracker.ensure_running()  # later it would unblock what is blocked here
        # What is started here inherits this: Ctrl-C is for the main process.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            pool.active  # noqa: B018  # starts it
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        return pool

    def _last_words(self, process: int | str) -> str:
        """Get what a process, or any ("*"), said last, in brackets; "" if it said nothing."""
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
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # at once, in the middle of Drake's steps too
    parent = multiprocessing.parent_process()
    assert parent is not None
    if not parent.is_alive():  # it takes a second to get here
        _end_with_parent(parent, folder)
    for descriptor, file in ((1, os.devnull), (2, folder / f"{os.getpid()}.log")):
        with open(file, "ab") as target:
            os.dup2(target.fileno(), descriptor)
    logging.getLogger("drake").addFilter(lambda record: False)  # it also logs what it raises
    _runner = job.runner(folder)
    watching = threading.Thread(target=_end_with_parent, args=(parent, folder), daemon=True)
    watching.start()
    util.Finalize(None, _leave, [parent, watching], exitpriority=0)


def _leave(parent: BaseProcess, watching: threading.Thread) -> None:
    """Let what tidies up finish where the end of the main process, and of its pipe, is why this one
    ends; it may also have run its rows."""
    parent.join(_LEAVING)
    if not parent.is_alive():
        watching.join()


def _end_with_parent(parent: BaseProcess, folder: Path) -> None:
    parent.join()
    shutil.rmtree(folder, ignore_errors=True)
    os._exit(1)


def _run(number: int, inputs: Mapping[str, Value]) -> Row:
    signal.alarm(0)
    row = _runner.run(number, inputs)
    signal.alarm(_IDLE)  # ends the process, if nobody wants another row
    return row
