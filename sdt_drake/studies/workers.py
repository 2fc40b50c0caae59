"""Processes that run rows, each on its own: one may hang or die, and the study goes on.

A worker is a Python of its own, not a fork and not an import of the main script: so it works from
notebooks, from threads, and in processes that may have no children of multiprocessing.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter, deque
from collections.abc import Iterable, Iterator, Sequence
from multiprocessing import Pipe
from multiprocessing.connection import wait
from pathlib import Path

from sdt_drake.errors import InputError, checked_count
from sdt_drake.studies.interrupts import Waiting
from sdt_drake.studies.job import Job
from sdt_drake.studies.runs import Row

Task = Sequence[int]
"""Numbers of the rows that go to a process together."""

READY = "ready"
_PACKAGES = Path(__file__).parents[2]
# Not from the folder that we were started in: what is there may be called like any module.
_MAIN = f"""\
import sys
sys.path[:] = [*filter(None, sys.path), {str(_PACKAGES)!r}]
from sdt_drake.studies.worker import main
main()"""
_START = 120.0  # s; for a process to import all that it needs
_LONGEST_WAIT = 3600.0  # s; the system counts ms in 32 bits
_PER_PROCESSOR = 8  # processes; more would but need memory
_MOST_ROWS = 50  # of a process: Drake never frees a diagram of Python classes, 9 MB for each run
_TRIES = 2  # before a row that ends its process is given up, or a process that does not start


class Pool:
    """Processes that run tasks of a job."""

    def __init__(self, job: Job, count: int, waiting: Waiting = contextlib.nullcontext) -> None:
        """For a job; nothing is started yet.

        Args:
            job: to run rows of.
            count: of the processes.
            waiting: makes the context in which `map` waits.

        Raises:
            InputError: if there are more processes than the machine bears.
        """
        most = _PER_PROCESSOR * (os.cpu_count() or 1)
        if checked_count(count, "--workers") > most:
            raise InputError(f"--workers: {count}, expected at most {most} on this machine")
        self._workers = [_Worker(job) for _ in range(count)]
        self._timeout, self._waiting = job.study.timeout, waiting

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the processes, whatever they do."""
        for worker in self._workers:
            worker.stop()

    @property
    def processes(self) -> list[int]:
        """Their numbers; of those that were started."""
        return [worker.process.pid for worker in self._workers if worker.process is not None]

    def map(self, tasks: Iterable[Task]) -> Iterator[list[Row]]:
        """Rows of the tasks, as they finish.

        A task whose process dies is run once more, row by row; what then still ends its process is
        "crashed". So is a task that takes too long, whose late row is "timed_out".

        Raises:
            InputError: if a process does not even start.
        """
        coming, again = iter(tasks), deque[Task]()
        deaths: Counter[int] = Counter()
        while True:
            for worker in self._workers:
                if not worker.task:
                    worker.begin(again.popleft() if again else next(coming, ()), self._timeout)
            busy = [worker for worker in self._workers if worker.task]
            if not busy:
                return
            with self._waiting():
                left = min(_LONGEST_WAIT, *(worker.left for worker in busy))
                wait([worker.connection for worker in busy], timeout=max(0.0, left))
            for worker in busy:
                task, message = worker.task, worker.message()
                if isinstance(message, list):
                    yield message
                elif message is not None and len(task) > 1:
                    again.extend([number] for number in task)
                elif message == "timed_out":
                    reason = f"not done after {self._timeout:g} s"
                    yield [Row(task[0], message, reason, float(self._timeout), ())]
                elif message == "crashed":
                    deaths[task[0]] += 1
                    if deaths[task[0]] < _TRIES:
                        again.append(task)
                    else:
                        reason = f"the process that ran it ended {_TRIES} times{worker.last_words}"
                        yield [Row(task[0], message, reason, 0.0, ())]


class _Worker:
    """A process with its task; a new process if that one died."""

    def __init__(self, job: Job) -> None:
        self._job, self._timeout, self._deadline = job, 0.0, 0.0
        self._has_job = self._ready = False
        self._failed_starts = self._rows = 0  # one after another; of this process
        self.last_words = ""  # of a process that ended
        self._folder: tempfile.TemporaryDirectory | None = None
        self.process: subprocess.Popen | None = None
        self.task: Task = ()

    def begin(self, task: Task, timeout: float) -> None:
        """Take a task; it has `timeout` for each row [s]."""
        if self._rows >= _MOST_ROWS:
            self.stop()
        self.task, self._timeout = task, timeout * len(task)
        if not task:
            return
        if self.process is None:
            self._start()
        if self._ready:
            self._send()

    def _start(self) -> None:
        self._rows = 0
        self._folder = tempfile.TemporaryDirectory(prefix="sdt-drake-")
        self.connection, theirs = Pipe()
        with theirs, self._log.open("wb") as log:
            self.process = subprocess.Popen(
                [sys.executable, "-c", _MAIN, str(theirs.fileno()), self._folder.name],
                pass_fds=[theirs.fileno()],
                stdin=subprocess.PIPE,  # closes when this process ends, however that happens
                stdout=subprocess.DEVNULL,
                stderr=log,
                start_new_session=True,  # Ctrl-C is for this process
            )
        self._deadline = time.monotonic() + _START

    def _send(self) -> None:
        self._deadline = time.monotonic() + self._timeout
        self._post(list(self.task))

    def _post(self, message: object) -> None:
        with contextlib.suppress(OSError):  # it is dead, as `message` will find
            self.connection.send(message)

    @property
    def left(self) -> float:
        """Until it is given up [s]."""
        return self._deadline - time.monotonic()

    def message(self) -> list[Row] | str | None:
        """Rows of its task, "timed_out", "crashed", or None if there is nothing yet."""
        if not self.connection.poll():
            if self.left > 0:
                return None
            return self._lost("timed_out")
        try:
            message = self.connection.recv()
        except (EOFError, OSError):
            return self._lost("crashed")
        if message == READY:
            self._go_on()
            return None
        self.task = ()
        self._rows += len(message)
        return message

    def _go_on(self) -> None:
        """A process that has imported all gets the job, and then tasks."""
        if self._has_job:
            self._ready, self._failed_starts = True, 0
            self._send()
        else:
            self._has_job = True
            self._post(self._job)

    def _lost(self, why: str) -> str | None:
        task, started = self.task, self._ready
        self.last_words = _last_line(self._log)
        self.stop()
        if started:
            return why
        self._failed_starts += 1
        if self._failed_starts == _TRIES:
            raise InputError(
                f"workers: a process that should run the study did not start{self.last_words}"
            )
        self.task = task
        self._start()
        return None

    @property
    def _log(self) -> Path:
        return Path(self._folder.name) / "log"

    def stop(self) -> None:
        """End the process, whatever it does."""
        self.task, self._has_job, self._ready = (), False, False
        if self.process is not None:
            self.process.kill()
            self.process.wait()
            self.process.stdin.close()
            self.connection.close()
            self._folder.cleanup()
            self.process = None


def _last_line(log: Path) -> str:
    """What a process said last, in brackets; "" if it said nothing."""
    with contextlib.suppress(OSError):
        lines = [line.strip() for line in log.read_text(errors="replace").splitlines()]
        return next((f" ({line})" for line in reversed(lines) if line), "")
    return ""
