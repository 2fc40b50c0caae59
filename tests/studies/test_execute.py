"""Ctrl-C at any moment of a study: no finished row is lost, and nothing is disturbed."""

from __future__ import annotations

import signal
from concurrent.futures import Future
from queue import SimpleQueue

import pytest

from sdt_drake.studies.execute import _signals_into, run_study
from sdt_drake.studies.job import make_job
from sdt_drake.studies.store import Store
from sdt_drake.studies.study import load_study
from sdt_drake.studies.table import Row


def interrupt() -> None:
    signal.raise_signal(signal.SIGINT)


def test_ctrl_c_comes_after_the_messages_before_it_and_nowhere_else():
    inbox, done = SimpleQueue(), []
    with pytest.raises(KeyboardInterrupt), _signals_into(inbox.put):
        inbox.put("row")
        interrupt()
        done.append(inbox.get())
        try:
            raise inbox.get()
        finally:
            interrupt()  # a second one does not disturb the cleaning up
            done.append("clean")
    assert done == ["row", "clean"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


class Rows:
    """Stands for processes: two rows, then a Ctrl-C; and a second one at the end."""

    ahead = 3

    def __init__(self, *_) -> None:
        self.closed = False

    def submit(self, number, inputs) -> Future[Row]:
        future = Future()
        if number < 2:
            future.set_result(Row(number, "failed", "", 0.1, ()))
        else:
            interrupt()
        return future

    def close(self) -> None:
        interrupt()
        self.closed = True


@pytest.mark.parametrize("when", ["it waits", "it writes", "it is told"])
def test_finished_rows_are_on_the_disk(files, tmp_path, monkeypatch, when):
    backend, append = Rows(), Store.append

    def interrupted(store, row, inputs) -> None:
        interrupt()
        append(store, row, inputs)
        interrupt()

    def report(done: int, *_) -> None:
        if when == "it is told" and done == 1:
            interrupt()

    monkeypatch.setattr("sdt_drake.studies.pool.Pool", lambda *_: backend)
    if when == "it writes":
        monkeypatch.setattr(Store, "append", interrupted)
    job = make_job(*load_study(files / "many.yaml"))
    with pytest.raises(KeyboardInterrupt):
        run_study(job, tmp_path / "many", report=report)
    with Store(tmp_path / "many") as store:
        assert store.done() == {0, 1} and backend.closed
