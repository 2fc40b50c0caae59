"""The same rows from the workers of a Dask cluster, whatever becomes of them."""

from __future__ import annotations

import dataclasses
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path
from queue import SimpleQueue

import pytest
from odd_job import OddJob, process_of
from small_studies import RUNS, rows

from sdt_drake.io.errors import InputError
from sdt_drake.studies import cluster as module
from sdt_drake.studies.cluster import Cluster, run_row
from sdt_drake.studies.execute import run_study
from sdt_drake.studies.job import make_job
from sdt_drake.studies.study import load_study

distributed = pytest.importorskip("distributed")

CLUSTER = """
import sys
from distributed import LocalCluster

if __name__ == "__main__":
    with LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=":0", silence_logs=50
    ) as cluster:
        print(cluster.scheduler_address, flush=True)
        sys.stdin.read()
"""


class Dask:
    """A cluster of two workers in processes of its own, in a folder of its own."""

    def __init__(self, folder: Path) -> None:
        (folder / "cluster.py").write_text(CLUSTER)
        path = os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")])
        self.process = subprocess.Popen(
            [sys.executable, "cluster.py"],
            cwd=folder,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env={**os.environ, "PYTHONPATH": path},
        )
        self.address = self.process.stdout.readline().strip()

    def workers(self) -> list[int]:
        with distributed.Client(self.address, set_as_default=False) as client:
            return list(client.run(os.getpid).values())

    def end(self) -> None:
        self.process.kill()
        self.process.communicate()


@pytest.fixture(scope="module")
def dask(tmp_path_factory):
    dask = Dask(tmp_path_factory.mktemp("dask"))
    yield dask
    dask.end()


@pytest.fixture
def connect(dask):
    """Makes backends that are closed at the end."""
    made = []

    def make(job, address=dask.address, put=None) -> Cluster:
        made.append(Cluster(job, address, put))
        return made[-1]

    yield make
    for each in made:
        each.close()


def test_bit_for_bit_without_the_files_and_with_a_worker_that_dies(dask, desk, undisturbed):
    job, killed = make_job(*load_study("many.yaml")), []
    for file in desk.glob("*.yaml"):
        file.unlink()
    workers, told = dask.workers(), []

    def report(done: int, *counts) -> None:
        told.append((done, *counts))
        if done == 5:
            killed.append(workers[0])
            os.kill(workers[0], signal.SIGKILL)

    run_study(job, desk / "many", cluster=dask.address, report=report)
    assert killed and not set(killed) & set(dask.workers())
    assert rows(desk / "many").equals(rows(undisturbed))
    assert told == [(done, 0, RUNS) for done in range(RUNS + 1)]


def test_workers_with_other_versions(connect, tmp_path):
    job = OddJob(str(tmp_path))
    drake = job.versions["drake"]
    other = dataclasses.replace(job, versions=job.versions | {"drake": "1.0"})
    with pytest.raises(InputError, match=rf"worker tcp.* has drake {drake} \(here: 1.0\); install"):
        connect(other)
    with pytest.raises(InputError, match="that joined has drake"):
        run_row(other, 0, {})


def test_a_thread_ends_its_process_for_another_study(tmp_path):
    job, found = OddJob(str(tmp_path)), []

    def act() -> None:
        for fingerprint in ("a", "a", "b"):
            row = run_row(dataclasses.replace(job, fingerprint=fingerprint), 0, {})
            found.append(process_of(row))
        module._here.pool.close()

    thread = threading.Thread(target=act)
    thread.start()
    thread.join()
    assert found[0] == found[1] != found[2]
    for process in found:
        with pytest.raises(ProcessLookupError):
            os.kill(process, 0)


def test_workers_that_are_gone_for_good(connect, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "_NO_WORKERS_TIMEOUT", 0.3)
    monkeypatch.setattr(module, "_WATCH_PERIOD", 0.05)
    inbox = SimpleQueue()
    with distributed.LocalCluster(
        n_workers=1,
        threads_per_worker=1,
        processes=False,
        protocol="tcp://",
        dashboard_address=":0",
        silence_logs=50,
    ) as cluster:
        lost = connect(OddJob(str(tmp_path)), cluster.scheduler_address, inbox.put)
        lost.submit(0, {}).result()
        cluster.scale(0)
        assert str(inbox.get()).startswith("--cluster: no workers for 0.3 s; ")
        with pytest.raises(InputError, match="has no workers; start one: dask worker tcp:"):
            connect(OddJob(str(tmp_path)), cluster.scheduler_address)


def test_a_scheduler_that_dies_on_the_way(dask, connect, tmp_path):
    """The last test: there is no cluster any more."""
    cluster = connect(OddJob(str(tmp_path), {1: "hang"}), put=lambda error: None)
    cluster.submit(0, {}).result()
    running = cluster.submit(1, {})
    dask.process.kill()
    with pytest.raises(InputError, match=r"--cluster: connection lost \(.*\); .*--resume"):
        running.result()
