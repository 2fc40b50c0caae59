"""Progress of long computations, reported to a watcher such as the command line.

for design in with_progress(designs):
    ...  # nested computations do not report their own progress
"""

from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

T = TypeVar("T")

Report = Callable[[float], None]
"""A function called with the completed share of the work, from 0 to 1."""

_MIN_REPORTS = 200  # per loop


def _nobody(done: float) -> None:
    """Ignore a report."""


_watch: ContextVar[Report] = ContextVar("watch", default=_nobody)  # one for each thread


@contextmanager
def watching(report: Report) -> Iterator[None]:
    """Report progress in the block to `report`. Each outermost work starts with 0."""
    token = _watch.set(report)
    try:
        yield
    finally:
        _watch.reset(token)


@contextmanager
def work() -> Iterator[Report]:
    """Yield a function that reports progress. Nested work and other threads do not report."""
    report = _watch.get()
    with watching(_nobody):
        report(0.0)
        yield report
        report(1.0)


def with_progress(items: Iterable[T], count: int | None = None) -> Iterator[T]:
    """Iterate over items of equal cost and report progress.

    Args:
        items: the items of the loop.
        count: their number, if they have no length.
    """
    count = len(items) if isinstance(items, Collection) else count or 1
    every = max(1, count // _MIN_REPORTS)
    with work() as report:
        for i, item in enumerate(items):
            if i % every == 0:
                report(i / count)
            yield item
