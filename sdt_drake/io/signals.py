"""Signals held off while files move: Ctrl-C and others arrive before or after, not in between."""

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager

_ENDING = (signal.SIGTERM, signal.SIGHUP, signal.SIGALRM, signal.SIGINT)
"""Signals that end a command. SIGALRM repeats one that came during an import."""


@contextlib.contextmanager
def holding_signals() -> Iterator[Callable[[], AbstractContextManager[None]]]:
    """Hold signals off in the block; they arrive after it.

    Only the main thread gets signals, so nothing is held off in other threads.

    Yields:
        A function without arguments. Signals arrive at once in the `with` blocks that it makes.
    """
    in_main = threading.current_thread() is threading.main_thread()
    own = {number: signal.getsignal(number) for number in _ENDING if in_main}
    # None stands for a handler that Python cannot set again.
    own = {x: handler for x, handler in own.items() if handler not in (signal.SIG_IGN, None)}
    came: list[int] = []

    def hold() -> None:
        for number in own:
            signal.signal(number, lambda came_in, _: came.append(came_in))

    def release() -> None:
        for number, handler in own.items():
            signal.signal(number, handler)
        while came:
            signal.raise_signal(came.pop(0))

    @contextlib.contextmanager
    def released() -> Iterator[None]:
        release()
        try:
            yield
        finally:
            hold()

    try:
        hold()
        yield released
    finally:
        release()
