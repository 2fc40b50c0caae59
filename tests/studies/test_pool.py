"""Processes that run rows: they hang, they die, and the study goes on."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import tempfile
from multiprocessing import resource_tracker
from pathlib import Path

import pytest
from odd_job import OddJob, process_of, wait_for_end

from sdt_drake.io.errors import InputError
from sdt_drake.studies.pool import Pool
from sdt_drake.studies.table import Row

pytestmark = pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="needs /proc")


@pytest.fixture(autouse=True)
def temporary(tmp_path, monkeypatch) -> Path:
    """The folder of temporary files, of this test alone."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


@pytest.fixture
def pool(tmp_path):
    """Makes a pool that is closed at the end."""
    made = []

    def make(*acts, count=1, **options) -> Pool:
        made.append(Pool(OddJob(str(tmp_path), *acts, **options), count))
        return made[-1]

    yield make
    for each in made:
        each.close()


def run(pool: Pool, number: int) -> Row:
    return pool.submit(number, {}).result()


def descriptors() -> int:
    return len(os.listdir("/proc/self/fd"))


def test_a_process_is_replaced_after_50_rows_or_its_death_not_by_a_ctrl_c(pool, temporary):
    """Drake frees no diagram of Python classes. A timeout may be longer than the system waits."""
    one = pool(timeout=1e300)
    first = process_of(run(one, 0))
    os.kill(first, signal.SIGINT)  # as a terminal does
    rows = [run(one, number) for number in range(1, 51)]
    assert [(row.number, row.status) for row in rows] == [(n, "ok") for n in range(1, 51)]
    *same, second = map(process_of, rows)
    assert {*same} == {first} and second not in (first, os.getpid())
    os.kill(second, signal.SIGKILL)  # between two rows
    third = run(one, 51)
    assert third.status == "ok"
    one.close()
    for process in (first, second, process_of(third)):
        wait_for_end(process)
    assert list(temporary.iterdir()) == []


def test_rows_that_end_their_process_or_hang(pool, temporary, capfd):
    """No row that ends its process has a time-out that a busy machine could reach."""
    resource_tracker.ensure_running()  # of multiprocessing, which keeps a descriptor
    before = descriptors()
    two = pool({1: "abort", 2: "kill once"}, count=2)
    rows = [future.result() for future in [two.submit(number, {}) for number in range(1, 5)]]
    two.close()
    hanging = pool({0: "hang"}, timeout=0.5)
    assert run(hanging, 0) == Row(0, "timed_out", "not done after 0.5 s", 0.5, ())
    hanging.close()

    assert [row.status for row in rows] == ["crashed", *["ok"] * 3] and rows[1].reason == ""
    assert rows[0].reason.startswith("its process ended 2 times (")
    assert "abort: matrix is singular" in rows[0].reason or "Aborted" in rows[0].reason
    gc.collect()  # of processes that have ended
    assert list(temporary.iterdir()) == [] and descriptors() == before
    assert capfd.readouterr() == ("", "")


def test_each_row_reports_a_process_that_does_not_start(pool, temporary, capfd):
    one = pool(start="raise")
    for future in [one.submit(number, {}) for number in range(2)]:
        with pytest.raises(InputError, match=r"did not start \(RuntimeError: no start\)"):
            future.result()
    one.close()
    assert capfd.readouterr() == ("", "") and list(temporary.iterdir()) == []


MAIN = """
import sys, threading
from odd_job import OddJob, process_of
from sdt_drake.studies.pool import Pool

if __name__ == "__main__":
    pool = Pool(OddJob(sys.argv[1], {1: "hang"}, start="tidy slowly"))
    print(process_of(pool.submit(0, {}).result()), flush=True)
    pool.submit(1, {})
    threading.Event().wait()
"""


def test_a_process_ends_with_the_one_that_started_it(tmp_path, temporary):
    """In the middle of a row, and leaves no files."""
    os.mkfifo(tmp_path / "hangs")  # which the row opens before it hangs
    (tmp_path / "main.py").write_text(MAIN)
    path = os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")])
    main = subprocess.Popen(
        [sys.executable, tmp_path / "main.py", tmp_path],
        stdout=subprocess.PIPE,
        env={**os.environ, "TMPDIR": str(temporary), "PYTHONPATH": path},
    )
    with main:
        process = int(main.stdout.readline())
        (tmp_path / "hangs").read_bytes()
        main.kill()
    wait_for_end(process)
    assert list(temporary.iterdir()) == []
