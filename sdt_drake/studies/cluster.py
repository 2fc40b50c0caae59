"""Running rows on the workers of a Dask cluster, which need only the package."""

from __future__ import annotations

import contextlib
import logging
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from itertools import islice

from sdt_drake.errors import InputError, needing
from sdt_drake.studies.interrupts import Waiting
from sdt_drake.studies.job import Job
from sdt_drake.studies.runs import Row
from sdt_drake.studies.workers import Pool, Task
from sdt_drake.versions import other_versions, versions

_CONNECT = 10.0  # s
_ALONE = 60.0  # s; without any worker, until we give up
_AHEAD = 4  # tasks that are sent for each thread of the cluster: it never waits for us
_IDLE = 60.0  # s; after which a thread without tasks ends its process


class Cluster:
    """Threads of a Dask cluster, each with a process of its own as on one machine.

    So a run that hangs is ended there, and the thread goes on with the next one. What a worker of
    the cluster had when it died, Dask gives to another.
    """

    def __init__(self, job: Job, address: str, waiting: Waiting = contextlib.nullcontext) -> None:
        """Connect.

        Args:
            job: to run rows of.
            address: of the scheduler.
            waiting: makes the context in which one waits for the cluster.

        Raises:
            InputError: if distributed is not installed, the cluster cannot be reached, or it has no
                workers, or such with other versions.
        """
        with needing("--cluster needs Dask", "sdt_drake[cluster]"):
            from distributed import Client
            from distributed.comm import get_address_host_port
        for name in ("distributed", "tornado"):  # whose waiting an interrupt breaks off
            logging.getLogger(name).setLevel(logging.CRITICAL)
        try:
            get_address_host_port(address, strict=True)  # Client itself leaves threads behind
            with waiting():
                self._client = Client(address, timeout=_CONNECT, set_as_default=False)
        except (OSError, ValueError, TypeError, ImportError) as error:
            reason = " ".join(str(error).split())
            raise InputError(
                f"--cluster {address}: cannot be reached ({reason}), expected the address of a "
                "Dask scheduler, tcp://HOST:8786"
            ) from None
        self._job, self._waiting = job, waiting
        try:
            with _connected(), waiting():
                self._threads = self._checked_threads()
        except BaseException:
            self._client.close()
            raise

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *_: object) -> None:
        self._client.close()

    def map(self, tasks: Iterable[Task]) -> Iterator[list[Row]]:
        """Rows of the tasks, as they finish.

        Raises:
            InputError: if the cluster is lost on the way.
        """
        coming = iter(tasks)
        with _connected():
            # A task, not data: if the workers that have it die, Dask makes it anew.
            job = self._client.submit(_itself, self._job, pure=False)

            def submit(task: Task):
                return self._client.submit(run_task, job, task, pure=False)

            running = {submit(task) for task in islice(coming, _AHEAD * self._threads)}
            while running:
                with self._waiting():
                    done = self._some(running)
                running -= done
                for future in done:
                    running |= {submit(task) for task in islice(coming, 1)}
                    yield future.result()

    def _some(self, running: set) -> set:
        """Those that are done, once there is one."""
        from distributed import TimeoutError, wait

        while True:
            with contextlib.suppress(TimeoutError), self._client.as_current():
                return wait(running, _ALONE, "FIRST_COMPLETED").done
            try:
                self._client.wait_for_workers(1, _ALONE)
            except TimeoutError:
                raise InputError(
                    f"--cluster: has had no workers for {_ALONE:g} s; --resume goes on"
                ) from None

    def _checked_threads(self) -> int:
        threads = sum(self._client.nthreads().values())
        if not threads:
            raise InputError("--cluster: has no workers, start some: dask worker ADDRESS")
        try:
            found = self._client.run(versions)
        except ImportError as error:
            raise InputError(f"--cluster: a worker lacks the package ({error})") from None
        for address, there in found.items():
            _check_versions(self._job, there, address)
        return threads


@contextmanager
def _connected() -> Iterator[None]:
    """Errors of the cluster within are bad input; what is done by then is kept."""
    from distributed import CancelledError, KilledWorker, TimeoutError
    from distributed.comm import CommClosedError

    try:
        yield
    except (CancelledError, KilledWorker, CommClosedError, TimeoutError, OSError) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"--cluster: lost ({reason}); --resume goes on") from None


def _check_versions(job: Job, there: dict[str, str], worker: str) -> None:
    """Rows are the same everywhere only with the same versions everywhere."""
    if other := other_versions(there, job.versions):
        raise InputError(f"--cluster: worker {worker} has {other}; expected the versions here")


def _itself(job: Job) -> Job:
    return job


_here = threading.local()


def run_task(job: Job, task: Task) -> list[Row]:
    """Run a task in the process of this thread, which stays for the next one.

    Raises:
        InputError: if this worker has other versions, or the process does not start.
    """
    with _pool(job) as pool:
        return [row for rows in pool.map([task]) for row in rows]


@contextmanager
def _pool(job: Job) -> Iterator[Pool]:
    """The process of this thread; without tasks it ends after a while, whatever became of us."""
    is_new = getattr(_here, "fingerprint", None) != job.fingerprint
    if is_new:
        _check_versions(job, versions(), "that joined")
    if hasattr(_here, "end"):
        _here.end.cancel()
        _here.end.join()  # it may just be ending the process
    if is_new:
        if hasattr(_here, "pool"):
            _here.pool.close()
        _here.pool, _here.fingerprint = Pool(job, 1), job.fingerprint
    try:
        yield _here.pool
    finally:
        _here.end = threading.Timer(_IDLE, _here.pool.close)
        _here.end.daemon = True
        _here.end.start()
