"""Run rows of a study on the workers of a Dask cluster. Workers need only the package."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from copy import copy
from functools import partial
from typing import TYPE_CHECKING, Any

from sdt_drake.io.errors import InputError, needing, one_line
from sdt_drake.io.versions import other_versions, versions
from sdt_drake.studies.pool import Pool
from sdt_drake.studies.table import Row, Value

with needing("cluster: needs Dask", "sdt_drake[cluster]"):
    from distributed import Client, TimeoutError
    from distributed.comm.addressing import get_address_host_port

if TYPE_CHECKING:
    from sdt_drake.studies.job import Job

_CONNECT_TIMEOUT = 10.0  # s
_NO_WORKERS_TIMEOUT = 60.0  # s; the study is given up after this time without workers
_WATCH_PERIOD = 1.0  # s; between two checks for workers
_ROWS_PER_THREAD = 4  # rows sent ahead for each thread of the cluster, which so is never idle


class Cluster:
    """A Dask cluster that runs rows: each thread of a worker has a process of its own.

    The process is there because Dask can end a task only by ending its worker, with all threads.
    When a worker dies, Dask gives its tasks to another, at most four times each.
    """

    def __init__(self, job: Job, address: str, put: Callable[[Exception], None]) -> None:
        """Connect to a cluster.

        Args:
            job: the study whose rows are run.
            address: address of the Dask scheduler.
            put: receives an error when the cluster is lost or has no workers for a minute.

        Raises:
            InputError: if the cluster cannot be reached, has no workers, or a worker has other
                versions.
        """
        for name in [*logging.root.manager.loggerDict]:
            if name.split(".")[0] in ("distributed", "tornado"):  # InputErrors replace their logs
                logging.getLogger(name).setLevel(logging.CRITICAL)
        try:
            get_address_host_port(address, strict=True)  # a Client that fails leaves threads
            self._client = Client(address, timeout=_CONNECT_TIMEOUT, set_as_default=False)
        except (OSError, ValueError, TypeError, ImportError) as error:
            raise InputError(
                f"{address}: cannot be reached ({_line(error)}), expected the address of a Dask "
                "scheduler, tcp://HOST:8786",
                place="cluster",
            ) from None
        self._closed = threading.Event()
        try:
            threads = sum(self._client.nthreads().values())
            if not threads:
                text = f"has no workers; start one: dask worker {address}"
                raise InputError(text, place="cluster")
            for worker, other in self._client.run(_other_versions, job).items():
                if other:
                    raise InputError(f"worker {worker} {other}", place="cluster")
            # The job is a task's result, not data: if its workers die, Dask computes it again.
            self._job = self._client.submit(copy, job, pure=False)
        except Exception as error:
            self.close()
            raise _input_error(error) from None
        self.ahead = _ROWS_PER_THREAD * threads
        threading.Thread(target=self._watch, args=(put,), daemon=True).start()

    def submit(self, number: int, inputs: Mapping[str, Value]) -> Future[Row]:
        """Run a row on a worker and return its future: the row, or InputError without a cluster."""
        row: Future[Row] = Future()
        running = self._client.submit(run_row, self._job, number, inputs, pure=False)
        running.add_done_callback(partial(_hand_over, row))
        return row

    def _watch(self, put: Callable[[Exception], None]) -> None:
        """Pass an error to `put` when the cluster has no workers, or is lost."""
        while not self._closed.wait(_WATCH_PERIOD):
            try:
                self._client.wait_for_workers(1, _NO_WORKERS_TIMEOUT)
            except TimeoutError:
                since = f"no workers for {_NO_WORKERS_TIMEOUT:g} s"
                text = f"{since}; start some, then continue with resume=True"
                put(InputError(text, place="cluster"))
            except Exception as error:
                put(_input_error(error))

    def close(self) -> None:
        """Disconnect from the cluster, which then drops the rows that it runs."""
        self._closed.set()
        self._client.close()


def _hand_over(row: Future[Row], running: Any) -> None:
    """Copy the result of a Dask future to the row's own future."""
    try:
        row.set_result(running.result())
    except Exception as error:
        row.set_exception(_input_error(error))


def _input_error(error: Exception) -> InputError:
    """Return an error of the cluster as InputError."""
    if isinstance(error, InputError):
        return error
    text = f"connection lost ({_line(error)}); continue with resume=True"
    return InputError(text, place="cluster")


def _line(error: Exception) -> str:
    return one_line(error) or type(error).__name__


# --- on the cluster --------------------------------------------------------------------------

_here = threading.local()


def run_row(job: Job, number: int, inputs: Mapping[str, Value]) -> Row:
    """Run a row in this thread's process, which is kept for the next row.

    Raises:
        InputError: if this worker has other versions, or the process does not start.
    """
    if getattr(_here, "about", None) != job.about:
        if other := _other_versions(job):
            raise InputError(f"a worker that joined {other}", place="cluster")
        if hasattr(_here, "pool"):
            _here.pool.close()
        _here.pool, _here.about = Pool(job), job.about
    return _here.pool.submit(number, inputs).result()


def _other_versions(job: Job) -> str:
    """Return this worker's versions that differ from the job's; "" if none does."""
    other = other_versions(versions(), job.about.versions)
    return f"has {other}; install there the versions that are used here" if other else ""
