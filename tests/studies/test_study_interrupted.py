"""Whatever ends a study on its way: nothing is lost, and no process stays behind."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from concurrent.futures import Future
from pathlib import Path
from queue import SimpleQueue
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from odd_job import wait_for_end
from small_studies import RUNS, rows

from sdt_drake.cli.app import main
from sdt_drake.io.errors import InputError
from sdt_drake.studies.execute import _signals_into, run_study
from sdt_drake.studies.folder import opened
from sdt_drake.studies.job import Job, make_job
from sdt_drake.studies.store import Store
from sdt_drake.studies.study import load_study
from sdt_drake.studies.table import Row


def test_ctrl_c_comes_after_the_messages_before_it_and_nowhere_else():
    inbox, done = SimpleQueue(), []
    with pytest.raises(KeyboardInterrupt), _signals_into(inbox.put):
        inbox.put("row")
        signal.raise_signal(signal.SIGINT)
        done.append(inbox.get())
        try:
            raise inbox.get()
        finally:
            signal.raise_signal(signal.SIGINT)  # a second one does not disturb the cleaning up
            done.append("clean")
    assert done == ["row", "clean"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


# --- in this process -------------------------------------------------------------------------

MOMENTS = ["a row is sent", "a row is written", "a row is reported", "a worker is lost"]


class Ended:
    """Stands for processes that run rows, of which an event ends the study."""

    ahead = 3

    def __init__(self, job: Job, moment: str = "", count: int = 0) -> None:
        """Make one that ends at the `count`-th time of a moment."""
        self.job, self.moment, self.left = job, moment, count
        self.ran, self.safe = set(), set()

    def at(self, moment: str) -> bool:
        """Return whether this is the end: the rows that have run until now must be kept."""
        self.left -= moment == self.moment
        if moment != self.moment or self.left != 0:
            return False
        self.safe = set(self.ran)
        if moment != "a worker is lost":
            signal.raise_signal(signal.SIGINT)
        return True

    def submit(self, number: int, inputs) -> Future[Row]:
        future = Future()
        self.at("a row is sent")
        if self.at("a worker is lost"):
            future.set_exception(InputError("lost"))
            return future
        future.set_result(row_of(self.job, number))
        self.ran.add(number)
        return future

    def close(self) -> None:
        if self.safe:
            signal.raise_signal(signal.SIGINT)  # again, while it ends


def row_of(job: Job, number: int) -> Row:
    if number % 3 == 2:
        return Row(number, "failed", f"reason {number}", 0.1, ())
    return Row(number, "ok", "", 0.1, (number / 3,) * len(job.outcomes))


@pytest.fixture(scope="module")
def job(files):
    return make_job(*load_study(files / "few.yaml"))


@settings(max_examples=15)
@given(
    st.sets(st.integers(0, 5)),
    st.lists(st.tuples(st.sampled_from(MOMENTS), st.integers(1, 4)), max_size=3),
)
def test_a_study_that_was_ended_anywhere_and_resumed_has_the_same_rows(job, done, ends):
    with TemporaryDirectory() as temporary, pytest.MonkeyPatch.context() as patch:
        folder = Path(temporary, "few")
        with opened(job, folder, resume=False) as store:
            for number in done:
                store.append(row_of(job, number), job.study.inputs(number))
            append, kept = Store.append, store.done()
        for backend in [*(Ended(job, *end) for end in ends), Ended(job)]:

            def written(store, row, inputs, at=backend.at):
                append(store, row, inputs)
                at("a row is written")

            patch.setattr(Store, "append", written)
            patch.setattr("sdt_drake.studies.pool.Pool", lambda *_, made=backend: made)
            report = lambda *_, at=backend.at: at("a row is reported")  # noqa: E731
            with contextlib.suppress(KeyboardInterrupt, InputError):
                run_study(job, folder, resume=True, report=report)
            with Store(folder) as store:
                assert store.done() >= kept | backend.safe
                assert not backend.ran & kept  # none is done again
                kept = store.done()
        found = rows(folder).to_pylist()
    for number, row in enumerate(found):
        expected = row_of(job, number)
        values = expected.outcomes or [None] * len(job.outcomes)
        assert row == {
            "row": number,
            **job.study.inputs(number),
            "status": expected.status,
            "reason": expected.reason,
            **dict(zip(job.outcomes, values, strict=True)),
        }
    assert len(found) == len(job.study)


# --- as a user does --------------------------------------------------------------------------


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="needs /proc")
def test_ctrl_c_and_resume(desk, undisturbed, capfd):
    """Beside files that are called like modules that are needed."""
    for name in ("random", "copy", "numpy", "argparse", "logging", "table"):
        (desk / f"{name}.py").write_text("raise RuntimeError('a wrong module')")
    (desk / "temporary").mkdir()
    process = subprocess.Popen(
        [sys.executable, "-m", "sdt_drake", "study", "many.yaml"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "TMPDIR": str(desk / "temporary")},
        start_new_session=True,
    )
    while int(process.stdout.readline().split()[0]) < 2:  # rows are done
        pass
    process.send_signal(signal.SIGSTOP)  # so that it is not done before we have looked
    assert main(["study", "many.yaml", "--resume"]) == 2
    assert "many: another process runs this study" in capfd.readouterr().err
    process.send_signal(signal.SIGCONT)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to all that listen
    _, err = process.communicate()
    assert (process.returncode, err) == (130, "")
    for path in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(ProcessLookupError):
            if os.getsid(int(path.name)) == process.pid:
                wait_for_end(int(path.name))
    assert not any((desk / "temporary").iterdir())

    with Store(desk / "many") as store:
        there = len(store.done())
    assert 2 <= there < RUNS and not (desk / "many" / "results.parquet").exists()
    assert main(["study", "many.yaml", "--resume", "--workers", "2"]) == 0
    assert capfd.readouterr().out.startswith(f"{there} of {RUNS} runs\n")
    assert rows(desk / "many").equals(rows(undisturbed))
