"""Whatever ends a study on its way: nothing is lost, and no process stays behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pyarrow.parquet
import pytest
from small_studies import RUNS, rows
from test_main import DRIVER

from sdt_drake.cli.app import main
from sdt_drake.studies.folder import holds_study
from sdt_drake.studies.store import Store

pytestmark = pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="needs /proc")


class Running:
    """`sdt-drake study many.yaml` in a process of its own."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self.folder, self.temporary = folder / "many", folder / "temporary"
        self.temporary.mkdir(exist_ok=True)
        self.process = subprocess.Popen(
            [sys.executable, *arguments],
            cwd=folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "TMPDIR": str(self.temporary)},
            start_new_session=True,
        )

    @property
    def rows(self) -> int:
        if not holds_study(self.folder):
            return 0
        with Store(self.folder) as store:
            return len(store.done())

    def wait_for(self, rows: int) -> None:
        while self.rows < rows:
            assert self.process.poll() is None
            time.sleep(0.01)

    def processes(self) -> list[int]:
        """Its own and all others of its session."""
        found = []
        for path in Path("/proc").glob("[0-9]*"):
            try:
                _, _, _, session = (path / "stat").read_text().rpartition(")")[2].split()[:4]
            except OSError:
                continue
            if int(session) == self.process.pid:
                found.append(int(path.name))
        return found

    def ended(self) -> tuple[int, str]:
        """Exit code and what it said, once all its processes and their files are gone."""
        _, err = self.process.communicate()
        while self.processes() or any(self.temporary.iterdir()):
            time.sleep(0.02)
        return self.process.returncode, err


def test_ended_again_and_again(desk, undisturbed, capfd):
    """Beside files that are called like modules that are needed."""
    for name in ("random", "copy", "numpy", "argparse", "logging", "table"):
        (desk / f"{name}.py").write_text("raise RuntimeError('a wrong module')")

    first = Running(desk, "-m", "sdt_drake", "study", "many.yaml")
    first.wait_for(2)
    first.process.send_signal(signal.SIGSTOP)  # so that it is not done before we have looked
    assert main(["study", "many.yaml", "--resume"]) == 2
    assert capfd.readouterr() == ("", "sdt-drake: many: another process runs this study\n")
    first.process.send_signal(signal.SIGCONT)
    os.killpg(first.process.pid, signal.SIGINT)  # as a terminal does: to all that listen
    assert first.ended() == (130, "")
    there = first.rows
    assert 2 <= there < RUNS and not (desk / "many" / "results.parquet").exists()

    second = Running(desk, "-m", "sdt_drake", "study", "many.yaml", "--resume")
    second.wait_for(there + 2)
    second.process.kill()
    assert second.ended()[0] == -signal.SIGKILL
    there = second.rows

    assert main(["study", "many.yaml", "--resume"]) == 0
    assert capfd.readouterr().out.startswith(f"{there} of {RUNS} runs\n")
    assert second.rows == RUNS  # none was done again
    assert rows(desk / "many").equals(rows(undisturbed))


@pytest.mark.parametrize(
    ("event", "word"),
    [
        ("import", "sdt_drake.studies.execute"),
        ("sqlite3.connect", "study.sqlite"),
        ("import", "multiprocessing.popen_spawn_posix"),
    ],
)
def test_interrupted_while_it_starts(desk, event, word):
    command = ("sdt-drake", "study", "many.yaml", "--workers", "2")
    running = Running(desk, "-c", DRIVER, str(int(signal.SIGINT)), event, word, *command)
    assert running.ended() == (130, "") and (desk / "seen").exists()


HURRIED = """
import runpy, sys, time
real = time.sleep
time.sleep = lambda seconds: real(0 if seconds > 0.5 else seconds)  # all its patience
sys.argv = ["sdt-drake", *sys.argv[1:]]
runpy.run_module("sdt_drake", run_name="__main__", alter_sys=True)
"""


def test_ended_in_a_hurry(desk):
    """By force, where tidying up takes longer than its patience."""
    running = Running(desk, "-c", HURRIED, "study", "many.yaml", "--workers", "2")
    running.wait_for(4)
    running.process.send_signal(signal.SIGINT)
    assert running.ended() == (130, "")


def test_full_disk_at_the_results(copied, files, monkeypatch, capfd):
    """The old results stay until the new ones are whole."""
    before = (copied / "results.parquet").read_bytes()

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(pyarrow.parquet.ParquetWriter, "write_table", full)
    assert main(["study", str(files / "many.yaml"), "--out", str(copied), "--resume"]) == 2
    assert "results.parquet: cannot be written (No space left" in capfd.readouterr().err
    assert (copied / "results.parquet").read_bytes() == before
    assert not list(copied.glob(".*"))
