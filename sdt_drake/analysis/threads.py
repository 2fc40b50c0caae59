"""Simulations side by side: Drake steps without the interpreter's lock."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import copy_context
from typing import Any


class Threads(ThreadPoolExecutor):
    """A pool whose functions are parts of the work that is around their submission."""

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        return super().submit(copy_context().run, function, *args, **kwargs)


@contextmanager
def threads(count: int) -> Iterator[Threads]:
    """A pool that goes on after the block with what it has; not if that was interrupted."""
    pool = Threads(max_workers=count)
    try:
        yield pool
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        raise
    pool.shutdown(wait=False)
