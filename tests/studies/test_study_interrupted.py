"""Whatever ends a study on its way: nothing is lost, and no process stays behind."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from odd_job import wait_for_end
from small_studies import RUNS, rows

from sdt_drake.cli.app import main
from sdt_drake.studies.store import Store

pytestmark = pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="needs /proc")


class Running:
    """`sdt-drake study many.yaml` in a session of its own."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self.folder, self.temporary = folder / "many", folder / "temporary"
        self.temporary.mkdir(exist_ok=True)
        self.process = subprocess.Popen(
            [sys.executable, "-m", "sdt_drake", "study", "many.yaml", *arguments],
            cwd=folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "TMPDIR": str(self.temporary)},
            start_new_session=True,
        )

    @property
    def rows(self) -> int:
        with Store(self.folder) as store:
            return len(store.done())

    def wait_for(self, rows: int) -> None:
        """Wait until the command prints that so many rows are finished."""
        while int(self.process.stdout.readline().split()[0]) < rows:
            pass

    def ended(self) -> tuple[int, str]:
        """Exit code and what it said, once its session and its files are gone."""
        _, err = self.process.communicate()
        for path in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(ProcessLookupError):
                if os.getsid(int(path.name)) == self.process.pid:
                    wait_for_end(int(path.name))
        assert not any(self.temporary.iterdir())
        return self.process.returncode, err


def test_ended_again_and_again(desk, undisturbed, capfd):
    """Beside files that are called like modules that are needed."""
    for name in ("random", "copy", "numpy", "argparse", "logging", "table"):
        (desk / f"{name}.py").write_text("raise RuntimeError('a wrong module')")

    first = Running(desk)
    first.wait_for(2)
    first.process.send_signal(signal.SIGSTOP)  # so that it is not done before we have looked
    assert main(["study", "many.yaml", "--resume"]) == 2
    assert "many: another process runs this study" in capfd.readouterr().err
    first.process.send_signal(signal.SIGCONT)
    os.killpg(first.process.pid, signal.SIGINT)  # as a terminal does: to all that listen
    assert first.ended() == (130, "")
    there = first.rows
    assert 2 <= there < RUNS and not (desk / "many" / "results.parquet").exists()

    second = Running(desk, "--resume")
    second.wait_for(there + 2)
    second.process.kill()
    assert second.ended()[0] == -signal.SIGKILL
    there = second.rows

    assert main(["study", "many.yaml", "--resume"]) == 0
    assert capfd.readouterr().out.startswith(f"{there} of {RUNS} runs\n")
    assert second.rows == RUNS  # none was done again
    assert rows(desk / "many").equals(rows(undisturbed))
