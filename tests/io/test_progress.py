"""How far long work is: the outermost work tells, on a line of the terminal."""

import io

import pytest
from rich.console import Console

from sdt_drake.analysis.threads import threads
from sdt_drake.cli import printing
from sdt_drake.io.progress import watching, with_progress


def test_what_is_within_other_work_is_silent():
    seen = []
    with watching(seen.append):
        for _ in with_progress("abcd"):
            assert list(with_progress("ab")) == ["a", "b"]
            with threads(1) as pool:
                assert list(pool.map(lambda k: list(with_progress(range(k))), [2])) == [[0, 1]]
        list(with_progress(iter("abc"), 3))  # other work begins anew
        assert seen == pytest.approx([0, 0, 0.25, 0.5, 0.75, 1, 0, 0, 1 / 3, 2 / 3, 1])
        seen.clear()
        list(with_progress(range(10_000)))
        assert 200 <= len(seen) <= 203


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
