"""Ctrl-C at any moment of a study: no finished row is lost, and no process stays."""

from __future__ import annotations

import signal
import threading

import pytest

from sdt_drake.studies import execute, workers
from sdt_drake.studies.execute import run_study
from sdt_drake.studies.interrupts import Interrupts
from sdt_drake.studies.job import make_job
from sdt_drake.studies.journal import Journal, read_rows
from sdt_drake.studies.runs import Row
from sdt_drake.studies.study import load_study


def interrupt() -> None:
    signal.raise_signal(signal.SIGINT)


def test_it_is_kept_until_the_end():
    done = []
    with pytest.raises(KeyboardInterrupt), Interrupts():
        interrupt()
        done.append("all")
    assert done == ["all"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_it_is_let_through_where_it_is_allowed():
    done = []
    with pytest.raises(KeyboardInterrupt), Interrupts() as interrupts:
        try:
            with interrupts.allowed():
                interrupt()
                done.append("too late")
        finally:
            interrupt()  # a second one does not disturb the cleaning up
            done.append("clean")
    assert done == ["clean"]


def test_one_that_came_before_is_let_through():
    done = []
    with pytest.raises(KeyboardInterrupt), Interrupts() as interrupts:
        interrupt()
        with interrupts.allowed():
            done.append("too late")
    assert done == []


def test_without_one_nothing_happens():
    with Interrupts() as interrupts, interrupts.allowed():
        pass
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_in_other_threads_it_does_nothing():
    found = []

    def act() -> None:
        with Interrupts() as interrupts, interrupts.allowed():
            found.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=act)
    thread.start()
    thread.join()
    assert found == [signal.default_int_handler]


class Rows:
    """Stands for processes: rows at once, and a Ctrl-C where one waits for the third."""

    def __init__(self, _, __, waiting) -> None:
        self._waiting, self.closed = waiting, False

    def map(self, tasks):
        for count, (number,) in enumerate(tasks):
            with self._waiting():
                if count == 2:
                    interrupt()
            yield [Row(number, "failed", "", 0.1, ())]

    def __enter__(self):
        return self

    def __exit__(self, *_) -> None:
        interrupt()  # a second one
        self.closed = True


@pytest.mark.parametrize("when", ["it waits", "it writes", "it is told"])
def test_finished_rows_are_on_the_disk(files, tmp_path, monkeypatch, when):
    pools = []

    def pool(*arguments):
        pools.append(Rows(*arguments))
        return pools[0]

    append = Journal.append

    def interrupted(journal, rows) -> None:
        interrupt()
        append(journal, rows)
        interrupt()

    monkeypatch.setattr(execute, "Pool", pool)
    if when == "it writes":
        monkeypatch.setattr(Journal, "append", interrupted)
    job = make_job(*load_study(files / "many.yaml"))

    def report(done: int, *_) -> None:
        if when == "it is told" and done == 2:
            interrupt()

    with pytest.raises(KeyboardInterrupt):
        run_study(job, tmp_path / "many", report=report)
    kept = [row.number for row in read_rows(tmp_path / "many", 80, len(job.outcomes))]
    assert kept == ([0] if when == "it writes" else [0, 1])
    assert pools[0].closed


def test_no_process_stays(files, tmp_path, monkeypatch):
    """However early it comes."""
    job = make_job(*load_study(files / "many.yaml"))
    started = []

    class Popen(workers.subprocess.Popen):
        def __init__(self, *arguments, **options) -> None:
            interrupt()
            super().__init__(*arguments, **options)
            started.append(self)
            interrupt()

    monkeypatch.setattr(workers.subprocess, "Popen", Popen)
    with pytest.raises(KeyboardInterrupt):
        run_study(job, tmp_path / "many", workers=2)
    assert len(started) == 2
    assert all(process.returncode == -signal.SIGKILL for process in started)
