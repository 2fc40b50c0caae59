"""How far long work is: shares of shares add up, and the line on the terminal."""

from __future__ import annotations

import io
import itertools
from types import SimpleNamespace

import pytest

from sdt_drake.analysis.threads import threads
from sdt_drake.cli import bar as module
from sdt_drake.cli.bar import Bar
from sdt_drake.io.progress import as_part, part, watching, with_outermost_progress, with_progress


@pytest.fixture
def seen():
    """What is told to who watches."""
    seen = []
    with watching(seen.append):
        yield seen


def test_shares_of_shares_add_up(seen):
    with part():
        with part(0.5) as tell:
            tell(0.5)
        with part(0.5):
            for _ in with_progress("ab"):
                assert list(with_outermost_progress("ab")) == [
                    "a",
                    "b",
                ]  # within other work it tells nothing
    assert seen == [0, 0.25, 0.5, 0.5, 0.75, 1, 1, 1]
    seen.clear()
    list(with_outermost_progress(range(2)))  # other work begins anew
    assert seen == [0, 0, 0.5, 1]


def test_threads_work_on_parts_of_what_is_around_them(seen):
    with part(), threads(2) as pool:
        list(pool.map(as_part(lambda k: list(with_progress(range(k))), 1 / 3), [1, 2, 4]))
    assert seen[-1] == pytest.approx(1) and seen == sorted(seen)
    assert {round(12 * x, 9) for x in seen} > {0, 4, 8, 12}


def test_nobody_watches():
    with part() as tell:
        tell(0.5)
    assert list(with_outermost_progress([1, 2])) == [1, 2]


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
