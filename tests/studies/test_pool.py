"""Processes that run rows: they hang, they die, and the study goes on."""

from __future__ import annotations

import gc
import itertools
import os
import signal
import subprocess
import sys
import tempfile
from multiprocessing import resource_tracker
from pathlib import Path
from types import SimpleNamespace

import pytest
from odd_job import OddJob, process_of, wait_for_end

from sdt_drake.io.errors import InputError
from sdt_drake.studies import pool as module
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


@pytest.fixture
def hangs(tmp_path) -> Path:
    """A pipe that a row opens before it hangs: who reads it waits for that."""
    os.mkfifo(tmp_path / "hangs")
    return tmp_path / "hangs"


def descriptors() -> int:
    return len(os.listdir("/proc/self/fd"))


def test_a_process_is_replaced_after_50_rows(pool, temporary):
    """Drake frees no diagram of Python classes. A timeout may be longer than the system waits."""
    one = pool(timeout=1e300)
    rows = [run(one, number) for number in range(101)]
    assert [(row.number, row.status) for row in rows] == [(n, "ok") for n in range(101)]
    processes = {p: len([*group]) for p, group in itertools.groupby(map(process_of, rows))}
    assert list(processes.values()) == [50, 50, 1]
    assert os.getpid() not in processes

    one.close()
    for process in processes:
        wait_for_end(process)
    assert list(temporary.iterdir()) == []


def test_ctrl_c_in_the_terminal_is_not_for_a_process_but_a_death_is_survived(pool):
    one = pool()
    first = process_of(run(one, 0))
    os.kill(first, signal.SIGINT)
    assert process_of(run(one, 1)) == first
    os.kill(first, signal.SIGKILL)  # between two rows
    assert run(one, 2).status == "ok"


def test_rows_that_end_their_process_or_hang(pool, temporary, capfd):
    """No row that ends its process has a time-out that a busy machine could reach."""
    acts = {1: "abort", 2: "kill", 3: "leave", 4: "kill once"}
    resource_tracker.ensure_running()  # of multiprocessing, which keeps a descriptor
    before = descriptors()
    two = pool(acts, count=2)
    rows = [future.result() for future in [two.submit(number, {}) for number in range(1, 8)]]
    two.close()
    hanging = pool({0: "hang"}, timeout=0.5)
    assert run(hanging, 0) == Row(0, "timed_out", "not done after 0.5 s", 0.5, ())
    hanging.close()

    assert [row.status for row in rows] == ["crashed", "crashed", "crashed", *["ok"] * 4]
    assert rows[0].reason.startswith("its process ended 2 times (")
    assert "abort: matrix is singular" in rows[0].reason or "Aborted" in rows[0].reason
    assert rows[1] == Row(2, "crashed", "its process ended 2 times", 0.0, ())
    assert rows[3].reason == ""
    gc.collect()  # of processes that have ended
    assert list(temporary.iterdir()) == [] and descriptors() == before
    assert capfd.readouterr() == ("", "")


def test_closing_ends_all_at_once(pool, temporary, hangs):
    two = pool({0: "hang"}, count=2)
    futures = [two.submit(number, {}) for number in range(1000)]
    process = process_of(futures[1].result())
    hangs.read_bytes()
    two.close()
    wait_for_end(process)
    assert list(temporary.iterdir()) == []


def test_processes_that_do_not_start(pool, temporary, capfd):
    """Every row tells it."""
    two = pool(start="raise", count=2)
    for future in [two.submit(number, {}) for number in range(10)]:
        with pytest.raises(InputError, match=r"did not start \(RuntimeError: no start\)"):
            future.result()
    two.close()
    assert capfd.readouterr() == ("", "") and list(temporary.iterdir()) == []


def test_a_process_without_rows_ends_by_an_alarm(monkeypatch):
    """It is off in a row."""

    def run(number, inputs):
        return number, inputs, signal.alarm(0)

    monkeypatch.setattr(module, "_runner", SimpleNamespace(run=run), raising=False)
    signal.alarm(1000)
    assert module._run(3, {"a": 1.0}) == (3, {"a": 1.0}, 0)
    assert signal.alarm(0) == 60


MAIN = """
import sys, threading
from odd_job import OddJob, process_of
from sdt_drake.studies.pool import Pool

if __name__ == "__main__":
    pool = Pool(OddJob(sys.argv[1], {1: "hang"}, start="tidy slowly"))
    print(process_of(pool.submit(0, {}).result()), flush=True)
    if int(sys.argv[2]) == 2:
        pool.submit(1, {})
    threading.Event().wait()
"""


@pytest.mark.parametrize("rows", [1, 2])
def test_a_process_ends_with_the_one_that_started_it(tmp_path, temporary, hangs, rows):
    """While it waits for a row or in the middle of one, and leaves no files."""
    (tmp_path / "main.py").write_text(MAIN)
    path = os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")])
    main = subprocess.Popen(
        [sys.executable, tmp_path / "main.py", tmp_path, str(rows)],
        stdout=subprocess.PIPE,
        env={**os.environ, "TMPDIR": str(temporary), "PYTHONPATH": path},
    )
    with main:
        process = int(main.stdout.readline())
        hangs.read_bytes() if rows == 2 else None
        main.kill()
    wait_for_end(process)
    assert list(temporary.iterdir()) == []
