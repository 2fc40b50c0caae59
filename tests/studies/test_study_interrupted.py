"""Whatever ends a study on its way: nothing is lost, and no process stays behind."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import pyarrow.parquet
import pytest
from small_studies import RUNS, rows
from test_main import DRIVER

from sdt_drake.cli import main
from sdt_drake.studies.results import read_study_table

pytestmark = pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="needs /proc")


class Running:
    """`sdt-drake study many.yaml` in a process of its own."""

    def __init__(self, folder: Path, *arguments, **options) -> None:
        self.folder, self.journal = folder, folder / "many" / "rows.jsonl"
        self.temporary = folder / "temporary"
        self.temporary.mkdir(exist_ok=True)
        self.process = subprocess.Popen(
            [sys.executable, "-m", "sdt_drake", "study", "many.yaml", "--workers", "2", *arguments],
            cwd=folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "TMPDIR": str(self.temporary)},
            start_new_session=True,
            **options,
        )

    def wait_for(self, rows: int) -> None:
        end = time.monotonic() + 60
        while not (self.journal.exists() and self.journal.read_bytes().count(b"\n") >= rows):
            assert self.process.poll() is None and time.monotonic() < end
            time.sleep(0.01)

    def workers(self) -> list[int]:
        return [
            int(path.name)
            for path in Path("/proc").glob("[0-9]*")
            if str(self.temporary) in _command(path)
        ]

    def end(self, with_signal: int) -> tuple[int, str, str]:
        """Exit code and what it printed, once all its processes are gone."""
        assert len(self.workers()) == 2
        if with_signal == signal.SIGINT:
            os.killpg(self.process.pid, with_signal)  # as a terminal does: to all that listen
        else:
            self.process.send_signal(with_signal)
        out, err = self.process.communicate(timeout=30)
        end = time.monotonic() + 5
        while self.workers() or any(self.temporary.iterdir()):
            assert time.monotonic() < end
            time.sleep(0.02)
        return self.process.returncode, out, err


def _command(process: Path) -> str:
    try:
        return (process / "cmdline").read_bytes().decode(errors="replace")
    except OSError:
        return ""


def finish(folder: Path) -> int:
    """Resume; how many runs were there before."""
    command = [
        sys.executable,
        "-m",
        "sdt_drake",
        "study",
        "many.yaml",
        "--resume",
        "--workers",
        "2",
    ]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")
    assert (folder / "many" / "rows.jsonl").read_bytes().count(b"\n") == RUNS  # none done again
    return int(done.stdout.split()[0])


@pytest.mark.parametrize("with_signal", [signal.SIGKILL, signal.SIGINT])
def test_main_process_ended_in_the_middle(desk, undisturbed, with_signal):
    running = Running(desk)
    running.wait_for(10)
    code, _, err = running.end(with_signal)
    there = running.journal.read_bytes().count(b"\n")

    assert code == (130 if with_signal == signal.SIGINT else -with_signal)
    assert err == "" and 10 <= there < RUNS
    assert not (desk / "many" / "results.parquet").exists()
    assert finish(desk) == there
    assert rows(desk / "many").equals(rows(undisturbed))


def test_worker_killed_in_the_middle(desk, undisturbed):
    running = Running(desk)
    for done in (5, 25):
        running.wait_for(done)
        os.kill(running.workers()[0], signal.SIGKILL)
    _, err = running.process.communicate(timeout=60)

    assert (running.process.returncode, err) == (0, "")
    assert rows(desk / "many").equals(rows(undisturbed))


@pytest.mark.parametrize(
    ("event", "word"),
    [
        ("import", "sdt_drake.studies.execute"),
        ("subprocess.Popen", sys.executable),
        ("open", "rows.jsonl"),
    ],
)
def test_interrupted_while_it_starts(desk, event, word):
    temporary = desk / "temporary"
    temporary.mkdir()
    arguments = ["sdt-drake", "study", "many.yaml", "--workers", "2"]
    done = subprocess.run(
        [sys.executable, "-c", DRIVER, str(int(signal.SIGINT)), event, word, *arguments],
        cwd=desk,
        capture_output=True,
        text=True,
        timeout=60,
        env={**os.environ, "TMPDIR": str(temporary)},
    )
    assert (done.returncode, done.stderr) == (130, "") and (desk / "seen").exists()
    assert not [path for path in Path("/proc").glob("[0-9]*") if str(temporary) in _command(path)]
    assert list(temporary.iterdir()) == []


def test_two_processes_on_one_folder(desk, undisturbed, capfd):
    first = Running(desk)
    first.wait_for(3)
    first.process.send_signal(signal.SIGSTOP)  # so that it is not done before we have looked
    assert main(["study", "many.yaml", "--resume"]) == 2
    assert capfd.readouterr() == ("", "sdt-drake: many: another process runs this study\n")

    first.process.send_signal(signal.SIGCONT)
    first.process.communicate(timeout=60)
    assert first.process.returncode == 0
    assert rows(desk / "many").equals(rows(undisturbed))


def _small_disk() -> None:
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, 10_000))


def test_full_disk(desk, undisturbed):
    running = Running(desk, preexec_fn=_small_disk)
    _, err = running.process.communicate(timeout=60)
    there = len(read_study_table(desk / "many"))

    assert running.process.returncode == 2
    assert err == (
        f"sdt-drake: many/rows.jsonl: cannot be written (File too large); {there} of 80 runs are "
        "kept, --resume goes on from there\n"
    )
    assert 5 < there < RUNS and running.workers() == []
    assert finish(desk) == there
    assert rows(desk / "many").equals(rows(undisturbed))


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
