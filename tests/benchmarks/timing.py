"""What benchmarks share: times of calls, and tables."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Sequence

import numpy as np


def one_core() -> None:
    """Keep this process on one core, where the system can."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})


def spread(values: Sequence[float]) -> str:
    """Return the median of values, and their range."""
    return f"{np.median(values):.3f} ({min(values):.3f} to {max(values):.3f})"


def report_time(name: str, call: Callable[[], object], target: float, rounds: int) -> None:
    """Print the time of a call, the median of rounds after one to warm up, and its target [s]."""
    times = []
    for _ in range(rounds + 1):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    print(f"{name:34s} {spread(times[1:])} s, target {target} s", flush=True)


def head(*names: str) -> None:
    """Print the head of a table in Markdown."""
    row(names)
    row(["---"] * len(names))


def row(cells: Iterable[object]) -> None:
    """Print a row of a table in Markdown."""
    print("| " + " | ".join(map(str, cells)) + " |", flush=True)
