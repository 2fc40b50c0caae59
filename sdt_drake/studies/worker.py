"""The process of a worker, which `workers` starts with the arguments DESCRIPTOR FOLDER."""

from __future__ import annotations

import logging
import os
import shutil
import sys
import threading
from multiprocessing.connection import Connection
from pathlib import Path


def main() -> None:
    """Receive a job, then tasks; send what becomes of their rows.

    DESCRIPTOR is that of the connection; files of the job go into FOLDER.
    """
    threading.Thread(target=_end_with_parent, daemon=True).start()
    connection = Connection(int(sys.argv[1]))
    logging.getLogger("drake").addFilter(lambda record: False)  # it also logs what it raises
    try:
        from sdt_drake.studies.workers import READY

        connection.send(READY)
        runner = connection.recv().runner(Path(sys.argv[2]))
        connection.send(READY)
        while True:
            connection.send(runner.run(connection.recv()))
    except (EOFError, BrokenPipeError, ConnectionResetError):
        _end()  # nobody wants more


def _end_with_parent() -> None:
    # Not through sys.stdin, whose lock this thread would still have when Python ends.
    os.read(0, 1)
    _end()


def _end() -> None:
    shutil.rmtree(sys.argv[2], ignore_errors=True)
    os._exit(0)
