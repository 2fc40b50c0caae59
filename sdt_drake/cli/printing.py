"""What commands print: lines, tables, a progress bar; plain where there is no terminal."""

from __future__ import annotations

import os
import sys
import textwrap
import time
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, TextIO

from rich.console import Console
from rich.text import Text

from sdt_drake.io.shown import aligned, by_joint

if TYPE_CHECKING:
    from rich.progress import Progress

    from sdt_drake.show.documents import Table

_LATE = 2.0  # s; what is done earlier needs no bar


console, errors = Console(), Console(stderr=True)


class Bar:
    """The progress bar of a command; without a terminal it draws nothing."""

    def __init__(self) -> None:
        self._progress: Progress | None = None
        self.begin()

    def begin(self) -> None:
        """Tell that a command begins."""
        self._start = time.monotonic()

    def tell(self, done: float, text: str = "") -> None:
        """Take how much is done, from 0 to 1, 0 when some work begins, and what to say of it."""
        if not 0 < done < 1:
            self.end()
        elif errors.is_terminal and time.monotonic() > self._start + _LATE:
            progress = self._progress or _progress()
            progress.update(progress.task_ids[0], completed=done, description=text)
            if self._progress is None:
                self._progress = progress
                progress.start()

    def end(self) -> None:
        """Make room for other lines."""
        if self._progress is not None:
            self._progress.stop()
            self._progress = None


def _progress() -> Progress:
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TimeRemainingColumn

    columns = BarColumn(), TaskProgressColumn(), TimeRemainingColumn(), "{task.description}"
    progress = Progress(*columns, console=errors, transient=True, redirect_stdout=False)
    progress.add_task("", total=1.0)
    return progress


bar = Bar()
"""Of the command that runs."""


def say(text: str = "", style: str = "") -> None:
    """Print a line, on a terminal in lines of its width; whoever reads us may have enough, the
    results are written all the same."""
    bar.end()
    try:
        if console.is_terminal:
            console.print(Text(text, style))
        else:
            print(text, flush=True)
    except BrokenPipeError:
        stop_printing(sys.stdout)


def stop_printing(stream: TextIO) -> None:
    """Send the rest of the output nowhere: its reader is gone."""
    # Python would complain once more at exit.
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def say_wrapped(text: str, first: str = "", rest: str = "  ", width: int = 96) -> None:
    """Print running text in lines of at most so many characters, with what they begin with."""
    width = min(width, console.width) if console.is_terminal else width
    for line in textwrap.wrap(text, width, initial_indent=first, subsequent_indent=rest):
        say(line)


def print_table(header: Sequence[str], rows: Sequence[Sequence[str]], keys: int = 1) -> None:
    """Print aligned columns, no wider than the terminal; see `aligned`."""
    for k, block in enumerate("\n".join(aligned(header, rows, keys)).split("\n\n")):
        if k:
            say()
        lines = block.split("\n")
        for left, line in zip(range(len(lines), 0, -1), lines, strict=True):
            say(line, "bold" if left > len(rows) else "")


def print_document_table(table: Table) -> None:
    """Print a table of a report."""
    print_table(table.header, table.rows)


def print_joints(names: Sequence[str], columns: Sequence[tuple[str, str, Iterable[Any]]]) -> None:
    """Print a table with a row for each joint.

    Args:
        names: of the joints.
        columns: header, format and a value for each joint; NaN is a dash.
    """
    print_table(*by_joint(names, columns))
