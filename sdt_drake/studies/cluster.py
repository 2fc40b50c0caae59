"""Running rows on the workers of a Dask cluster, which need only the package."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from functools import partial
from typing import TYPE_CHECKING, Any

from sdt_drake.io.errors import InputError, needing, one_line
from sdt_drake.io.versions import other_versions, versions
from sdt_drake.studies.fields import Value
from sdt_drake.studies.pool import Pool
from sdt_drake.studies.table import Row

with needing("--cluster needs Dask", "sdt_drake[cluster]"):
    from distributed import Client, TimeoutError
    from distributed.comm.addressing import get_address_host_port

if TYPE_CHECKING:
    from sdt_drake.studies.job import Job

_CONNECT = 10.0  # s
_ALONE = 60.0  # s; without any worker, until we give up
_LOOK = 1.0  # s; between two looks whether there are workers
_AHEAD = 4  # rows that are sent for each thread of the cluster: it never waits for us


class Cluster:
    """Threads of a Dask cluster, each with a process of its own as on one machine.

    Dask ends a task only with its worker, whose other threads lose theirs, and tries a task four
    times before it gives it up. What a worker had when it died, Dask gives to another.
    """

    def __init__(self, job: Job, address: str, put: Callable[[Exception], None]) -> None:
        """Connect to a cluster.

        Args:
            job: to run rows of.
            address: of the scheduler.
            put: takes the error if the cluster has had no workers for long.

        Raises:
            InputError: if the cluster cannot be reached, or it has no workers, or such with other
                versions.
        """
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
        self._closed = threading.Event()
        try:
            threads = sum(self._client.nthreads().values())
            if not threads:
                raise InputError("--cluster: has no workers, start some: dask worker ADDRESS")
            for worker, other in self._client.run(_other_versions, job).items():
                if other:
                    raise InputError(f"--cluster: worker {worker} {other}")
            # A task, not data: if the workers that have it die, Dask makes it anew.
            self._job = self._client.submit(_itself, job, pure=False)
        except Exception as error:
            self.close()
            raise _told(error) from None
        self.ahead = _AHEAD * threads
        threading.Thread(target=self._watch, args=(put,), daemon=True).start()

    def submit(self, number: int, inputs: Mapping[str, Value]) -> Future[Row]:
        """Run a row on one of the workers; it is an InputError if the cluster is lost."""
        row: Future[Row] = Future()
        running = self._client.submit(run_row, self._job, number, inputs, pure=False)
        running.add_done_callback(partial(_hand_over, row))
        return row

    def _watch(self, put: Callable[[Exception], None]) -> None:
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


def _hand_over(row: Future[Row], running: Any) -> None:
    """Give a row the result of its future of Dask."""
    try:
        row.set_result(running.result())
    except Exception as error:
        row.set_exception(_told(error))


def _told(error: Exception) -> InputError:
    """Errors of the cluster are bad input; what is done by then is kept."""
    if isinstance(error, InputError):
        return error
    return InputError(f"--cluster: lost ({_line(error)}); --resume goes on")


def _line(error: Exception) -> str:
    return one_line(error) or type(error).__name__


# --- on the cluster --------------------------------------------------------------------------

_here = threading.local()


def run_row(job: Job, number: int, inputs: Mapping[str, Value]) -> Row:
    """Run a row in the process of this thread, which stays for the next one.

    Raises:
        InputError: if this worker has other versions, or the process does not start.
    """
    if getattr(_here, "fingerprint", None) != job.fingerprint:
        if other := _other_versions(job):
            raise InputError(f"--cluster: a worker that joined {other}")
        if hasattr(_here, "pool"):
            _here.pool.close()
        _here.pool, _here.fingerprint = Pool(job), job.fingerprint
    return _here.pool.submit(number, inputs).result()


def _other_versions(job: Job) -> str:
    """Rows are the same everywhere only with the same versions everywhere."""
    other = other_versions(versions(), job.versions)
    return f"has {other}; expected the versions here" if other else ""


def _itself(job: Job) -> Job:
    return job
