"""Whatever ends a study on its way: nothing is lost, and no process stays behind."""

import math
import os
import signal
import sys
from collections.abc import Iterable
from concurrent.futures import Future
from pathlib import Path
from subprocess import PIPE, Popen
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from helpers.odd_job import wait_for_end
from helpers.small_studies import rows
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from sdt_drake.cli.app import main
from sdt_drake.io.errors import InputError
from sdt_drake.studies.execute import run_study
from sdt_drake.studies.folder import opened
from sdt_drake.studies.job import Job, make_job
from sdt_drake.studies.store import About, Store, create
from sdt_drake.studies.study import load_study
from sdt_drake.studies.table import Row

# --- rows on disk ----------------------------------------------------------------------------

INPUTS = {"a": 0.1, 'b "c"': "text"}
ABOUT = About({"study.yaml": "a"}, {"own.py": "files/1/own.py"}, {"drake": "1.51"})
ROWS = [
    Row(2, "ok", "", 0.1, (1 / 3, math.nan)),
    Row(0, "failed", "ünexpected \u2028 \\ '", 0.2, ()),
    Row(3, "ok", "", 1e-7, (1e300, 5e-324)),
]


@pytest.fixture
def written(tmp_path):
    create(tmp_path, ABOUT, {"a": False, 'b "c"': True}, ["x", "y"])
    with Store(tmp_path) as store:
        for row in ROWS:
            store.append(row, INPUTS)
    return tmp_path


def test_stored_rows_come_back_exactly_and_in_order(written):
    with Store(written) as store:
        found = store.runs()
        assert store.done() == {0, 2, 3} and store.about == ABOUT
        assert store.inputs(2) == INPUTS and store.inputs(1) == {}
    assert [*found.index] == [0, 2, 3] and [*found["status"]] == ["failed", "ok", "ok"]
    assert [*found["reason"]] == [ROWS[1].reason, "", ""]
    assert [*found["duration"], *found["a"]] == [0.2, 0.1, 1e-7] + [0.1] * 3
    outcomes = [math.nan, 1 / 3, 1e300, math.nan, math.nan, 5e-324]
    np.testing.assert_array_equal([*found["x"], *found["y"]], outcomes)


def test_full_disk_ends_a_study_that_can_be_resumed(written):
    with Store(written) as store:
        ((pages,),) = store._database.execute("PRAGMA page_count")
        store._database.execute(f"PRAGMA max_page_count = {pages}")
        with pytest.raises(InputError, match=r"written \(database or disk is full\); \d+ runs are"):
            for number in range(4, 100):
                store.append(Row(number, "ok", 500 * "x", 0.5, (1.0, 2.0)), INPUTS)
        kept = store.done()
    assert kept == {0, 2, *range(3, max(kept) + 1)} and 3 < max(kept) < 99


# --- ended in this process -------------------------------------------------------------------

MOMENTS = ["a row is sent", "a row is written", "a row is reported", "a worker is lost"]


class Processes:
    """Stands for processes that run rows, until something ends the study."""

    ahead = 3

    def __init__(self, job: Job, moment: str = "", left: int = 1) -> None:
        """End the study when a moment has come so often; by default not at all."""
        self.job, self.moment, self.left = job, moment, left
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
        else:
            future.set_result(row_of(self.job, number))
            self.ran.add(number)
        return future

    def close(self) -> None:
        if self.left <= 0:
            signal.raise_signal(signal.SIGINT)  # again, while it ends

    def run(self, folder: Path) -> set[int]:
        """Run the study; return the rows that its folder has then."""
        append = Store.append

        def written(store, row, inputs):
            append(store, row, inputs)
            self.at("a row is written")

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Store, "append", written)
            patch.setattr("sdt_drake.studies.pool.Pool", lambda *_: self)
            try:
                run_study(self.job, folder, resume=True, report=lambda *_: self.at(MOMENTS[2]))
            except (KeyboardInterrupt, InputError):
                assert self.left <= 0
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
        with Store(folder) as store:
            return store.done()


def row_of(job: Job, number: int) -> Row:
    if number % 3 == 2:
        return Row(number, "failed", f"reason {number}", 0.1, ())
    return Row(number, "ok", "", 0.1, (number / 3,) * len(job.outcomes))


def begun(job: Job, folder: Path, done: Iterable[int]) -> Path:
    with opened(job, folder, resume=False) as store:
        for number in done:
            store.append(row_of(job, number), job.study.inputs(number))
    return folder


@settings(max_examples=10, phases=[Phase.generate])  # to shrink takes minutes
@given(
    st.sets(st.integers(0, 5)),
    st.lists(st.tuples(st.sampled_from(MOMENTS), st.integers(1, 4)), max_size=3),
)
def test_study_resumed_from_any_kill_has_the_same_rows(files, done, ends):
    """No row that was finished is lost or done again, also if Ctrl-C comes twice."""
    job = make_job(*load_study(files / "few.yaml"))
    with TemporaryDirectory() as temporary:
        folder = begun(job, Path(temporary, "few"), done)
        for end in [*ends, ()]:
            processes = Processes(job, *end)
            kept, done = done, processes.run(folder)
            assert done >= kept | processes.safe and not processes.ran & kept
        whole = begun(job, Path(temporary, "whole"), ())
        Processes(job).run(whole)
        assert rows(folder).equals(rows(whole)) and len(done) == len(job.study)


# --- ended in a process of its own -----------------------------------------------------------


@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="needs /proc")
def test_ctrl_c_keeps_rows_ends_processes_and_can_be_resumed(desk, undisturbed, undrawn):
    """As in a terminal, which sends Ctrl-C to the command and its processes at once."""
    line = ["study", "run", "many.yaml", "--workers"]
    command = [sys.executable, "-m", "sdt_drake", *line, "2"]
    environment = os.environ | {"PYTHONUNBUFFERED": "1"}
    with Popen(command, stdout=PIPE, text=True, env=environment, start_new_session=True) as study:
        while not study.stdout.readline().startswith("2 of 16 runs"):
            assert study.poll() is None
        children = Path(f"/proc/{study.pid}/task/{study.pid}/children").read_text().split()
        assert len(children) >= 2
        os.killpg(study.pid, signal.SIGINT)
        rest = study.stdout.read()
    assert study.returncode == 130
    assert "finished runs are kept. To continue, add --resume --out many\n" in rest
    for process in map(int, children):
        wait_for_end(process)
    with Store(desk / "many") as store:
        kept = store.runs()
    assert 2 <= len(kept) < 16
    assert main([*line, "1", "--resume"]) == 0
    assert rows(desk / "many").equals(rows(undisturbed))
    with Store(desk / "many") as store:
        assert store.runs().loc[kept.index].equals(kept)  # with their durations: not run again
