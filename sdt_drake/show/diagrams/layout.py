"""Places of blocks: a main line from left to right, loads above it, feedback below it.

Lengths are in cells of a square grid; y grows downwards.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from itertools import chain, pairwise

from sdt_drake.show.diagrams.flow import Edge, Flow
from sdt_drake.show.diagrams.text import text_size, wrapped
from sdt_drake.show.diagrams.walk import Block, BlockDiagram, Frame, Path, Wire

CELL = 6.5
"""The size of a cell [points]."""
MARGIN = 2
"""The space between a frame and its content [cells]."""
TITLE = 4
"""The height of a frame's title [cells]."""
GAP = 3
"""The smallest space between blocks [cells]."""

_WAY = 2  # further cells beside a frame, for a line that passes it


@dataclass(frozen=True)
class Rect:
    """A rectangle of cells from (left, top) to (right, bottom), whose signal line is at y."""

    left: float
    top: float
    right: float
    bottom: float
    y: float = 0

    def moved(self, dx: float, dy: float) -> Rect:
        """Return the rectangle moved by (dx, dy)."""
        return Rect(self.left + dx, self.top + dy, self.right + dx, self.bottom + dy, self.y + dy)

    def overlaps(self, other: Rect, margin: float = 0) -> bool:
        """Check if less than `margin` cells lie between two rectangles."""
        return (
            self.left < other.right + margin
            and other.left < self.right + margin
            and self.top < other.bottom + margin
            and other.top < self.bottom + margin
        )


Places = dict[Path, Rect]


class Layout:
    """Places of blocks and frames.

    Attributes:
        rects: rectangles of blocks and frames by path.
        back: wires that run from right to left.
    """

    def __init__(self, picture: BlockDiagram, *, gap: int = GAP) -> None:
        self.picture = picture
        self.gap = gap
        self.back: set[Wire] = set()
        self._fed: set[Wire] = set()  # `back`, and the wires of items that have no other inputs
        self._below: set[Path] = set()  # items of the feedback path
        self.rects = self._placed(picture.frame)

    def _placed(self, frame: Frame) -> Places:
        """Place a frame and its content, the main line at y = 0."""
        within = {block.path: item.path for item in frame.items for block in item.blocks()}
        wires = self._wires(within, len(frame.path))
        outputs = {within[path] for path in self.picture.exported if path in within}
        flow = Flow(list(dict.fromkeys(within.values())), wires, outputs)
        self._mark_fed(flow, wires, within)
        main = flow.main(self._below)
        parts = {
            item.path: self._placed(item) if isinstance(item, Frame) else self._block(item)
            for item in frame.items
        }
        level = _Level(flow, wires, {edge: self._gap(wires[edge]) for edge in wires}, parts, {})
        for before, path in pairwise([(), *main]):
            level.put(path, level.behind(before, path), 0)
        beside = [path for path in reversed(flow.order) if path not in level.placed]
        for path in beside:
            targets = flow.targets[path]
            if targets and not self._below.union(main).intersection(targets):
                self._below.discard(path)
            left, rows = level.left(path), level.rows(path)
            side = 1 if path in self._below else -1
            ys = chain(rows if len(rows) == 1 else (), range(0, side * 10**4, side))
            level.put(path, left, next(y for y in ys if level.is_free(path, left, y, self.gap)))
        border = {frame.path: bounds(level.placed.values(), MARGIN, TITLE)} if frame.path else {}
        return level.placed | border

    def _block(self, block: Block) -> dict[Path, Rect]:
        """Place a block around (0, 0), high enough for the wires on each side."""
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
        """Return the cells between two blocks that a signal's name and arrow head require."""
        labels = {self.picture.labels.get((wire.source, wire.output), "") for wire in wires}
        widths = (text_size(wrapped(label, 8))[0] / CELL + 1.3 for label in labels if label)
        return max([self.gap, *map(math.ceil, widths)])

    def _wires(self, within: dict[Path, Path], level: int) -> dict[Edge, list[Wire]]:
        """Return the wires between different items of a frame, by these items.

        `within` contains the item of each block.
        """
        wires: dict[Edge, list[Wire]] = {}
        for wire in self.picture.wires:
            source, target = within.get(wire.source), within.get(wire.target)
            if source is None or target is None:
                continue
            if wire.level < level or (source == target and wire.level == level):
                self.back.add(wire)
            elif source != target:
                wires.setdefault((source, target), []).append(wire)
        return wires

    def _mark_fed(
        self, flow: Flow, wires: dict[Edge, list[Wire]], within: dict[Path, Path]
    ) -> None:
        """Find the wires that run back, and the items that have no other inputs."""
        for edge in wires.keys() - set(flow.ahead):
            self.back.update(wires[edge])
        self._fed |= self.back
        for path in flow.order:
            leaving = {w for w in self.picture.wires if within.get(w.source) == path} - self.back
            entering = {w for w in self.picture.wires if within.get(w.target) == path} - leaving
            if entering and entering <= self._fed:
                self._below.add(path)
                self._fed |= leaving


@dataclass
class _Level:
    """The items of a frame, placed one after the other."""

    flow: Flow
    wires: dict[Edge, list[Wire]]
    gaps: dict[Edge, int]
    """The smallest space along each edge [cells]."""
    parts: dict[Path, Places]
    """Each item and its content, around an origin of its own."""
    placed: Places

    def put(self, path: Path, left: float, y: float) -> None:
        """Place an item and its content."""
        x = left - self.parts[path][path].left
        self.placed |= {inner: rect.moved(x, y) for inner, rect in self.parts[path].items()}

    def behind(self, before: Path, path: Path) -> float:
        """Return the smallest left end of an item behind another; 0 without another."""
        return self.placed[before].right + self.gaps.get((before, path), 0) if before else 0

    def left(self, path: Path) -> float:
        """Return the left end of an item, as far to the right as its targets allow."""
        own, ends = self.parts[path][path], []
        for target in self.flow.targets[path]:
            for wire in self.wires[path, target]:
                within = MARGIN if wire.target != target else 0
                ends.append(self.placed[wire.target].left - self.gaps[path, target] - within)
        sources = [s for s, t in self.flow.ahead if t == path and s in self.placed]
        least = [self.behind(source, path) for source in sources]
        return max(0, *least, min(ends, default=0) - (own.right - own.left))

    def rows(self, path: Path) -> set[float]:
        """Return the heights of an item's target blocks, without that of the main line."""
        edges = ((path, target) for target in self.flow.targets[path])
        return {self.placed[wire.target].y for edge in edges for wire in self.wires[edge]} - {0}

    def is_free(self, path: Path, left: float, y: float, gap: int) -> bool:
        """Check if an item at this place is clear of the main line and of all other items."""
        own = self.parts[path][path]
        rect = own.moved(left - own.left, y)
        line = Rect(rect.left, -2, rect.right, 2)
        frames = {item for item, places in self.parts.items() if len(places) > 1}
        return not rect.overlaps(line, gap) and not any(
            rect.overlaps(other, gap + _WAY * (item in frames))
            for item, other in self.placed.items()
        )


def bounds(rects: Collection[Rect], margin: float = 0, title: float = 0) -> Rect:
    """Return the rectangle around others, with additional space for a title."""
    return Rect(
        min(rect.left for rect in rects) - margin,
        min(rect.top for rect in rects) - margin - title,
        max(rect.right for rect in rects) + margin,
        max(rect.bottom for rect in rects) + margin,
    )
