"""How far long work is: the outermost work tells, on a line of the terminal."""

from __future__ import annotations

import io
import itertools
from types import SimpleNamespace

import pytest

from sdt_drake.analysis.threads import threads
from sdt_drake.cli import bar as module
from sdt_drake.cli.bar import Bar
from sdt_drake.io.progress import watching, with_progress, work


@pytest.fixture
def seen():
    """What is told to who watches."""
    seen = []
    with watching(seen.append):
        yield seen


def test_what_is_within_other_work_is_silent(seen):
    for _ in with_progress("abcd"):
        assert list(with_progress("ab")) == ["a", "b"]
        with threads(1) as pool:
            assert list(pool.map(lambda k: list(with_progress(range(k))), [2])) == [[0, 1]]
    assert seen == [0, 0, 0.25, 0.5, 0.75, 1]
    seen.clear()
    assert list(with_progress(iter("abc"), 3)) == ["a", "b", "c"]  # other work begins anew
    assert seen == pytest.approx([0, 0, 1 / 3, 2 / 3, 1])
    seen.clear()
    list(with_progress(range(10_000)))
    assert 200 <= len(seen) <= 203


def test_nobody_watches():
    with work() as tell:
        tell(0.5)
    assert list(with_progress([1, 2])) == [1, 2]


def test_the_bar_comes_late_and_tells_what_is_left(monkeypatch):
    terminal = io.StringIO()
    terminal.isatty = lambda: True
    clock = itertools.count()  # a second for every look
    monkeypatch.setattr(module.sys, "stderr", terminal)
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: next(clock)))
    bar = Bar()  # 0 s
    bar.tell(0.0)  # 1 s
    bar.tell(0.1)  # 2 s: a command of 2 s needs none
    assert terminal.getvalue() == ""
    bar.tell(0.25)  # 3 s, 2 s since the work began: 6 s are left
    assert terminal.getvalue() == f"\r{7 * '█'}{23 * '░'} 25 %, 6 s left\x1b[K"
    bar.end()
    assert terminal.getvalue().endswith("left\x1b[K\r\x1b[K")
    bar.end()
    assert terminal.getvalue().count("\r") == 2
