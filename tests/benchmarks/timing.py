"""What benchmarks share: medians, and tables."""

from collections.abc import Iterable, Sequence

import numpy as np


def spread(values: Sequence[float]) -> str:
    """Return the median of values, and their range."""
    return f"{np.median(values):.3f} ({min(values):.3f} to {max(values):.3f})"


def head(*names: str) -> None:
    """Print the head of a table in Markdown."""
    row(names)
    row(["---"] * len(names))


def row(cells: Iterable[object]) -> None:
    """Print a row of a table in Markdown."""
    print("| " + " | ".join(map(str, cells)) + " |", flush=True)
