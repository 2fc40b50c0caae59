"""A job whose rows misbehave, for processes that need nothing else to be tested."""

import os
import select
import shutil
import signal
import sys
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path

from sdt_drake.io.versions import versions
from sdt_drake.studies.store import About
from sdt_drake.studies.table import Row


@dataclass
class OddJob:
    """Stands for a Job; `acts` has what happens in a row instead of it being run.

    "hang", "abort", "raise", "tidy slowly" from then on; "kill once", which leaves a file in
    `folder`.
    """

    folder: str
    acts: dict[int, str] = field(default_factory=dict)
    timeout: float = 30.0
    start: str = ""
    about: About = field(default_factory=lambda: About(versions=versions()))

    @property
    def study(self):
        return self  # with the timeout

    def runner(self, folder: Path):
        assert folder.is_dir()
        _act(self.start, Path(self.folder))
        return self

    def run(self, number: int, inputs: dict) -> Row:
        """A row whose outcomes are its number and that of the process."""
        _act(self.acts.get(number, ""), Path(self.folder))
        return Row(number, "ok", "", 0.5, (float(number), float(os.getpid())))


def _act(what: str, folder: Path) -> None:
    mark = folder / "was here"
    if what == "hang":
        (folder / "hangs").open("w").close()  # where it is a pipe, its reader sees that
        threading.Event().wait()
    elif what == "abort":
        os.write(2, b"a first line\nabort: matrix is singular\n")
        os.abort()
    elif what == "raise":
        raise RuntimeError("no start")
    elif what == "tidy slowly":
        remove = shutil.rmtree
        shutil.rmtree = lambda *args, **options: (time.sleep(0.5), remove(*args, **options))
    elif what == "kill once" and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)


def process_of(row: Row) -> int:
    return int(row.outcomes[1])


def wait_for_end(process: int) -> None:
    """Wait until a process has ended; it need not be a child of this one."""
    try:
        descriptor = os.pidfd_open(process)
    except ProcessLookupError:
        return
    assert select.select([descriptor], [], [], 60)[0]
    os.close(descriptor)


if __name__ == "__main__":  # a study whose second row may misbehave
    from sdt_drake.studies.pool import Pool

    pool = Pool(OddJob(sys.argv[1], {1: sys.argv[2]}, start="tidy slowly"))
    print(process_of(pool.submit(0, {}).result()), flush=True)
    pool.submit(1, {})
    threading.Event().wait()
