"""Ctrl-C where a study waits, and nowhere else.

Elsewhere it would come between a run and its line on the disk, or into the start or the end of a
process, which would then stay.
"""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager

Waiting = Callable[[], AbstractContextManager]
"""Makes the context in which one waits, as `Interrupts.allowed` does."""


class Interrupts:
    """Keeps a Ctrl-C until it is allowed, or until the end. In the main thread; nothing elsewhere.

    Once it has been let through, a further one waits for the end: cleaning up is not disturbed.
    """

    def __init__(self) -> None:
        self._handler: Callable | None = None
        self._is_kept = self._is_allowed = False

    def __enter__(self) -> Interrupts:
        handler = signal.getsignal(signal.SIGINT)
        if threading.current_thread() is threading.main_thread() and callable(handler):
            self._handler = handler
            signal.signal(signal.SIGINT, self._on_signal)
        return self

    def __exit__(self, *_: object) -> None:
        if self._handler is not None:
            signal.signal(signal.SIGINT, self._handler)
            if self._is_kept:
                self._handler(signal.SIGINT, None)

    @contextlib.contextmanager
    def allowed(self) -> Iterator[None]:
        """Let it through: one that is kept, or comes within."""
        self._is_allowed = True
        try:
            if self._is_kept:
                self._is_kept = False
                self._on_signal(signal.SIGINT, None)
            yield
        finally:
            self._is_allowed = False

    def _on_signal(self, number: int, frame: object) -> None:
        if self._is_allowed:
            self._is_allowed = False
            self._handler(number, frame)
        else:
            self._is_kept = True
