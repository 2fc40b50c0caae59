"""Running rows on the workers of a Dask cluster, which need only the package."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence
from itertools import islice
from typing import TYPE_CHECKING

from sdt_drake.io.errors import InputError, needing, one_line
from sdt_drake.io.versions import other_versions, versions
from sdt_drake.studies.journal import Row
from sdt_drake.studies.workers import Worker

if TYPE_CHECKING:
    from distributed import Future

    from sdt_drake.studies.job import Job

_CONNECT = 10.0  # s
_ALONE = 60.0  # s; without any worker, until we give up
_LOOK = 1.0  # s; between two looks whether there are workers
_AHEAD = 4  # rows that are sent for each thread of the cluster: it never waits for us


class Cluster:
    """Threads of a Dask cluster, each with a process of its own as on one machine.

    So a run that hangs is ended there, and the thread goes on with the next one. What a worker of
    the cluster had when it died, Dask gives to another.
    """

    def __init__(self, job: Job, address: str) -> None:
        """Connect, in a thread that gets no signals, which would break off the waiting of Dask.

        Args:
            job: to run rows of.
            address: of the scheduler.

        Raises:
            InputError: if distributed is not installed, the cluster cannot be reached, or it has no
                workers, or such with other versions.
        """
        with needing("--cluster needs Dask", "sdt_drake[cluster]"):
            from distributed import Client
            from distributed.comm.addressing import get_address_host_port
        for name in [*logging.root.manager.loggerDict]:
            if name.split(".")[0] in ("distributed", "tornado"):  # our own errors say it
                logging.getLogger(name).setLevel(logging.CRITICAL)
        try:
            get_address_host_port(address, strict=True)  # Client itself leaves threads behind
            self._client = Client(address, timeout=_CONNECT, set_as_default=False)
        except (OSError, ValueError, TypeError, ImportError) as error:
            raise InputError(
                f"--cluster {address}: cannot be reached ({_line(error)}), expected the address of "
                "a Dask scheduler, tcp://HOST:8786"
            ) from None
        self._job, self._closed = job, threading.Event()
        try:
            self._threads = sum(self._client.nthreads().values())
            if not self._threads:
                raise InputError("--cluster: has no workers, start some: dask worker ADDRESS")
            for worker, other in self._client.run(_other_versions, job).items():
                if other:
                    raise InputError(f"--cluster: worker {worker} {other}")
        except Exception as error:
            self.close()
            raise _told(error) from None

    def start(self, numbers: Sequence[int], put: Callable[[object], None]) -> None:
        """Begin to run rows; `put` takes what becomes of each, or the error that ends it all."""
        coming = iter(numbers)
        # A task, not data: if the workers that have it die, Dask makes it anew.
        job = self._client.submit(_itself, self._job, pure=False)

        def submit(count: int) -> None:
            for number in islice(coming, count):
                future = self._client.submit(run_row, job, number, pure=False)
                future.add_done_callback(done)

        def done(future: Future[Row]) -> None:  # in a thread of Dask
            if self._closed.is_set():
                return
            try:
                put(future.result())
                submit(1)
            except Exception as error:
                put(_told(error))

        submit(_AHEAD * self._threads)
        threading.Thread(target=self._watch, args=(put,), daemon=True).start()

    def _watch(self, put: Callable[[object], None]) -> None:
        from distributed import TimeoutError

        while not self._closed.wait(_LOOK):
            try:
                self._client.wait_for_workers(1, _ALONE)
            except TimeoutError:
                put(InputError(f"--cluster: has had no workers for {_ALONE:g} s; --resume goes on"))
            except Exception as error:
                put(_told(error))

    def close(self) -> None:
        """Leave the cluster; rows that run there are not wanted any more."""
        self._closed.set()
        self._client.close()


def _told(error: Exception) -> InputError:
    """Errors of the cluster are bad input; what is done by then is kept."""
    if isinstance(error, InputError):
        return error
    return InputError(f"--cluster: lost ({_line(error)}); --resume goes on")


def _line(error: Exception) -> str:
    return one_line(error) or type(error).__name__


# --- on the cluster --------------------------------------------------------------------------

_here = threading.local()


def run_row(job: Job, number: int) -> Row:
    """Run a row in the process of this thread, which stays for the next one.

    Raises:
        InputError: if this worker has other versions, or the process does not start.
    """
    if getattr(_here, "fingerprint", None) != job.fingerprint:
        if other := _other_versions(job):
            raise InputError(f"--cluster: a worker that joined {other}")
        if hasattr(_here, "worker"):
            _here.worker.close()
        _here.worker, _here.fingerprint = Worker(job), job.fingerprint
    return _here.worker.run(number)


def _other_versions(job: Job) -> str:
    """Rows are the same everywhere only with the same versions everywhere."""
    other = other_versions(versions(), job.versions)
    return f"has {other}; expected the versions here" if other else ""


def _itself(job: Job) -> Job:
    return job
