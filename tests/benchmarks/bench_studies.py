"""What studies cost beside the stepping itself, as ratios within one run.

    python tests/benchmarks/bench_studies.py [overhead] [workers] [cluster] [memory] [--rows N]

overhead: of a coupled run, the share that is not spent in the integrator.
workers:  N coupled rows with one process and with two, alternately.
cluster:  the same rows with two processes, and with two workers of a local Dask cluster.
memory:   the largest memory of a study of the axis loops, and of one ten times as long.
"""

from __future__ import annotations

import argparse
import copy
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import closing, contextmanager
from importlib import import_module
from pathlib import Path
from queue import SimpleQueue

import numpy as np

from sdt_drake.run.scenario import load_scenario
from sdt_drake.studies.cluster import Cluster
from sdt_drake.studies.distributions import Uniform
from sdt_drake.studies.execute import run_study
from sdt_drake.studies.job import Job, make_job
from sdt_drake.studies.pool import Pool
from sdt_drake.studies.runs import Runner
from sdt_drake.studies.study import Study, Variable, load_study

STUDY = "package://sdt/studies/monte_carlo.yaml"
_FIRST = 4  # rows that are not timed
PARTS = ("overhead", "workers", "cluster", "memory")


def job_of(rows: int) -> Job:
    """The first rows of the shipped Monte Carlo study."""
    study, base = load_study(STUDY)
    study.draws = max(1, rows // (len(study) // study.draws))
    return make_job(study, base)


def overhead(rows: int) -> None:
    job = job_of(rows)
    runner, stepping = Runner(job.study, job.base), []
    simulate_module = import_module("sdt_drake.run.simulate")
    make_simulator = simulate_module.make_simulator

    class Timed:
        """A simulator whose steps are timed."""

        def __init__(self, simulator) -> None:
            self._simulator = simulator

        def __getattr__(self, name):
            return getattr(self._simulator, name)

        def AdvanceTo(self, *args, **options) -> None:  # noqa: N802
            start = time.perf_counter()
            self._simulator.AdvanceTo(*args, **options)
            stepping.append(time.perf_counter() - start)

    runner.run(0)  # robot, plan: once for the study

    def make_timed(*args, **options) -> Timed:
        return Timed(make_simulator(*args, **options))

    simulate_module.make_simulator = make_timed
    shares = []
    for number in range(len(job.study)):
        stepping.clear()
        start = time.perf_counter()
        runner.run(number)
        whole = time.perf_counter() - start
        shares.append(1 - sum(stepping) / whole)
    simulate_module.make_simulator = make_simulator
    print(
        f"overhead: {100 * statistics.median(shares):.1f} % of a coupled run (median of "
        f"{len(shares)}; {100 * max(shares):.1f} % at most), target 15 %"
    )


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
    texts = ", ".join(f"{ratio:.2f}" for ratio in ratios)
    print(f"workers: two are {statistics.median(ratios):.2f} times one ({texts}), target 1.8")


@contextmanager
def local_cluster():
    from distributed import LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        yield cluster.scheduler_address


def cluster(rows: int) -> None:
    job = job_of(rows)
    numbers = range(len(job.study))
    ratios = []
    with local_cluster() as address:
        for _ in range(3):
            with closing(Pool(job, 2)) as pool:
                here = timed_rows(job, pool, numbers)
            with closing(Cluster(job, address, print)) as dask:
                ratios.append(timed_rows(job, dask, numbers) / here)
    texts = ", ".join(f"{ratio:.3f}" for ratio in ratios)
    median = statistics.median(ratios)
    print(f"cluster: {median:.3f} times the time of the pool ({texts}), target 1.15")


def memory(rows: int) -> None:
    """Each study in a process of its own, for its largest memory."""
    most = {}
    for count in (100, 1000):
        text = subprocess.run(
            [sys.executable, __file__, "axis", "--rows", str(count)],
            check=True,
            capture_output=True,
            text=True,
        ).stdout
        most[count] = [float(word) for word in text.split()]
    (short_main, short_worker), (long_main, long_worker) = most.values()
    print(
        f"memory: {long_main:.0f} MB after 1000 axis variants, {short_main:.0f} MB after 100; of "
        f"the process that runs them {long_worker:.0f} MB and {short_worker:.0f} MB"
    )


def axis(rows: int) -> None:
    base = load_scenario("package://sdt/scenarios/axis_pi_ctc.yaml")
    variables = [
        Variable("i_eff", ["plant.i_eff"], "factor", Uniform(0.7, 1.2)),
        Variable("amplitude", ["disturbance.amplitude"], "value", Uniform(0.0, 0.3)),
        Variable("kp", ["controller.kp"], "factor", Uniform(0.7, 1.5)),
    ]
    study = Study("axis", draws=rows, variables=copy.deepcopy(variables))
    study.validate(base)
    with tempfile.TemporaryDirectory() as folder:
        run_study(make_job(study, base), Path(folder) / "study", workers=1)
    for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN):
        print(resource.getrusage(who).ru_maxrss / 1024)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("parts", nargs="*", default=PARTS, choices=(*PARTS, "axis"))
    parser.add_argument("--rows", type=int, default=24)
    options = parser.parse_args()
    np.set_printoptions(precision=3)
    for part in options.parts:
        globals()[part](options.rows)


if __name__ == "__main__":
    main()
