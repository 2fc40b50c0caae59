"""What studies cost beside the stepping itself, as ratios within one run.

    python tests/benchmarks/bench_studies.py [ROWS [overhead] [workers] [cluster]]

overhead: of a coupled run, the share that is not spent in the integrator.
workers:  N coupled rows with one process and with two, alternately.
cluster:  the same rows with two processes, and with two workers of a local Dask cluster.
"""

import sys
import time
from contextlib import closing
from queue import SimpleQueue
from unittest import mock

import numpy as np
from pydrake.systems.analysis import Simulator
from timing import spread

from sdt_drake.studies.cluster import Cluster
from sdt_drake.studies.job import Job, make_job
from sdt_drake.studies.pool import Pool
from sdt_drake.studies.runs import Runner
from sdt_drake.studies.study import load_study

_FIRST, _ROUNDS = 4, 3  # rows that are not timed


def overhead(job: Job) -> list[float]:
    runner, stepping, shares = Runner(job.study, job.base), [], []
    advance = Simulator.AdvanceTo

    def timed(*arguments, **options):
        start = time.perf_counter()
        advance(*arguments, **options)
        stepping.append(time.perf_counter() - start)

    runner.run(0)  # robot, plan: once for the study
    with mock.patch.object(Simulator, "AdvanceTo", timed):
        for number in range(len(job.study)):
            stepping.clear()
            start = time.perf_counter()
            runner.run(number)
            shares.append(1 - sum(stepping) / (time.perf_counter() - start))
    return shares


def timed_rows(job: Job, backend) -> float:
    """From the first row to the last one: processes start and plan before that."""
    inbox, rows = SimpleQueue(), range(len(job.study))
    with closing(backend):
        for number in rows:
            row = backend.submit(number, job.study.inputs(number))
            row.add_done_callback(inbox.put)
        for _ in range(_FIRST):
            inbox.get()
        start = time.perf_counter()
        for _ in rows[_FIRST:]:
            inbox.get()
        return time.perf_counter() - start


def workers(job: Job) -> list[float]:
    times = ((timed_rows(job, Pool(job, 1)), timed_rows(job, Pool(job, 2))) for _ in range(_ROUNDS))
    return [one / two for one, two in times]


def cluster(job: Job) -> list[float]:
    from distributed import LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as local:
        address = local.scheduler_address
        return [
            timed_rows(job, Cluster(job, address, print)) / timed_rows(job, Pool(job, 2))
            for _ in range(_ROUNDS)
        ]


PARTS = {
    overhead: "of a coupled run, target 0.15",
    workers: "times one process are two, target 1.8",
    cluster: "times the time of the pool, target 1.15",
}


def main(rows: int = 24, *parts: str) -> dict[str, float]:
    """Print and return the ratios of the first rows of the shipped Monte Carlo study."""
    study, base = load_study("package://sdt/studies/monte_carlo.yaml")
    study = study.changed({"draws": max(1, rows // (len(study) // study.draws))})
    job, medians = make_job(study, base), {}
    for part, unit in PARTS.items():
        if not parts or part.__name__ in parts:
            ratios = part(job)
            print(f"{part.__name__}: {spread(ratios)} {unit}")
            medians[part.__name__] = float(np.median(ratios))
    return medians


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]), *sys.argv[2:])
