"""Where the blocks of a picture stand: one line from left to right, loads above, feedback below.

All lengths are in cells of a square grid; y grows downwards.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from graphlib import TopologicalSorter
from itertools import chain

from sdt_drake.show.diagrams.text import text_size, wrapped
from sdt_drake.show.diagrams.walk import Block, BlockDiagram, Frame, Path, Wire

CELL = 6.5  # points
MARGIN = 2  # cells between the border of a frame and what is in it
TITLE = 4  # cells for the title of a frame
GAP = 3  # cells between blocks

Edge = tuple[Path, Path]  # from an item of a frame to another


@dataclass(frozen=True)
class Rect:
    """A rectangle of cells from (left, top) to (right, bottom), and the height y of its line."""

    left: float
    top: float
    right: float
    bottom: float
    y: float = 0

    def moved(self, dx: float, dy: float) -> Rect:
        """A rectangle of the same size elsewhere."""
        return Rect(self.left + dx, self.top + dy, self.right + dx, self.bottom + dy, self.y + dy)

    def overlaps(self, other: Rect, margin: float = 0) -> bool:
        """Whether less than `margin` cells are between them."""
        return (
            self.left < other.right + margin
            and other.left < self.right + margin
            and self.top < other.bottom + margin
            and other.top < self.bottom + margin
        )


class Layout:
    """Positions of blocks and frames, and which way the signals run.

    Attributes:
        rects: by path, of blocks and of frames.
        back: wires that run from right to left.
    """

    def __init__(self, picture: BlockDiagram, *, gap: int = GAP) -> None:
        self.picture = picture
        self.gap = gap
        self.back: set[Wire] = set()
        self._fed: set[Wire] = set()  # back, and all that carry on what these bring alone
        self._below: set[Path] = set()  # what is fed back
        self.rects = self._placed(picture.frame)

    def _placed(self, frame: Frame) -> dict[Path, Rect]:
        """All in a frame, its main line at y = 0, and the frame itself if it has a border."""
        within = {block.path: item.path for item in frame.items for block in item.blocks()}
        edges = self._edges(within, len(frame.path))
        order, ahead, main = self._directed(within, edges)
        parts = {
            item.path: self._placed(item) if isinstance(item, Frame) else self._block(item)
            for item in frame.items
        }
        gaps = {edge: self._gap(wires) for edge, wires in edges.items()}
        placed: dict[Path, Rect] = {}
        x = 0.0
        for path, following in zip(main, [*main[1:], ()], strict=True):
            moves = x - parts[path][path].left, 0
            placed |= {inner: rect.moved(*moves) for inner, rect in parts[path].items()}
            x = placed[path].right + gaps.get((path, following), 0)
        for path in (path for path in reversed(order) if path not in placed):
            # As far to the right as what it leads to allows, in a row with that if it can.
            own, targets = parts[path][path], [t for s, t in ahead if s == path]
            if targets and not self._below.union(main).intersection(targets):
                self._below.discard(path)
            wires = [(wire.target, gaps[path, t], t) for t in targets for wire in edges[path, t]]
            most = (placed[end].left - gap - MARGIN * (end != t) for end, gap, t in wires)
            least = [placed[s].right + gaps[s, t] for s, t in ahead if t == path and s in placed]
            x = max(0, *least, min(most, default=0) - own.right + own.left) - own.left
            rows = {placed[end].y for end, _, _ in wires} - {0}
            side = 1 if path in self._below else -1
            ys = chain(rows if len(rows) == 1 else (), range(0, side * 10**4, side))
            y = next(y for y in ys if self._is_free(own.moved(x, y), [*placed.values()]))
            placed |= {inner: rect.moved(x, y) for inner, rect in parts[path].items()}
        border = {frame.path: bounds(placed.values(), MARGIN, TITLE)} if frame.path else {}
        return placed | border

    def _is_free(self, rect: Rect, others: Collection[Rect]) -> bool:
        line = Rect(rect.left, -2, rect.right, 2)
        return not any(rect.overlaps(other, self.gap) for other in [line, *others])

    def _block(self, block: Block) -> dict[Path, Rect]:
        """A block around (0, 0), high enough for the lines on each side."""
        wires = self.picture.wires
        entering = sum(wire.target == block.path for wire in wires)
        leaving = len({wire.output for wire in wires if wire.source == block.path})
        width, height = text_size(block.text)
        margin, least = (4, 1) if block.shape == "end" else (10, 2)
        x = math.ceil((width + margin) / 2 / CELL)
        y = max(least, math.ceil((height + 2) / 2 / CELL), (max(entering, leaving) + 1) // 2)
        x, y = (1, 1) if block.shape == "sum" else (x, y)
        return {block.path: Rect(-x, -y, x, y)}

    def _gap(self, wires: list[Wire]) -> int:
        """Cells between two blocks, enough for the name of the signal and an arrow head."""
        labels = {self.picture.labels.get((wire.source, wire.output), "") for wire in wires}
        widths = (text_size(wrapped(label, 8))[0] / CELL + 1.3 for label in labels if label)
        return max([self.gap, *map(math.ceil, widths)])

    # --- which way the signals run ---------------------------------------------------------

    def _edges(self, within: dict[Path, Path], level: int) -> dict[Edge, list[Wire]]:
        """Wires between two different items of a frame, by the items, which are given by block."""
        edges: dict[Edge, list[Wire]] = {}
        for wire in self.picture.wires:
            source, target = within.get(wire.source), within.get(wire.target)
            if source is None or target is None:
                continue
            if wire.level < level or (source == target and wire.level == level):
                self.back.add(wire)
            elif source != target:
                edges.setdefault((source, target), []).append(wire)
        return edges

    def _directed(
        self, within: dict[Path, Path], edges: dict[Edge, list[Wire]]
    ) -> tuple[list[Path], list[Edge], list[Path]]:
        """Take edges as fed back until no cycle is left, from what is nearest to the source.

        Returns:
            items, none before one that leads to it; the edges that run ahead; the main line, which
            is the longest way, or that from where the loop begins and the block before it.
        """
        items = list(dict.fromkeys(within.values()))
        nearest = _nearest(items, edges)
        rank = {path: number for number, path in enumerate(nearest)}
        ahead, entry = list(edges), None
        while core := _cyclic(ahead):
            cut = min(core, key=lambda edge: (rank[edge[1]], rank[edge[0]]))
            entry = entry or cut[1]
            ahead.remove(cut)
        # A block that only hands on what is fed back (an encoder) stands in the way back.
        for path in reversed(_sorted(items, ahead)):
            behind = [edge for edge in edges if edge[0] == path]
            stays = path == entry or path in self.picture.exported or not self.picture.exported
            if behind and not stays and not set(behind).intersection(ahead):
                ahead += behind
                core = _cyclic(ahead)
                ahead = [edge for edge in ahead if edge[1] != path or edge not in core]
        self.back.update(*(edges[edge] for edge in edges.keys() - set(ahead)))
        self._fed |= self.back
        order = _sorted(items, ahead)
        for path in order:
            leaving = {w for w in self.picture.wires if within.get(w.source) == path} - self.back
            entering = {w for w in self.picture.wires if within.get(w.target) == path} - leaving
            if entering and entering <= self._fed:
                self._below.add(path)
                self._fed |= leaving
        longest: dict[Path, list[Path]] = {}
        for path in reversed(order):
            tails = [longest[t] for s, t in ahead if s == path]
            longest[path] = [path, *max(tails, key=len, default=[])]
        if entry is not None:
            return order, ahead, [p for p in [nearest[entry]] if p is not None] + longest[entry]
        starts = [path for path in items if path not in self._below] or items
        return order, ahead, max((longest[path] for path in starts), key=len)


def bounds(rects: Collection[Rect], margin: float = 0, title: float = 0) -> Rect:
    """The rectangle around others, with more space above them for a title."""
    return Rect(
        min(rect.left for rect in rects) - margin,
        min(rect.top for rect in rects) - margin - title,
        max(rect.right for rect in rects) + margin,
        max(rect.bottom for rect in rects) + margin,
    )


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
