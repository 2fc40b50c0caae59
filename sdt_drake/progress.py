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


class _Part:
    """A share of other work."""

    def __init__(self, outer: _Part | None, share: float) -> None:
        self._outer, self._share, self._done = outer, share, 0.0

    def tell(self, done: float) -> None:
        with _lock:
            self._add(done - self._done)

    def _add(self, more: float) -> None:
        more = min(more, 1.0 - self._done)
        self._done += more
        if self._outer is not None:
            self._outer._add(self._share * more)


class _Whole(_Part):
    """What is watched; anew for every part that is no share of another one."""

    def __init__(self, tell: Tell) -> None:
        super().__init__(None, 1.0)
        self._tell = tell

    def _add(self, more: float) -> None:
        super()._add(more)
        self._tell(self._done)

    def begin(self) -> None:
        self._done = 0.0
        self._tell(0.0)


_lock = threading.RLock()
_now: ContextVar[_Part | None] = ContextVar("work", default=None)


@contextmanager
def watching(tell: Tell) -> Iterator[None]:
    """Within, `tell` gets to know how far the work is; 0 when some begins."""
    token = _now.set(_Whole(tell))
    try:
        yield
    finally:
        _now.reset(token)


@contextmanager
def part(share: float = 1.0) -> Iterator[Tell]:
    """Work that is this share of what is around it; gives what takes how much of it is done."""
    outer = _now.get()
    own = _Part(outer, share)
    if isinstance(outer, _Whole):
        outer.begin()
    token = _now.set(own)
    try:
        yield own.tell
    finally:
        _now.reset(token)
    own.tell(1.0)


def told(items: Collection[T]) -> Iterator[T]:
    """The items of a loop, all like much work that tells nothing itself."""
    every = max(1, len(items) // _LOOKS)
    with part() as tell:
        for i, item in enumerate(items):
            if i % every == 0:
                tell(i / len(items))
            yield item


def told_alone(items: Collection[T]) -> Iterator[T]:
    """The same where nothing around tells how far it is: for loops within many others."""
    return told(items) if isinstance(_now.get(), _Whole) else iter(items)


def as_part(function: Callable[P, T], share: float) -> Callable[P, T]:
    """The same function, as this share of what is around its call."""

    @wraps(function)
    def within(*args: P.args, **kwargs: P.kwargs) -> T:
        with part(share):
            return function(*args, **kwargs)

    return within
