"""Signal flow between the items of a frame: forward edges and feedback edges."""

from collections.abc import Collection
from graphlib import TopologicalSorter

from sdt_drake.show.diagrams.walk import Path

Edge = tuple[Path, Path]
"""The source and the target of an edge."""


class Flow:
    """The forward edges between items, which form no cycle.

    Args:
        items: items of the frame.
        edges: edges between the items.
        outputs: items with outputs of the diagram.

    Attributes:
        ahead: the forward edges.
        order: the items, each behind all its sources.
        targets: the targets of each item's forward edges.
    """

    def __init__(self, items: list[Path], edges: Collection[Edge], outputs: set[Path]) -> None:
        self._nearest = _nearest(items, edges)
        self.ahead = list(edges)
        self._entry = self._cut()
        if outputs:
            for path in reversed(_sorted(items, self.ahead)):
                if path != self._entry and path not in outputs:
                    self._turn(path, [edge for edge in edges if edge[0] == path])
        self.order = _sorted(items, self.ahead)
        self.targets = {path: [t for s, t in self.ahead if s == path] for path in items}

    def _cut(self) -> Path | None:
        """Remove edges until no cycle is left, and return the item where the loop begins.

        Edges to the items nearest to the source are removed first; of items that are equally near,
        to that with the farthest source.
        """
        rank = {path: number for number, path in enumerate(self._nearest)}
        steps: dict[Path, int] = {}
        for path, before in self._nearest.items():
            steps[path] = 1 + (max(steps.values(), default=0) if before is None else steps[before])
        entry = None
        while core := _cyclic(self.ahead):
            far = {t: max(steps[s] for s, target in core if target == t) for _, t in core}
            cut = min(core, key=lambda e: (steps[e[1]], -far[e[1]], rank[e[1]], rank[e[0]]))
            entry = entry or cut[1]
            self.ahead.remove(cut)
        return entry

    def _turn(self, path: Path, leaving: list[Edge]) -> None:
        """Move an item into the feedback path if all its signals are fed back, as an encoder's."""
        if leaving and not set(leaving).intersection(self.ahead):
            self.ahead += leaving
            core = _cyclic(self.ahead)
            self.ahead = [edge for edge in self.ahead if edge[1] != path or edge not in core]

    def main(self, below: set[Path]) -> list[Path]:
        """Return the main line: the longest path from the item where the loop begins.

        It includes the item before that one. Without a loop it is the longest path of all, not
        counting those from the items `below`.
        """
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
    """Return for each item the one before it on the shortest path from a source, nearest first."""
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
    """Sort items so that each is behind all its sources."""
    before = {path: [s for s, t in edges if t == path] for path in items}
    return list(TopologicalSorter(before).static_order())


def _cyclic(edges: Collection[Edge]) -> set[Edge]:
    """Return the edges that belong to cycles."""
    reached = {s: {t for s_, t in edges if s_ == s} for s, _ in edges}
    for via in reached:
        for source in reached:
            if via in reached[source]:
                reached[source] |= reached[via]
    return {(s, t) for s, t in edges if s in reached.get(t, ())}
