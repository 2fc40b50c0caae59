"""Output of commands: lines, tables, a progress bar; plain text without a terminal."""

from __future__ import annotations

import os
import shutil
import sys
import textwrap
import time
from collections.abc import Iterable, Sequence
from typing import IO, TYPE_CHECKING, Any

from rich.console import Console
from rich.text import Text

from sdt_drake.io.shown import aligned, by_joint, fitting, terminal_width

if TYPE_CHECKING:
    from rich.progress import Progress

    from sdt_drake.show.sections import Table

_BAR_DELAY = 2.0  # s; shorter work shows no bar

_MIN_WIDTH, _MAX_WIDTH = 20, 500  # characters; rich never ends a line of 0, 1 or 2


def line_width() -> int:
    """Return the width of the terminal, or $COLUMNS, within 20 to 500 characters."""
    return min(max(terminal_width(), _MIN_WIDTH), _MAX_WIDTH)


class _Console(Console):
    """A console that goes on without output after its reader has ended."""

    def on_broken_pipe(self) -> None:  # rich's own raises SystemExit
        stop_printing(self.file)


def _console(*, stderr: bool = False) -> Console:
    """Make a console without rich's own reading of $COLUMNS and $LINES."""
    height = max(shutil.get_terminal_size().lines, 1)
    return _Console(width=line_width(), height=height, stderr=stderr)


console, errors = _console(), _console(stderr=True)


class Bar:
    """The progress bar of a command. Without a terminal it draws nothing."""

    def __init__(self, terminal: Console = errors, delay: float = _BAR_DELAY) -> None:
        self._terminal, self._delay = terminal, delay
        self._progress: Progress | None = None
        self.begin()

    def begin(self) -> None:
        """Start the time of a new command."""
        self._start = time.monotonic()

    def report(self, done: float, text: str = "") -> None:
        """Show the share of the work that is done, 0 (it begins) to 1, with a text."""
        if not 0 < done < 1:
            self.end()
        elif self._terminal.is_terminal and time.monotonic() > self._start + self._delay:
            progress = self._progress or _progress(self._terminal)
            progress.update(progress.task_ids[0], completed=done, description=text)
            if self._progress is None:
                self._progress = progress
                progress.start()

    def end(self) -> None:
        """Remove the bar, so that other lines can be printed."""
        if self._progress is not None:
            self._progress.stop()
            self._progress = None


def _progress(terminal: Console) -> Progress:
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TimeRemainingColumn

    columns = BarColumn(), TaskProgressColumn(), TimeRemainingColumn(), "{task.description}"
    progress = Progress(*columns, console=terminal, transient=True, redirect_stdout=False)
    progress.add_task("", total=1.0)
    return progress


bar = Bar()
"""The progress bar of the running command."""


def asked(question: str) -> bool:
    """Ask on a terminal, and return whether the answer is yes; False where nobody can be asked."""
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        return False
    bar.end()
    print(f"{question} [y/N] ", end="", file=sys.stderr, flush=True)
    return sys.stdin.readline().strip().lower() in ("y", "yes")


def echo(text: str = "", style: str = "") -> None:
    """Print a line, wrapped on a terminal.

    After the reader of a pipe has ended, nothing more is printed; files are still written.
    """
    bar.end()
    try:
        if console.is_terminal:
            console.print(Text(text, style))
        else:
            print(text, flush=True)
    except BrokenPipeError:
        stop_printing(sys.stdout)


def stop_printing(stream: IO[str]) -> None:
    """Send the rest of a stream's output to the null device, because its reader has ended."""
    # Otherwise Python would report the broken pipe again at exit.
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def echo_wrapped(text: str, first: str = "", rest: str = "  ", width: int = 96) -> None:
    """Print text in lines of at most `width` characters.

    `first` and `rest` are the beginnings of the first line and of the others.
    """
    width = min(width, console.width) if console.is_terminal else width
    for line in textwrap.wrap(text, width, initial_indent=first, subsequent_indent=rest):
        echo(line)


def print_table(header: Sequence[str], rows: Sequence[Sequence[str]], keys: int = 1) -> None:
    """Print aligned columns, no wider than the terminal; see `aligned`."""
    header, rows = fitting(header, rows, keys)
    for k, block in enumerate("\n".join(aligned(header, rows, keys)).split("\n\n")):
        if k:
            echo()
        lines = block.split("\n")
        for left, line in zip(range(len(lines), 0, -1), lines, strict=True):
            echo(line, "bold" if left > len(rows) else "")


def print_document_table(table: Table) -> None:
    """Print a table of a report."""
    print_table(table.header, table.rows)


def print_joints(names: Sequence[str], columns: Sequence[tuple[str, str, Iterable[Any]]]) -> None:
    """Print a table with a row for each joint.

    Args:
        names: names of the joints.
        columns: header, format and values, one for each joint; NaN becomes a dash.
    """
    print_table(*by_joint(names, columns))
