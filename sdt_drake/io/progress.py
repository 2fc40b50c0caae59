"""How far long work is, told to whoever watches it: the command line does.

for design in with_progress(designs):
    ...  # what tells its progress elsewhere is silent here
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

T = TypeVar("T")

Tell = Callable[[float], None]
"""Called with the share of some work that is done, from 0 to 1."""

_LOOKS = 200  # of a loop, at least that many times it is told how far it is


def _nobody(done: float) -> None:
    """Watch nothing."""


_watch: ContextVar[Tell] = ContextVar("watch", default=_nobody)  # of this thread alone


@contextmanager
def watching(tell: Tell) -> Iterator[None]:
    """Within, `tell` gets to know how far the work is; 0 when some begins."""
    token = _watch.set(tell)
    try:
        yield
    finally:
        _watch.reset(token)


@contextmanager
def work() -> Iterator[Tell]:
    """Work that tells how far it is; nothing within it does, nor do other threads."""
    tell = _watch.get()
    with watching(_nobody):
        tell(0.0)
        yield tell
        tell(1.0)


def with_progress(items: Iterable[T], count: int | None = None) -> Iterator[T]:
    """The items of a loop, all like much work; `count` of them, if they have no length."""
    count = len(items) if isinstance(items, Collection) else count or 1
    every = max(1, count // _LOOKS)
    with work() as tell:
        for i, item in enumerate(items):
            if i % every == 0:
                tell(i / count)
            yield item
