"""The picture of a Drake diagram in Graphviz' language, with all positions."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain, pairwise

from sdt_drake.show.diagrams.layout import CELL, Rect, bounds
from sdt_drake.show.diagrams.routing import Point, routed
from sdt_drake.show.diagrams.text import FACE, SIZE, rich, text_size, wrapped
from sdt_drake.show.diagrams.walk import BlockDiagram, Frame, Wire

_HEAD = 6.0  # length of an arrow head [points]
_SHAPES = {"box": "box", "sum": "circle", "end": "plaintext", "dot": "point"}


def drawn(picture: BlockDiagram) -> str:
    """The picture of a block diagram as .dot: `dot` draws it as it stands."""
    if not any(picture.frame.blocks()):
        return f"digraph {_quoted(picture.frame.title)} {{\n}}\n"
    return _Drawing(picture).text()


class _Drawing:
    def __init__(self, picture: BlockDiagram) -> None:
        self.picture = picture
        self.router = routed(picture)
        self.rects = self.router.rects
        self.lines = {wire: _corners(line) for wire, line in self.router.lines.items()}
        self.frames = [frame for frame in picture.frame.frames() if frame.path]
        # What no text may cover.
        self.taken = [self.rects[block.path] for block in picture.frame.blocks()]
        for a, b in chain.from_iterable(map(pairwise, self.lines.values())):
            self.taken.append(bounds([Rect(*a, *a), Rect(*b, *b)], 0.05))
        for frame in self.frames:
            r, (width, _) = self.rects[frame.path], text_size(frame.title)
            self.taken.append(Rect(r.left, r.top, r.left + width / CELL + 1, r.top + 1.8))
            self.taken += [Rect(x, r.top, x, r.bottom) for x in (r.left, r.right)]
            self.taken += [Rect(r.left, y, r.right, y) for y in (r.top, r.bottom)]
        self.page = bounds(self.taken)
        self.notes = [*self._signs(), *self._labels()]

    def text(self) -> str:
        self.page = bounds(self.taken)
        blocks = self.picture.frame.blocks()
        nodes = [("/".join(b.path), b.text, self.rects[b.path], b.shape) for b in blocks]
        dots = (_around(x, y, 0.5, 0.5) for x, y in sorted(self.router.joints))
        nodes += [(f"dot {number}", "", rect, "dot") for number, rect in enumerate(dots, 1)]
        nodes += [(f"note {n}", text, rect, "end") for n, (rect, text) in enumerate(self.notes, 1)]
        lines = [
            f"digraph {_quoted(self.picture.frame.title)} {{",
            f'  graph [layout=nop2, bb="0,0,{self._at(self.page.right, self.page.top)}", '
            f'fontname="{FACE}", fontsize={SIZE:g}];',
            f'  node [fixedsize=true, fontname="{FACE}", fontsize={SIZE:g}];',
            f"  edge [arrowsize={_HEAD / 10:g}];",
            *map(self._frame, self.frames),
            *(self._node(*node) for node in nodes),
            *(self._edge(wire) for wire in self.picture.wires),
            "}",
        ]
        return "\n".join(lines) + "\n"

    def _at(self, x: float, y: float) -> str:
        return f"{_n(x - self.page.left)},{_n(self.page.bottom - y)}"

    def _frame(self, frame: Frame) -> str:
        rect = self.rects[frame.path]
        half = text_size(frame.title)[0] / 2 / CELL
        corners = f"{self._at(rect.left, rect.bottom)},{self._at(rect.right, rect.top)}"
        return (
            f"  subgraph {_quoted('cluster', *frame.path)} {{ graph [label=<{rich(frame.title)}>, "
            f'bb="{corners}", lp="{self._at(rect.left + half + 0.75, rect.top + 1.1)}", '
            f'style="dashed", color="gray50", fontcolor="gray35"]; '
            f"{'; '.join(_quoted(*block.path) for block in frame.blocks())}; }}"
        )

    def _node(self, name: str, text: str, rect: Rect, shape: str) -> str:
        width, height = (rect.right - rect.left) * CELL / 72, (rect.bottom - rect.top) * CELL / 72
        middle = self._at((rect.left + rect.right) / 2, (rect.top + rect.bottom) / 2)
        label = f"<{rich(text)}>" if text else '""'
        return (
            f'  {_quoted(name)} [shape={_SHAPES[shape]}, label={label}, pos="{middle}", '
            f"width={width:.4g}, height={height:.4g}];"
        )

    def _edge(self, wire: Wire) -> str:
        (u, v), (x, y) = self.router.lines[wire][-2:]
        end = x + (u - x) * _HEAD / CELL, y + (v - y) * _HEAD / CELL
        points = [self._at(*self.lines[wire][0])]
        for a, b in pairwise([*self.lines[wire][:-1], end]):
            points += [self._at(*a), self._at(*b), self._at(*b)]
        ends = f"{_quoted(*wire.source)} -> {_quoted(*wire.target)}"
        return f'  {ends} [pos="e,{self._at(x, y)} {" ".join(points)}"];'

    # --- texts beside lines --------------------------------------------------------------------

    def _signs(self) -> Iterator[tuple[Rect, str]]:
        for wire, (*_, (ax, ay), (x, y)) in self.router.lines.items():
            if wire.sign:
                at = (ax - 0.3, y - 0.9) if ay == y else (x + 0.8, ay + (ay - y) * 0.2)
                self.taken.append(_around(*at, 0.7, 0.7))
                yield _around(*at, 1.2, 2), wire.sign

    def _labels(self) -> Iterator[tuple[Rect, str]]:
        """The name of each signal where it covers least, near to its source."""
        for signal, label in self.picture.labels.items():
            lines = [ln for w, ln in self.router.lines.items() if (w.source, w.output) == signal]
            texts = dict.fromkeys((wrapped(label, 99), wrapped(label, 8)))
            places = [(r, t) for t in texts for p in chain(*lines) for r in _beside(*p, t)]
            costs = [self._cost(rect, *lines[0][0]) for rect, _ in places]
            place = places[costs.index(min(costs))]
            self.taken.append(place[0])
            yield place

    def _cost(self, rect: Rect, x: int, y: int) -> float:
        hits = sum(map(rect.overlaps, self.taken)) + (rect.right > self.page.right)
        return 40 * hits + abs(rect.left - x) + abs((rect.top + rect.bottom) / 2 - y)


def _beside(x: int, y: int, text: str) -> Iterator[Rect]:
    """Places for a text beside a point of a line."""
    w, h = (length / CELL for length in text_size(text))
    corners = (0.3, -h - 0.15), (0.3, 0.15), (0.4, -h / 2), (-w - 0.4, -h / 2)
    return (Rect(x + dx, y + dy, x + dx + w, y + dy + h) for dx, dy in corners)


def _around(x: float, y: float, w: float, h: float) -> Rect:
    return Rect(x - w / 2, y - h / 2, x + w / 2, y + h / 2)


def _corners(line: list[Point]) -> list[Point]:
    turns = (b for (a, b), (_, c) in pairwise(pairwise(line)) if (a[0] == b[0]) != (b[0] == c[0]))
    return [line[0], *turns, line[-1]]


def _quoted(*path: str) -> str:
    return '"' + "/".join(path).replace("\\", "\\\\").replace('"', '\\"') + '"'


def _n(cells: float) -> str:
    return f"{round(cells * CELL, 1):g}"
