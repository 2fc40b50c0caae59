"""How far long work is, told to whoever watches it: the command line does.

with part():  # all of it
    for design in designs:
        with part(1 / len(designs)) as tell:
            tell(0.5)  # half of this one is done
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import wraps
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")

Tell = Callable[[float], None]
"""Called with the share of some work that is done, from 0 to 1."""

_LOOKS = 200  # of a loop, at least that many times it is told how far it is


_lock = threading.RLock()
_watch: ContextVar[Tell | None] = ContextVar("watch", default=None)
_add: ContextVar[Tell | None] = ContextVar("add", default=None)  # takes what more is done


@contextmanager
def watching(tell: Tell) -> Iterator[None]:
    """Within, `tell` gets to know how far the work is; 0 when some begins."""
    token = _watch.set(tell)
    try:
        yield
    finally:
        _watch.reset(token)


@contextmanager
def part(share: float = 1.0) -> Iterator[Tell]:
    """Work that is this share of what is around it; gives what takes how much of it is done."""
    around, done = _add.get() or _beginning(), 0.0

    def add(more: float) -> None:
        nonlocal done
        more = min(more, 1.0 - done)
        done += more
        around(share * more)

    def tell(by_now: float) -> None:
        with _lock:
            add(by_now - done)

    token = _add.set(add)
    try:
        yield tell
    finally:
        _add.reset(token)
    tell(1.0)


def _beginning() -> Tell:
    """What is around work that is no share of any other: who watches sees it begin."""
    watch, done = _watch.get(), 0.0

    def add(more: float) -> None:
        nonlocal done
        done = min(done + more, 1.0)
        if watch is not None:
            watch(done)

    add(0.0)
    return add


def with_progress(items: Collection[T]) -> Iterator[T]:
    """The items of a loop, all like much work that tells nothing itself."""
    every = max(1, len(items) // _LOOKS)
    with part() as tell:
        for i, item in enumerate(items):
            if i % every == 0:
                tell(i / len(items))
            yield item


def with_outermost_progress(items: Collection[T]) -> Iterator[T]:
    """The items of a loop that tells how far it is only where nothing around it does: for loops
    within many others."""
    return with_progress(items) if _add.get() is None else iter(items)


def as_part(function: Callable[P, T], share: float) -> Callable[P, T]:
    """The function, whose progress counts as this share of what is around its call."""

    @wraps(function)
    def within(*args: P.args, **kwargs: P.kwargs) -> T:
        with part(share):
            return function(*args, **kwargs)

    return within
