"""The same rows from the workers of a Dask cluster, whatever becomes of them."""

from __future__ import annotations

import dataclasses
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from small_studies import rows

from sdt_drake.errors import InputError
from sdt_drake.resources import models_dir
from sdt_drake.studies import cluster as cluster_module
from sdt_drake.studies.cluster import Cluster, run_task
from sdt_drake.studies.execute import run_study
from sdt_drake.studies.job import Job, make_job
from sdt_drake.studies.results import read_study_table
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
        self.process = subprocess.Popen(
            [sys.executable, "cluster.py"],
            cwd=folder,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        self.address = self.process.stdout.readline().strip()

    def workers(self) -> list[int]:
        with distributed.Client(self.address, set_as_default=False) as client:
            return list(client.run(os.getpid).values())

    def end(self) -> None:
        self.process.stdin.close()
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self.process.stdout.close()


@pytest.fixture(scope="module")
def dask(tmp_path_factory):
    dask = Dask(tmp_path_factory.mktemp("dask"))
    yield dask
    dask.end()


@pytest.fixture
def job(files) -> Job:
    return make_job(*load_study(files / "many.yaml"))


def test_bit_for_bit(dask, job, undisturbed, tmp_path):
    told = []
    run_study(
        job, tmp_path / "many", cluster=dask.address, report=lambda *counts: told.append(counts)
    )
    assert rows(tmp_path / "many").equals(rows(undisturbed))
    assert told[0] == (0, 0, 80) and told[-1] == (80, 0, 80) and len(told) == 81


def test_workers_that_cannot_see_the_files(dask, desk, tmp_path, monkeypatch):
    (desk / "device.sdf").write_text((models_dir() / "sdt.sdf").read_text())
    (desk / "axis.yaml").write_text("robot: device.sdf\n" + (desk / "axis.yaml").read_text())
    text = (desk / "few.yaml").read_text()
    text = text.replace("[controller]", "[motion]").replace("pi, p_pi+id", "short.yaml, fast.yaml")
    (desk / "few.yaml").write_text(text)
    job = make_job(*load_study("few.yaml"))
    run_study(job, tmp_path / "here")
    for file in ("device.sdf", "short.yaml", "fast.yaml"):
        (desk / file).unlink()

    run_study(job, tmp_path / "there", cluster=dask.address)
    table = rows(tmp_path / "there")
    assert table["status"].to_pylist() == ["ok", "infeasible"] * 3
    assert table.equals(rows(tmp_path / "here"))


def test_workers_that_die_on_the_way(dask, job, undisturbed, tmp_path):
    """One, then the other: none of those that were given the study is left."""
    workers, killed = dask.workers(), []

    def report(done: int, *_) -> None:
        if done in (10, 12):
            killed.append(workers[len(killed)])
            os.kill(killed[-1], signal.SIGKILL)

    run_study(job, tmp_path / "many", cluster=dask.address, report=report)
    assert killed == workers and not set(killed) & set(dask.workers())
    assert rows(tmp_path / "many").equals(rows(undisturbed))


def test_interrupted(dask, desk, job, undisturbed):
    process = subprocess.Popen(
        [sys.executable, "-m", "sdt_drake", "study", "many.yaml", "--cluster", dask.address],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    line = process.stdout.readline()
    while line.startswith("0 of"):
        line = process.stdout.readline()
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=30)

    assert (process.returncode, err) == (130, "")
    run_study(job, desk / "many", cluster=dask.address, resume=True)
    assert rows(desk / "many").equals(rows(undisturbed))


def test_scheduler_that_dies_on_the_way(job, tmp_path):
    dask = Dask(tmp_path)

    def report(done: int, *_) -> None:
        if done == 10:
            dask.process.kill()

    with pytest.raises(InputError, match=r"--cluster: lost \(.*\); --resume goes on"):
        run_study(job, tmp_path / "many", cluster=dask.address, report=report)
    dask.end()
    assert 10 <= len(read_study_table(tmp_path / "many")) < 80


def test_cluster_without_workers(job, tmp_path):
    with (
        distributed.LocalCluster(
            n_workers=0, protocol="tcp://", dashboard_address=":0", silence_logs=50
        ) as empty,
        pytest.raises(InputError, match="--cluster: has no workers, start some"),
    ):
        run_study(job, tmp_path / "many", cluster=empty.scheduler_address)
    assert not (tmp_path / "many").exists()


def test_workers_that_are_gone_for_good(job, tmp_path, monkeypatch):
    monkeypatch.setattr(cluster_module, "_ALONE", 0.3)
    monkeypatch.setattr(cluster_module, "_IDLE", 0.5)
    with distributed.LocalCluster(
        n_workers=1,
        threads_per_worker=1,
        processes=False,
        protocol="tcp://",
        dashboard_address=":0",
        silence_logs=50,
    ) as cluster:

        def report(done: int, *_) -> None:
            if done == 3:
                cluster.scale(0)

        with pytest.raises(InputError, match=r"has had no workers for 0.3 s; --resume goes on"):
            run_study(job, tmp_path / "many", cluster=cluster.scheduler_address, report=report)
    assert 3 <= len(read_study_table(tmp_path / "many")) < 80


def test_workers_with_other_versions(dask, job, tmp_path):
    other = dataclasses.replace(job, versions=job.versions | {"drake": "1.0"})
    drake = job.versions["drake"]
    with pytest.raises(InputError, match=rf"worker tcp.* has drake {drake} \(here: 1.0\)"):
        Cluster(other, dask.address)
    with pytest.raises(InputError, match="that joined has drake"):
        in_a_thread(lambda: run_task(other, [0]))


def in_a_thread(act):
    """Each thread has a process of its own."""
    result = []

    def run() -> None:
        try:
            result.append(act())
        except InputError as error:
            result.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    if isinstance(result[0], Exception):
        raise result[0]
    return result[0]


def test_process_stays_for_the_next_task_and_ends_when_there_is_none(job, monkeypatch):
    monkeypatch.setattr(cluster_module, "_IDLE", 0.5)

    def act() -> None:
        assert [row.status for row in run_task(job, [0])] == ["ok"]
        [process] = cluster_module._here.pool.processes
        assert [row.number for row in run_task(job, [1, 2])] == [1, 2]
        assert cluster_module._here.pool.processes == [process]
        end = time.monotonic() + 10
        while cluster_module._here.pool.processes:
            assert time.monotonic() < end
            time.sleep(0.02)
        with pytest.raises(ProcessLookupError):
            os.kill(process, 0)
        assert [row.number for row in run_task(job, [3])] == [3]
        cluster_module._here.pool.close()

    in_a_thread(lambda: act())
