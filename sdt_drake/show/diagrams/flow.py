"""Which way the signals between the items of a frame run: what is ahead, and what is fed back."""

from __future__ import annotations

from collections.abc import Collection
from graphlib import TopologicalSorter

from sdt_drake.show.diagrams.walk import Path

Edge = tuple[Path, Path]  # from an item to another


class Flow:
    """Edges without those that are fed back, so that no cycle is left.

    Attributes:
        ahead: the edges that are left.
        order: items, none before one that leads to it.
        targets: items that each leads to, ahead.
    """

    def __init__(self, items: list[Path], edges: Collection[Edge], outputs: set[Path]) -> None:
        """Args:
        items: of the frame.
        edges: between them.
        outputs: blocks with outputs of the diagram.
        """
        self._nearest = _nearest(items, edges)
        self.ahead = list(edges)
        self._entry = self._cut()  # where the loop begins
        if outputs:
            for path in reversed(_sorted(items, self.ahead)):
                if path != self._entry and path not in outputs:
                    self._turn(path, [edge for edge in edges if edge[0] == path])
        self.order = _sorted(items, self.ahead)
        self.targets = {path: [t for s, t in self.ahead if s == path] for path in items}

    def _cut(self) -> Path | None:
        """Take away edges in cycles, first those to what is nearest to the source."""
        rank = {path: number for number, path in enumerate(self._nearest)}
        entry = None
        while core := _cyclic(self.ahead):
            cut = min(core, key=lambda edge: (rank[edge[1]], rank[edge[0]]))
            entry = entry or cut[1]
            self.ahead.remove(cut)
        return entry

    def _turn(self, path: Path, leaving: list[Edge]) -> None:
        """An item all of whose signals are fed back (an encoder) stands in the way back itself."""
        if leaving and not set(leaving).intersection(self.ahead):
            self.ahead += leaving
            core = _cyclic(self.ahead)
            self.ahead = [edge for edge in self.ahead if edge[1] != path or edge not in core]

    def main(self, below: set[Path]) -> list[Path]:
        """The longest way, not from what is `below`; or that from where the loop begins, with the
        item before it."""
        longest: dict[Path, list[Path]] = {}
        for path in reversed(self.order):
            tails = (longest[target] for target in self.targets[path])
            longest[path] = [path, *max(tails, key=len, default=[])]
        if self._entry is None:
            starts = [path for path in self.targets if path not in below] or [*self.targets]
            return max((longest[path] for path in starts), key=len)
        before = self._nearest[self._entry]
        return [*([] if before is None else [before]), *longest[self._entry]]


def _nearest(items: list[Path], edges: Collection[Edge]) -> dict[Path, Path | None]:
    """The item before each on the shortest way from a source, nearest items first."""
    targets = {target for _, target in edges}
    before: dict[Path, Path | None] = {}
    for start in sorted(items, key=targets.__contains__):
        before.setdefault(start, None)
        queue = [start]
        for path in queue:
            new = [t for s, t in edges if s == path and t not in before]
            before |= dict.fromkeys(new, path)
            queue += new
    return before


def _sorted(items: list[Path], edges: list[Edge]) -> list[Path]:
    """Items, none before one that leads to it."""
    before = {path: [s for s, t in edges if t == path] for path in items}
    return list(TopologicalSorter(before).static_order())


def _cyclic(edges: Collection[Edge]) -> set[Edge]:
    """Edges in cycles."""
    reached = {s: {t for s_, t in edges if s_ == s} for s, _ in edges}
    for via in reached:
        for source in reached:
            if via in reached[source]:
                reached[source] |= reached[via]
    return {(s, t) for s, t in edges if s in reached.get(t, ())}
