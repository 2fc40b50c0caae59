"""Processes that run rows: they hang, they die, and the study goes on."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest
from odd_job import OddJob

from sdt_drake.errors import InputError
from sdt_drake.studies.workers import Pool

pytestmark = pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="needs /proc")


@pytest.fixture(autouse=True)
def _processes_find_odd_jobs(monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent), prepend=os.pathsep)


@pytest.fixture
def temporary(tmp_path, monkeypatch) -> Path:
    """The folder of temporary files, of this test alone."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


def is_running(process: int) -> bool:
    """Whether it is there, and no zombie."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def wait_until(holds, seconds: float = 20.0) -> None:
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.02)


def statuses(rows) -> dict[int, str]:
    return {row.number: row.status for task in rows for row in task}


def singles(count: int) -> list[list[int]]:
    return [[number] for number in range(count)]


def test_processes_stay_and_share_the_tasks(tmp_path, temporary, monkeypatch):
    monkeypatch.setattr("sdt_drake.studies.workers._MOST_ROWS", 1000)
    with Pool(OddJob(str(tmp_path)), 2) as pool:
        assert pool.processes == []  # none is started before there is a task
        rows = [
            row for task in pool.map([[0, 1, 2], *[[k] for k in range(3, 200)]]) for row in task
        ]
        again = [row for task in pool.map(singles(5)) for row in task]
        running = pool.processes

        assert sorted(row.number for row in rows) == list(range(200))
        assert {row.outcomes[1] for row in rows + again} == set(map(float, running))
        assert len(running) == 2 and all(map(is_running, running))
    assert not any(map(is_running, running))
    assert list(temporary.iterdir()) == []


def test_a_process_is_replaced_after_some_rows(tmp_path, temporary, monkeypatch):
    """Drake frees no diagram of Python classes."""
    monkeypatch.setattr("sdt_drake.studies.workers._MOST_ROWS", 2)
    with Pool(OddJob(str(tmp_path)), 1) as pool:
        seen, found = set(), {}
        for rows in pool.map(singles(5)):
            found |= statuses([rows])
            seen |= set(pool.processes)
        assert found == dict.fromkeys(range(5), "ok") and len(seen) == 3
    wait_until(lambda: not any(map(is_running, seen)))
    assert list(temporary.iterdir()) == []


def test_a_pool_can_be_closed_and_used_again(tmp_path):
    with Pool(OddJob(str(tmp_path)), 1) as pool:
        assert statuses(pool.map([[0]])) == {0: "ok"}
        pool.close()
        assert pool.processes == []
        assert statuses(pool.map([[1]])) == {1: "ok"}


def test_rows_that_end_their_process(tmp_path, temporary):
    job = OddJob(str(tmp_path), {1: "kill", 2: "abort", 4: "kill once"})
    with Pool(job, 2) as pool:
        rows = {row.number: row for task in pool.map([[0, 1], *singles(7)[2:]]) for row in task}

    status = {number: row.status for number, row in rows.items()}
    assert status == {n: "crashed" if n in (1, 2) else "ok" for n in range(7)}
    assert rows[1].reason == "the process that ran it ended 2 times"
    assert rows[2].reason.startswith("the process that ran it ended 2 times (")
    assert "abort: matrix is singular" in rows[2].reason or "Aborted" in rows[2].reason
    assert rows[1].outcomes == () and rows[4].reason == ""
    assert list(temporary.iterdir()) == []


def test_a_row_that_hangs_is_given_up(tmp_path):
    job = OddJob(str(tmp_path), {1: "hang"}, timeout=0.5)
    with Pool(job, 2) as pool:
        rows = {row.number: row for task in pool.map([[0, 1], [2], [3]]) for row in task}

    status = {number: row.status for number, row in rows.items()}
    assert status == {0: "ok", 1: "timed_out", 2: "ok", 3: "ok"}
    assert rows[1].reason == "not done after 0.5 s"
    assert (rows[1].duration, rows[1].outcomes) == (0.5, ())


def test_a_timeout_may_be_longer_than_the_system_can_wait(tmp_path):
    with Pool(OddJob(str(tmp_path), timeout=1e300), 1) as pool:
        assert statuses(pool.map([[0]])) == {0: "ok"}


def test_others_go_on_while_one_hangs(tmp_path):
    job = OddJob(str(tmp_path), {0: "hang"}, timeout=1.5)
    with Pool(job, 2) as pool:
        order = [row.number for task in pool.map(singles(50)) for row in task]
    assert sorted(order) == list(range(50)) and order[-1] == 0


def test_process_killed_from_outside(tmp_path):
    with Pool(OddJob(str(tmp_path)), 2) as pool:
        done = {}
        for i, task in enumerate(pool.map(singles(300))):
            done |= {row.number: row.status for row in task}
            if i == 50:
                which = pool.processes.index(int(task[0].outcomes[1]))
            if i in (50, 60):  # once while it runs, once while it starts
                os.kill(pool.processes[which], signal.SIGKILL)
    assert done == dict.fromkeys(range(300), "ok")


@pytest.mark.parametrize("start", ["kill", "raise"])
def test_processes_that_do_not_start(tmp_path, temporary, start, capfd):
    with (
        Pool(OddJob(str(tmp_path), start=start), 1) as pool,
        pytest.raises(InputError, match="a process that should run the study did not start"),
    ):
        statuses(pool.map([[0]]))
    assert capfd.readouterr().err == ""
    assert list(temporary.iterdir()) == []


def test_the_reason_of_a_process_that_does_not_start(tmp_path):
    with (
        Pool(OddJob(str(tmp_path), start="raise"), 1) as pool,
        pytest.raises(InputError, match=r"did not start \(RuntimeError: no start\)"),
    ):
        statuses(pool.map([[0]]))


def test_processes_that_take_too_long_to_start(tmp_path, monkeypatch):
    monkeypatch.setattr("sdt_drake.studies.workers._START", 0.1)
    with Pool(OddJob(str(tmp_path)), 1) as pool, pytest.raises(InputError, match="did not start"):
        statuses(pool.map([[0]]))


@pytest.fixture
def crowded(tmp_path, monkeypatch) -> Path:
    """The working directory, with files that are called like modules that are needed."""
    for name in ("random", "copy", "numpy", "argparse", "logging", "table", "sdt_drake"):
        (tmp_path / f"{name}.py").write_text("raise RuntimeError('a wrong module')")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_files_beside_a_study_are_not_imported(crowded):
    with Pool(OddJob(str(crowded)), 1) as pool:
        assert statuses(pool.map([[0]])) == {0: "ok"}


def test_files_beside_the_main_process_are_not_imported(crowded):
    (crowded / "sdt_drake.py").unlink()  # `-m sdt_drake` asks for that
    command = [sys.executable, "-m", "sdt_drake", "--version"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


def test_no_descriptor_is_left(tmp_path):
    job = OddJob(str(tmp_path), {0: "exit"})
    with Pool(job, 2) as pool:
        statuses(pool.map([[9], [10]]))
        before = len(os.listdir("/proc/self/fd"))
        statuses(pool.map(singles(12)))
        assert len(os.listdir("/proc/self/fd")) <= before
    assert len(os.listdir("/proc/self/fd")) < before


MAIN = """
import sys, tempfile
from odd_job import OddJob
from sdt_drake.studies.workers import Pool

with Pool(OddJob(sys.argv[1], {0: "hang"}, timeout=1000.0), 2) as pool:
    for task in pool.map([[0], [1]]):
        print(*pool.processes, flush=True)
"""


def test_processes_end_with_the_one_that_started_them(tmp_path, temporary):
    """One is in the middle of a row, the other waits; both end, and leave no files."""
    main = subprocess.Popen(
        [sys.executable, "-c", MAIN, tmp_path],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "TMPDIR": str(temporary)},
    )
    with main:
        processes = list(map(int, main.stdout.readline().split()))
        assert len(processes) == 2 and all(map(is_running, processes))
        main.kill()
    wait_until(lambda: not any(map(is_running, processes)), 5)
    wait_until(lambda: list(temporary.iterdir()) == [], 1)
