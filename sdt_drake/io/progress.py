"""Progress of long computations, reported to a watcher such as the command line.

for design in with_progress(designs):
    ...  # nested computations do not report their own progress
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

T = TypeVar("T")

Tell = Callable[[float], None]
"""A function called with the completed share of the work, from 0 to 1."""

_MIN_REPORTS = 200  # per loop


def _nobody(done: float) -> None:
    """Ignore a report."""


_watch: ContextVar[Tell] = ContextVar("watch", default=_nobody)  # one for each thread


@contextmanager
def watching(tell: Tell) -> Iterator[None]:
    """Report progress in the block to `tell`. Each outermost work starts with 0."""
    token = _watch.set(tell)
    try:
        yield
    finally:
        _watch.reset(token)


@contextmanager
def work() -> Iterator[Tell]:
    """Yield a function that reports progress. Nested work and other threads do not report."""
    tell = _watch.get()
    with watching(_nobody):
        tell(0.0)
        yield tell
        tell(1.0)


def with_progress(items: Iterable[T], count: int | None = None) -> Iterator[T]:
    """Iterate over items of equal cost and report progress.

    Args:
        items: the items of the loop.
        count: their number, if they have no length.
    """
    count = len(items) if isinstance(items, Collection) else count or 1
    every = max(1, count // _MIN_REPORTS)
    with work() as tell:
        for i, item in enumerate(items):
            if i % every == 0:
                tell(i / count)
            yield item
