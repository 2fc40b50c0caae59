"""What studies cost beside the stepping itself, as ratios within one run.

    python tests/benchmarks/bench_studies.py [ROWS [overhead] [workers] [cluster]]

overhead: of a coupled run, the share that is not spent in the integrator.
workers:  N coupled rows with one process and with two, alternately.
cluster:  the same rows with two processes, and with two workers of a local Dask cluster.
"""

from __future__ import annotations

import sys
import time
from contextlib import closing
from importlib import import_module
from queue import SimpleQueue
from typing import NamedTuple
from unittest import mock

from pydrake.systems.analysis import Simulator
from timing import spread

from sdt_drake.studies.cluster import Cluster
from sdt_drake.studies.job import Job, make_job
from sdt_drake.studies.pool import Pool
from sdt_drake.studies.runs import Runner
from sdt_drake.studies.study import load_study

simulate = import_module("sdt_drake.run.simulate")
STUDY = "package://sdt/studies/monte_carlo.yaml"
_FIRST = 4  # rows that are not timed
PARTS = ("overhead", "workers", "cluster")


def job_of(rows: int) -> Job:
    """The first rows of the shipped Monte Carlo study."""
    study, base = load_study(STUDY)
    study.draws = max(1, rows // (len(study) // study.draws))
    return make_job(study, base)


def overhead(rows: int) -> None:
    job = job_of(rows)
    runner, stepping, shares = Runner(job.study, job.base), [], []

    class Timed(NamedTuple):
        """A simulator whose steps are timed."""

        simulator: Simulator

        def __getattr__(self, name):
            return getattr(self.simulator, name)

        def AdvanceTo(self, *args, **options) -> None:  # noqa: N802
            start = time.perf_counter()
            self.simulator.AdvanceTo(*args, **options)
            stepping.append(time.perf_counter() - start)

    runner.run(0)  # robot, plan: once for the study
    made = simulate.make_simulator
    with mock.patch.object(simulate, "make_simulator", lambda *a, **o: Timed(made(*a, **o))):
        for number in range(len(job.study)):
            stepping.clear()
            start = time.perf_counter()
            runner.run(number)
            shares.append(1 - sum(stepping) / (time.perf_counter() - start))
    print(f"overhead: {spread(shares)} of a coupled run, target 0.15")


def timed_rows(job, backend, numbers) -> float:
    """From the first row to the last one: processes start and plan before that."""
    inbox = SimpleQueue()
    for number in numbers:
        row = backend.submit(number, job.study.inputs(number))
        row.add_done_callback(inbox.put)
    for _ in range(_FIRST):
        inbox.get()
    start = time.perf_counter()
    for _ in numbers[_FIRST:]:
        inbox.get()
    return time.perf_counter() - start


def workers(rows: int) -> None:
    job = job_of(rows)
    numbers, ratios = range(len(job.study)), []
    for _ in range(3):
        with closing(Pool(job, 1)) as one:
            alone = timed_rows(job, one, numbers)
        with closing(Pool(job, 2)) as two:
            ratios.append(alone / timed_rows(job, two, numbers))
    print(f"workers: two are {spread(ratios)} times one, target 1.8")


def cluster(rows: int) -> None:
    from distributed import LocalCluster

    job = job_of(rows)
    numbers, ratios = range(len(job.study)), []
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as local:
        for _ in range(3):
            with closing(Pool(job, 2)) as pool:
                here = timed_rows(job, pool, numbers)
            with closing(Cluster(job, local.scheduler_address, print)) as dask:
                ratios.append(timed_rows(job, dask, numbers) / here)
    print(f"cluster: {spread(ratios)} times the time of the pool, target 1.15")


if __name__ == "__main__":
    for part in sys.argv[2:] or PARTS:
        globals()[part](int([*sys.argv, 24][1]))
