"""Orthogonal lines from block to block, which may cross but never run on one another."""

import heapq
from itertools import pairwise

import numpy as np

from sdt_drake.show.diagrams.layout import GAP, Layout, Rect, bounds
from sdt_drake.show.diagrams.walk import BlockDiagram, Signal, Wire

Point = tuple[int, int]
_State = tuple[Point, int]  # a point, and the direction of the last step

_STEPS = ((1, 0), (0, 1), (-1, 0), (0, -1))  # right, down, left, up
_THROUGH = 2.0  # for a line through a frame that has neither of its ends
_BEND, _CROSS, _BORDER, _FRAME, _NEAR, _ASIDE, _FROM_ABOVE = 4, 3, 3, 0.5, 1, 3, 50


class NoWayError(Exception):
    """An error for a line that finds no way, as the space between the blocks is too small."""


def _cells(begin: float, end: float) -> range:
    return range(int(begin), int(end))


class Router:
    """The lines of a block diagram, in coordinates with positive x and y.

    Attributes:
        rects: rectangles of blocks and frames by path.
        lines: points of each wire, from its source block to its target block. A further wire of a
            signal begins where it branches off.
        joints: points where lines branch off.
    """

    def __init__(self, picture: BlockDiagram, layout: Layout) -> None:
        around = bounds(layout.rects.values(), layout.gap + 3 + len(layout.back))
        self.layout = layout
        self.rects = {p: r.moved(-around.left, -around.top) for p, r in layout.rects.items()}
        self.lines: dict[Wire, list[Point]] = {}
        self.joints: set[Point] = set()
        self._blocks = {block.path: block for block in picture.frame.blocks()}
        self._highest = {
            path: min(self.rects[w.source].y for w in picture.wires if w.target == path)
            for path in {wire.target for wire in picture.wires}
        }
        self._trees: dict[Signal, set[Point]] = {}
        # The cost of a step to a point along each axis.
        size = int(around.right - around.left) + 1, int(around.bottom - around.top) + 1
        self._toll = np.ones((2, *size))
        self._used = np.zeros(size, dtype=np.bool_)
        for path, rect in self.rects.items():
            if path in self._blocks:
                self._add(rect, 1, _NEAR)
            else:
                self._add(rect, 0, _BORDER + _FRAME)
                self._add(rect, -1, -_BORDER)
        for path in self._blocks:
            self._add(self.rects[path], 0, np.inf)
        self._toll[:, [0, -1]] = self._toll[:, :, [0, -1]] = np.inf
        for wire in sorted(picture.wires, key=self._urgency):
            self._route(wire)

    def _add(self, rect: Rect, margin: int, toll: float) -> None:
        xs = _cells(rect.left - margin, rect.right + margin + 1)
        ys = _cells(rect.top - margin, rect.bottom + margin + 1)
        self._toll[:, xs.start : xs.stop, ys.start : ys.stop] += toll

    def _urgency(self, wire: Wire) -> tuple[bool, float]:
        a, b = self.rects[wire.source], self.rects[wire.target]
        return wire in self.layout.back, abs(b.left - a.right) + 3 * abs(b.y - a.y)

    def _route(self, wire: Wire) -> None:
        tree = self._trees.setdefault((wire.source, wire.output), set())
        ends = wire.source, wire.target
        foreign = [
            rect
            for path, rect in self.rects.items()
            if path not in self._blocks and all(end[: len(path)] != path for end in ends)
        ]
        for rect in foreign:
            self._add(rect, 0, _THROUGH)
        starts = {(p, d): 0.0 for p in sorted(tree) for d in range(4)} or self._outlets(wire)
        line = self._cheapest(starts, self._inlets(wire), self.rects[wire.target])
        for rect in foreign:
            self._add(rect, 0, -_THROUGH)
        if tree:
            self.joints.add(line[0])
        self.lines[wire] = line
        axes = [int(a[0] == b[0]) for a, b in pairwise(line)]
        for index, point in enumerate(line):
            inner = 0 < index < len(line) - 1
            along = {axes[index - 1], axes[index]} if inner else {0, 1}
            for axis in (0, 1):
                self._toll[axis][point] += np.inf if axis in along else _CROSS
            if index and self._used[point]:  # nothing may branch off where lines cross
                for other in self._trees.values():
                    other.discard(point)
            elif index < len(line) - 1:
                tree.add(point)
            self._used[point] = True

    def _outlets(self, wire: Wire) -> dict[_State, float]:
        """Return the cost of each possible beginning of a line."""
        rect, target = self.rects[wire.source], self.rects[wire.target]
        ys = _cells(rect.top + 1, rect.bottom)
        outlets = {((int(rect.right), y), 0): _ASIDE * abs(y - rect.y) for y in ys}
        middle = int(rect.left + rect.right) // 2
        below = rect.bottom < target.top and target.left < middle < target.right
        if below and self._blocks[wire.source].shape == "box":
            outlets[(middle, int(rect.bottom)), 1] = 0.0
        return {state: cost for state, cost in outlets.items() if not self._used[state[0]]}

    def _inlets(self, wire: Wire) -> dict[_State, float]:
        """Return the cost of each possible end of a line.

        The line from the highest source enters from above, if it can.
        """
        rect, source = self.rects[wire.target], self.rects[wire.source]
        is_highest = source.bottom <= rect.top and source.y == self._highest[wire.target]
        ys = _cells(rect.top + 1, rect.bottom)
        inlets = {((int(rect.left), y), 0): _ASIDE * abs(y - rect.y) for y in ys}
        if self._blocks[wire.target].shape != "end":
            for x in _cells(rect.left + 1, rect.right):
                cost = 1.0 + abs(x - (rect.left + rect.right) // 2)
                inlets[(x, int(rect.top)), 1] = cost + _FROM_ABOVE * (not is_highest)
                inlets[(x, int(rect.bottom)), 3] = cost
        return {state: cost for state, cost in inlets.items() if not self._used[state[0]]}

    def _cheapest(
        self, starts: dict[_State, float], goals: dict[_State, float], target: Rect
    ) -> list[Point]:
        """Find the cheapest way from a start to a goal at the border of a block (A*)."""
        toll, used = self._toll.tolist(), self._used.tolist()
        costs = dict(starts)
        queue = [(cost, cost, state) for state, cost in costs.items()]
        heapq.heapify(queue)
        before: dict[_State, _State] = {}
        while queue:
            _, cost, state = heapq.heappop(queue)
            if state in goals:
                way = [state]
                while way[-1] in before:
                    way.append(before[way[-1]])
                return [point for point, _ in reversed(way)]
            (x, y), heading = state
            for turn in (0,) if used[x][y] else (0, 1, 3):
                direction = (heading + turn) % 4
                u, v = x + _STEPS[direction][0], y + _STEPS[direction][1]
                new = (u, v), direction
                total = cost + goals.get(new, toll[direction % 2][u][v]) + _BEND * (turn > 0)
                if total < costs.get(new, np.inf):
                    costs[new], before[new] = total, state
                    across = max(target.left - u, 0, u - target.right)
                    least = across + max(target.top - v, 0, v - target.bottom)
                    heapq.heappush(queue, (total + least, total, new))
        raise NoWayError


def routed(picture: BlockDiagram) -> Router:
    """Place blocks and lines, with as much space between the blocks as the lines need.

    Raises:
        NoWayError: if no tried space is sufficient.
    """
    for gap in range(GAP, 40):
        try:
            return Router(picture, Layout(picture, gap=gap))
        except NoWayError:
            continue
    raise NoWayError(
        f"diagram {picture.frame.title}: too many lines to draw, open fewer levels of it"
    )
