"""A line on the terminal that is drawn anew: how far the work is, and what is left of it."""

from __future__ import annotations

import sys
import time

_LATE = 2.0  # s; what is done earlier needs no bar
_SURE = 0.5  # s; before the rest can be told from what is done
_AGAIN = 0.1  # s
_WIDTH = 30


class Bar:
    """The progress bar of a command; without a terminal it draws nothing."""

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Tell that a command begins."""
        self.has_terminal = sys.stderr.isatty()
        self._start = self._began = time.monotonic()
        self._drawn = 0.0  # when; 0 if there is nothing on the line

    def tell(self, done: float) -> None:
        """Take how much is done, from 0 to 1; 0 when some work begins: see `watching`."""
        now = time.monotonic()
        if done == 0:
            self._began = now
        is_due = now > max(self._start + _LATE, self._began + _SURE, self._drawn + _AGAIN)
        if is_due and 0 < done < 1:
            left = (now - self._began) * (1 - done) / done
            self.draw(done, f"{100 * done:.0f} %, {duration(left)} left")

    def draw(self, done: float, text: str) -> None:
        """Draw the line."""
        if self.has_terminal:
            full = "█" * int(_WIDTH * done)
            print(f"\r{full:░<{_WIDTH}} {text}\x1b[K", end="", file=sys.stderr, flush=True)
            self._drawn = time.monotonic()

    def end(self, last: str = "\r\x1b[K") -> None:
        """Make room for other lines; `last` is printed instead of what wipes the line out."""
        if self._drawn:
            print(last, end="", file=sys.stderr, flush=True)
            self._drawn = 0.0


def duration(seconds: float) -> str:
    """A time [s] for people: "12 s", "3 min", "1.5 h"."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    if seconds < 6000:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"


bar = Bar()
"""Of the command that runs."""
