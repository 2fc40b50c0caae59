"""Boxes, wires and texts with their places on a page."""

from collections.abc import Iterator
from itertools import chain, pairwise
from typing import NamedTuple

from sdt_drake.show.diagrams.layout import CELL, Rect, bounds
from sdt_drake.show.diagrams.routing import Point, routed
from sdt_drake.show.diagrams.text import text_size, wrapped
from sdt_drake.show.diagrams.walk import BlockDiagram, Wire

Place = tuple[float, float]  # x to the right, y upwards [points]

HEAD = 6.0
"""The length of an arrow head [points]."""
TITLE_X, TITLE_Y = 0.75 * CELL, 1.1 * CELL
"""The place of a frame's title, from the frame's upper left corner [points]."""


class Item(NamedTuple):
    """A block, frame, dot or text of a page."""

    name: str
    """The path of a block or frame with slashes, or "dot N" or "note N"."""
    text: str
    """Lines in the middle; the title of a frame."""
    shape: str
    """One of "box", "sum", "dot" (where a wire branches), "end" (text alone) and "frame"."""
    x: float
    """The centre [points], as y."""
    y: float
    width: float
    """The size [points], as height."""
    height: float


class Page(NamedTuple):
    """A page of this width and height [points]: frames, items, and wires with their corners."""

    title: str
    width: float = 0
    height: float = 0
    frames: tuple[Item, ...] = ()
    items: tuple[Item, ...] = ()
    wires: tuple[tuple[Wire, list[Place]], ...] = ()


def laid_out(picture: BlockDiagram) -> Page:
    """Lay out a block diagram on a page.

    Raises:
        NoWayError: if the diagram has more lines than can be drawn.
    """
    if not any(picture.frame.blocks()):
        return Page(picture.frame.title)
    return _Drawing(picture).page()


def shaft(line: list[Place]) -> list[Place]:
    """Return the corners of a wire without its arrow head."""
    *_, (u, v), (x, y) = line
    length = abs(u - x) + abs(v - y)
    return [*line[:-1], (x + (u - x) * HEAD / length, y + (v - y) * HEAD / length)]


class _Drawing:
    def __init__(self, picture: BlockDiagram) -> None:
        self.picture = picture
        self.router = routed(picture)
        self.rects = self.router.rects
        self.lines = {wire: _corners(line) for wire, line in self.router.lines.items()}
        self.frames = [frame for frame in picture.frame.frames() if frame.path]
        # Rectangles that no text may cover.
        blocks = [self.rects[block.path] for block in picture.frame.blocks()]
        self.taken = 4 * blocks  # worse to cover than lines
        for a, b in chain.from_iterable(map(pairwise, self.lines.values())):
            self.taken.append(bounds([Rect(*a, *a), Rect(*b, *b)], 0.05))
        for frame in self.frames:
            r, (width, _) = self.rects[frame.path], text_size(frame.title)
            self.taken.append(Rect(r.left, r.top, r.left + width / CELL + 1, r.top + 1.8))
            self.taken += [Rect(x, r.top, x, r.bottom) for x in (r.left, r.right)]
            self.taken += [Rect(r.left, y, r.right, y) for y in (r.top, r.bottom)]
        self.right = bounds(self.taken).right
        self.notes = [*self._signs(), *self._labels()]
        self.bounds = bounds(self.taken)

    def page(self) -> Page:
        blocks = self.picture.frame.blocks()
        items = [("/".join(b.path), b.text, b.shape, self.rects[b.path]) for b in blocks]
        dots = (_around(x, y, 0.5, 0.5) for x, y in sorted(self.router.joints))
        items += [(f"dot {n}", "", "dot", rect) for n, rect in enumerate(dots, 1)]
        items += [(f"note {n}", text, "end", rect) for n, (rect, text) in enumerate(self.notes, 1)]
        frames = [("/".join(f.path), f.title, "frame", self.rects[f.path]) for f in self.frames]
        return Page(
            self.picture.frame.title,
            *self._at(self.bounds.right, self.bounds.top),
            tuple(self._item(*frame) for frame in frames),
            tuple(self._item(*item) for item in items),
            tuple((w, [self._at(*p) for p in self.lines[w]]) for w in self.picture.wires),
        )

    def _item(self, name: str, text: str, shape: str, rect: Rect) -> Item:
        middle = self._at((rect.left + rect.right) / 2, (rect.top + rect.bottom) / 2)
        size = (rect.right - rect.left) * CELL, (rect.bottom - rect.top) * CELL
        return Item(name, text, shape, *middle, *size)

    def _at(self, x: float, y: float) -> Place:
        return (x - self.bounds.left) * CELL, (self.bounds.bottom - y) * CELL

    # --- texts beside lines --------------------------------------------------------------------

    def _signs(self) -> Iterator[tuple[Rect, str]]:
        """Place the sign of each wire on the side of its arrow where it covers less."""
        for wire, line in self.router.lines.items():
            (u, v), (x, y) = line[-2:]
            places = [(u - 0.3, y - 0.9), (u - 0.3, y + 0.9)]
            if v != y:
                places = [(x + dx, v + (v - y) * 0.2) for dx in (0.8, -0.8)]
            if wire.sign:
                hits = [self._hits(_around(a, b, 0.7, 0.7)) for a, b in places]
                at = places[hits.index(min(hits))]
                self.taken.append(_around(*at, 0.7, 0.7))
                yield _around(*at, 1.2, 2), wire.sign

    def _labels(self) -> Iterator[tuple[Rect, str]]:
        """Place the name of each signal where it covers least, near its source."""
        for signal, label in self.picture.labels.items():
            lines = [ln for w, ln in self.router.lines.items() if (w.source, w.output) == signal]
            texts = dict.fromkeys((wrapped(label, 99), wrapped(label, 8)))
            places = [(r, t) for t in texts for p in chain(*lines) for r in _beside(*p, t)]
            costs = [self._cost(rect, *lines[0][0]) for rect, _ in places]
            place = places[costs.index(min(costs))]
            self.taken.append(place[0])
            yield place

    def _cost(self, rect: Rect, x: int, y: int) -> float:
        hits = self._hits(rect) + (rect.right > self.right)
        return 40 * hits + abs(rect.left - x) + abs((rect.top + rect.bottom) / 2 - y)

    def _hits(self, rect: Rect) -> int:
        return sum(map(rect.overlaps, self.taken))


def _beside(x: int, y: int, text: str) -> Iterator[Rect]:
    """Return the possible places of a text beside a point of a wire."""
    w, h = (length / CELL for length in text_size(text))
    corners = (0.3, -h - 0.15), (0.3, 0.15), (0.4, -h / 2), (-w - 0.4, -h / 2)
    return (Rect(x + dx, y + dy, x + dx + w, y + dy + h) for dx, dy in corners)


def _around(x: float, y: float, w: float, h: float) -> Rect:
    return Rect(x - w / 2, y - h / 2, x + w / 2, y + h / 2)


def _corners(line: list[Point]) -> list[Point]:
    turns = (b for (a, b), (_, c) in pairwise(pairwise(line)) if (a[0] == b[0]) != (b[0] == c[0]))
    return [line[0], *turns, line[-1]]
