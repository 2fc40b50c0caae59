"""How far long work is: the outermost work tells, on a line of the terminal."""

import io

from rich.console import Console

from sdt_drake.cli import printing


def test_the_bar_comes_late_and_goes_without_a_trace(monkeypatch):
    terminal, bar = io.StringIO(), printing.Bar()
    monkeypatch.setattr(printing, "errors", Console(file=terminal, force_terminal=True, width=80))
    bar.report(0.1)
    assert terminal.getvalue() == ""  # a command of 2 s needs none
    monkeypatch.setattr(printing, "_BAR_DELAY", -1.0)
    bar.report(0.25, "3 of 12 runs")
    assert " 25%" in terminal.getvalue() and "3 of 12 runs" in terminal.getvalue()
    bar.end()
    assert terminal.getvalue().endswith("\x1b[2K")  # the line is wiped out
