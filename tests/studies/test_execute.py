"""Ctrl-C at any moment of a study: no finished row is lost, and nothing is disturbed."""

from __future__ import annotations

import signal
import threading

import pytest
from small_studies import RUNS

from sdt_drake.io.errors import InputError
from sdt_drake.studies import execute
from sdt_drake.studies.execute import Inbox, run_study
from sdt_drake.studies.job import make_job
from sdt_drake.studies.journal import Journal, Row, read_rows
from sdt_drake.studies.study import load_study


def interrupt() -> None:
    signal.raise_signal(signal.SIGINT)


def test_ctrl_c_comes_after_the_messages_before_it_and_nowhere_else():
    done = []
    with pytest.raises(KeyboardInterrupt), Inbox() as inbox:
        inbox.put("row")
        interrupt()
        done.append(inbox.get())
        try:
            inbox.get()
        finally:
            interrupt()  # a second one does not disturb the cleaning up
            done.append("clean")
    assert done == ["row", "clean"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_ctrl_c_ends_the_waiting():
    thread = threading.Timer(0.05, signal.pthread_kill, [threading.get_ident(), signal.SIGINT])
    with pytest.raises(KeyboardInterrupt), Inbox() as inbox:
        thread.start()
        inbox.get()


def test_ctrl_c_that_nobody_waited_for_comes_at_the_end():
    done = []
    with pytest.raises(KeyboardInterrupt), Inbox():
        interrupt()
        done.append("all")
    assert done == ["all"]


def test_the_first_signal_is_told_to_its_own_handler(monkeypatch):
    told = []
    before = {
        number: signal.signal(number, lambda number, frame: told.append(number))
        for number in (signal.SIGTERM, signal.SIGHUP)
    }
    with Inbox():
        for number in before:
            signal.raise_signal(number)
    for number, handler in before.items():
        signal.signal(number, handler)
    assert told == [signal.SIGTERM]


def test_what_is_ignored_stays_ignored():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    with Inbox():
        assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    signal.signal(signal.SIGHUP, before)


def test_in_other_threads_signals_are_left_alone():
    with Inbox() as inbox:  # here, to wait for the thread

        def act() -> None:
            before = signal.getsignal(signal.SIGINT)
            with Inbox():
                inbox.put(signal.getsignal(signal.SIGINT) == before)

        threading.Thread(target=act).start()
        assert inbox.get() is True


def test_errors_and_results_come_out_where_one_waits():
    with Inbox() as inbox:
        assert inbox.result_of(lambda: threading.current_thread() is threading.main_thread()) is (
            False
        )
        with pytest.raises(InputError, match="lost"):
            inbox.result_of(lambda: (_ for _ in ()).throw(InputError("lost")))


class Rows:
    """Stands for processes: two rows, then a Ctrl-C; and a second one at the end."""

    def __init__(self, *_) -> None:
        self.closed = False

    def start(self, numbers, put) -> None:
        for number in numbers[:2]:
            put(Row(number, "failed", "", 0.1, ()))
        interrupt()

    def close(self) -> None:
        interrupt()
        self.closed = True


@pytest.mark.parametrize("when", ["it waits", "it writes", "it is told"])
def test_finished_rows_are_on_the_disk(files, tmp_path, monkeypatch, when):
    backend, append = Rows(), Journal.append

    def interrupted(journal, row) -> None:
        interrupt()
        append(journal, row)
        interrupt()

    def report(done: int, *_) -> None:
        if when == "it is told" and done == 1:
            interrupt()

    monkeypatch.setattr("sdt_drake.studies.workers.Workers", lambda *_: backend)
    if when == "it writes":
        monkeypatch.setattr(Journal, "append", interrupted)
    job = make_job(*load_study(files / "many.yaml"))
    with pytest.raises(KeyboardInterrupt):
        execute.run_study(job, tmp_path / "many", report=report)
    kept = [row.number for row in read_rows(tmp_path / "many", RUNS, len(job.outcomes))]
    assert kept == [0, 1] and backend.closed


def test_an_error_of_a_thread_ends_the_study(files, tmp_path, monkeypatch):
    backend = Rows()
    monkeypatch.setattr(backend, "start", lambda _, put: put(InputError("did not start")))
    monkeypatch.setattr(backend, "close", lambda: None)
    monkeypatch.setattr("sdt_drake.studies.workers.Workers", lambda *_: backend)
    with pytest.raises(InputError, match="did not start"):
        run_study(make_job(*load_study(files / "many.yaml")), tmp_path / "many")
