"""The same rows from the workers of a Dask cluster, whatever becomes of them."""

from __future__ import annotations

import os
import signal
from dataclasses import replace

import pytest
from odd_job import OddJob
from small_studies import RUNS, rows

from sdt_drake.io.errors import InputError
from sdt_drake.studies.cluster import Cluster, run_row
from sdt_drake.studies.execute import run_study
from sdt_drake.studies.job import make_job
from sdt_drake.studies.study import load_study

distributed = pytest.importorskip("distributed")


def test_a_study_survives_a_worker_and_tells_of_other_versions_and_a_lost_scheduler(
    desk, undisturbed
):
    job, told = make_job(*load_study("many.yaml")), []
    for file in desk.glob("*.yaml"):
        file.unlink()
    drake = job.versions["drake"]
    other = replace(job, versions=job.versions | {"drake": "1.0"})
    with pytest.raises(InputError, match="that joined has drake"):
        run_row(other, 0, {})
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=":0", silence_logs=50
    ) as dask:
        killed = dask.workers[0].pid

        def report(done: int, *counts) -> None:
            told.append((done, *counts))
            if done == 5:
                os.kill(killed, signal.SIGKILL)

        run_study(job, desk / "many", cluster=dask.scheduler_address, report=report)
        assert killed not in {worker.pid for worker in dask.workers.values()}
        assert rows(desk / "many").equals(rows(undisturbed))
        assert told == [(done, 0, RUNS) for done in range(RUNS + 1)]
        with pytest.raises(InputError, match=rf"worker tcp.* has drake {drake} \(here: 1.0\); ins"):
            Cluster(other, dask.scheduler_address, print)
        cluster = Cluster(OddJob(str(desk), {1: "hang"}), dask.scheduler_address, print)
        cluster.submit(0, {}).result()
        running = cluster.submit(1, {})
    with pytest.raises(InputError, match=r"--cluster: .*; .*--resume"):
        running.result()
    cluster.close()
