"""Processes that run rows, here and on a cluster: they hang, they die, and the study goes on."""

import os
import signal
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import pytest
from helpers import odd_job
from helpers.odd_job import OddJob, wait_for_end
from helpers.small_studies import rows

from sdt_drake.io.errors import InputError
from sdt_drake.studies.execute import run_study
from sdt_drake.studies.job import make_job
from sdt_drake.studies.pool import Pool
from sdt_drake.studies.study import load_study
from sdt_drake.studies.table import Row

pytestmark = pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="needs /proc")


@pytest.fixture
def temporary(tmp_path, monkeypatch) -> Path:
    """The folder of temporary files, of this test alone."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


@pytest.fixture
def pool(tmp_path, temporary, capfd):
    """Makes a pool; it is closed at the end, and leaves no files and has printed nothing."""
    made = []

    def make(*acts, count=1, **options) -> Pool:
        made.append(Pool(OddJob(str(tmp_path), *acts, **options), count))
        return made[-1]

    yield make
    for each in made:
        each.close()
    assert list(temporary.iterdir()) == []
    assert capfd.readouterr() == ("", "")


def test_rows_that_abort_or_hang_are_reported_and_others_go_on(pool):
    """No row that ends its process has a time-out that a busy machine could reach."""
    two = pool({0: "abort", 1: "kill once"}, count=2)
    rows = [future.result() for future in [two.submit(number, {}) for number in range(3)]]
    hanging = pool({0: "hang"}, timeout=0.5)
    late = hanging.submit(0, {}).result()

    assert late == Row(0, "timed_out", "not done after 0.5 s", 0.5, ())
    assert [row.status for row in rows] == ["crashed", "ok", "ok"] and rows[1].reason == ""
    assert rows[0].reason.startswith("its process ended 2 times (")
    assert "abort: matrix is singular" in rows[0].reason or "Aborted" in rows[0].reason


def test_row_reports_a_process_that_does_not_start(pool):
    one = pool(start="raise")
    for future in [one.submit(number, {}) for number in range(2)]:
        with pytest.raises(InputError, match=r"did not start \(RuntimeError: no start\)"):
            future.result()


@pytest.mark.parametrize("act", ["hang", ""])
def test_worker_ends_with_its_parent(tmp_path, temporary, act):
    """In the middle of a row or without one, and leaves no files."""
    os.mkfifo(tmp_path / "hangs")  # which the row opens before it hangs
    command = [sys.executable, odd_job.__file__, tmp_path, act]
    environment = {**os.environ, "TMPDIR": str(temporary)}
    main = subprocess.Popen(command, stdout=subprocess.PIPE, env=environment)
    with main:
        process = int(main.stdout.readline())
        if act == "hang":
            (tmp_path / "hangs").read_bytes()
        main.kill()
    wait_for_end(process)
    assert list(temporary.iterdir()) == []


# --- on a cluster ----------------------------------------------------------------------------


@pytest.mark.oracle
def test_cluster_survives_lost_worker_and_reports_versions_and_scheduler(desk, undisturbed):
    distributed = pytest.importorskip("distributed")
    from sdt_drake.studies.cluster import Cluster, run_row

    job = make_job(*load_study("many.yaml"))
    for file in desk.glob("*.yaml"):
        file.unlink()
    versions = job.about.versions | {"drake": "1.0"}
    other = replace(job, about=replace(job.about, versions=versions))
    with pytest.raises(InputError, match="that joined has drake"):
        run_row(other, 0, {})
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, dashboard_address=":0", silence_logs=50
    ) as dask:
        killed = dask.workers[0].pid

        def report(done: int, *counts) -> None:
            if done == 5:
                os.kill(killed, signal.SIGKILL)

        run_study(job, desk / "many", cluster=dask.scheduler_address, report=report)
        assert killed not in {worker.pid for worker in dask.workers.values()}
        assert rows(desk / "many").equals(rows(undisturbed))
        with pytest.raises(InputError, match=r"worker tcp.* has drake .* \(here: 1.0\); install"):
            Cluster(other, dask.scheduler_address, print)
        cluster = Cluster(OddJob(str(desk), {1: "hang"}), dask.scheduler_address, print)
        cluster.submit(0, {}).result()
        running = cluster.submit(1, {})
    with pytest.raises(InputError, match=r"cluster: .*; .*resume=True"):
        running.result()
    cluster.close()
