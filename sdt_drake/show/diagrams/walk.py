"""The blocks, signals and frames that a picture of a Drake diagram shows.

Symbols are texts on blocks in place of their names, by the name of a system, of its class or of a
base class. "name.inner" is a system in a Diagram of that name. A symbol may also be a function of
the system. A Diagram with a symbol is drawn as one block and never opened. With the symbol "" it is
opened without a frame, at the level of what is around it. A system with a symbol gives its own name
to an output that Drake has named.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from graphlib import TopologicalSorter
from itertools import chain
from typing import cast

import numpy as np
from pydrake.systems import primitives
from pydrake.systems.framework import Diagram, InputPortIndex, OutputPortIndex, System

from sdt_drake.show.diagrams.text import wrapped

Path = tuple[str, ...]
"""Names of nested systems, from the outermost one."""
Signal = tuple[Path, int]
"""A block and the index of its output port."""
_Port = tuple[Path, str, int]  # a system, "in" or "out", and an index
Symbols = Mapping[str, "str | Callable[[System], str]"]

_GENERIC = re.compile(r"[uy]\d*|sum|.*@.*")  # Drake's own names of ports


@dataclass(frozen=True)
class Block:
    """A box, a sum, or the name of an input or output of the diagram."""

    path: Path
    text: str
    """The lines on the block."""
    shape: str = "box"
    """One of "box", "sum" and "end" (the name of an input or output)."""

    def blocks(self) -> Iterator[Block]:
        """Yield the block itself, as `Frame.blocks` yields those of a frame."""
        yield self


@dataclass(frozen=True)
class Frame:
    """A frame around the blocks of an opened Diagram."""

    path: Path
    """The path of the Diagram; () for the outermost one."""
    items: tuple[Block | Frame, ...]
    """Blocks and frames in the order in which they were added."""
    title: str

    def blocks(self) -> Iterator[Block]:
        """Yield all blocks within the frame, at all levels."""
        for item in self.items:
            yield from item.blocks()

    def frames(self) -> Iterator[Frame]:
        """Yield the frame and all frames within it."""
        yield self
        for item in self.items:
            if isinstance(item, Frame):
                yield from item.frames()


@dataclass(frozen=True)
class Wire:
    """A connection from an output port of a block to an input port of another."""

    source: Path
    output: int
    """The index of the output port."""
    target: Path
    input: int
    """The index of the input port."""
    level: int = 0
    """The number of Diagrams around the one that makes the connection."""
    sign: str = ""
    """The sign at a sum, "+" or "−"; else ""."""


@dataclass(frozen=True)
class BlockDiagram:
    """Blocks, wires and names of signals, without places."""

    frame: Frame
    """The outermost frame."""
    wires: list[Wire]
    labels: dict[Signal, str]
    """The names of signals."""
    exported: set[Path]
    """Blocks with outputs of the diagram."""


def walk(diagram: Diagram, *, max_depth: int = 2, symbols: Symbols | None = None) -> BlockDiagram:
    """Find the blocks and signals of a diagram, down to `max_depth` levels of opened Diagrams.

    Logs, and blocks with unused outputs, are left out. PassThroughs become lines. The minus sign
    of a Gain or MatrixGain without positive coefficients moves to the sums behind it, if it can.
    The module's docstring describes `symbols`.
    """
    return _Walk(diagram, max_depth, symbols or {}).result()


class _Walk:
    def __init__(self, top: Diagram, max_depth: int, symbols: Symbols) -> None:
        self.known = symbols
        self.systems: dict[Path, System] = {(): top}
        self.children: dict[Path, list[Path]] = {}  # by opened Diagram
        self.leaves: list[Path] = []  # other systems, without PassThroughs and logs
        self.symbols: dict[Path, str | None] = {}
        self.before: dict[_Port, _Port] = {}  # the source of each port
        self._open((), max_depth)

    def _open(self, path: Path, depth: int) -> None:
        diagram = cast(Diagram, self.systems[path])
        paths: dict[System, Path] = {}
        for index, system in enumerate(diagram.GetSystems()):
            name = system.get_name()
            if "@" in name or not name:  # Drake's name contains a memory address
                name = f"{_classes(system)[0]}_{index}"
            paths[system] = child = (*path, name)
            self.systems[child] = system
            keys = [f"{diagram.get_name()}.{name}", name, *_classes(system)]
            symbol = next((self.known[key] for key in keys if key in self.known), None)
            self.symbols[child] = symbol(system) if callable(symbol) else symbol
        self.children[path] = list(paths.values())
        for (target, i), (source, o) in diagram.connection_map().items():
            self.before[paths[target], "in", int(i)] = paths[source], "out", int(o)
        for index in range(diagram.num_input_ports()):
            for target, i in diagram.GetInputPortLocators(InputPortIndex(index)):
                self.before[paths[target], "in", int(i)] = path, "in", index
        for index in range(diagram.num_output_ports()):
            source, o = diagram.get_output_port_locator(OutputPortIndex(index))
            self.before[path, "out", index] = paths[source], "out", int(o)
        for system, child in paths.items():
            if isinstance(system, primitives.PassThrough):
                self.before[child, "out", 0] = child, "in", 0
            elif isinstance(system, Diagram) and not self.symbols[child] and depth > 0:
                self._open(child, depth if self.symbols[child] == "" else depth - 1)
            elif not isinstance(system, primitives.VectorLogSink):
                self.leaves.append(child)

    def result(self) -> BlockDiagram:
        top = self.systems[()]
        wires = self._wires()
        count = top.num_output_ports()
        exported = [self._chain(((), "out", index))[-1] for index in range(count)]
        drawn = self._drawn(wires, {path for path, _, _ in exported})
        wires = [wire for wire in wires if wire.target in drawn]
        blocks, wires = self._blocks(drawn, wires)
        frame = self._frame((), blocks)
        labels = self._labels(wires, blocks)
        ends = [wire.source for wire in wires if wire.source not in self.systems]
        fed = {(wire.source, wire.output) for wire in wires}
        for index, (path, _, output) in enumerate(exported):
            if path in drawn and (path, output) not in fed:
                ends.append((f"{top.get_output_port(index).get_name()} (out)",))
                wires.append(Wire(path, output, ends[-1], 0))
        named = (Block(path, path[0].rpartition(" ")[0], "end") for path in dict.fromkeys(ends))
        frame = replace(frame, items=(*frame.items, *named))
        return BlockDiagram(frame, wires, labels, {path for path, _, _ in exported})

    def _chain(self, port: _Port) -> list[_Port]:
        """Return a port and all ports before it, up to the source of its signal."""
        chain = [port]
        while chain[-1] in self.before:
            chain.append(self.before[chain[-1]])
        return chain

    def _wires(self) -> list[Wire]:
        wires = []
        for target in self.leaves:
            for index in range(self.systems[target].num_input_ports()):
                chain = self._chain((target, "in", index))
                source, side, output = chain[-1]
                if not source:
                    name = self.systems[()].get_input_port(output).get_name()
                    wires.append(Wire((f"{name} (in)",), 0, target, index))
                elif side == "out":
                    level = min(len(path) for path, _, _ in chain) - 1
                    wires.append(Wire(source, output, target, index, level))
        return wires

    def _drawn(self, wires: list[Wire], exported: set[Path]) -> set[Path]:
        """Find the blocks to draw: neither logs nor blocks with unused outputs.

        If no output is used at all, only logs are left out.
        """
        drawn: set[Path] = set()
        kept = set(self.leaves)
        while drawn != kept:
            drawn = kept
            read = exported | {wire.source for wire in wires if wire.target in drawn}
            kept = {path for path in drawn if path in read or not self._outputs(path)}
        return drawn or set(self.leaves)

    def _outputs(self, path: Path) -> int:
        return self.systems[path].num_output_ports()

    def _blocks(self, drawn: set[Path], wires: list[Wire]) -> tuple[dict[Path, Block], list[Wire]]:
        """Make blocks and signed wires; a gain's minus moves to the sums behind it, if it can."""
        leaving: dict[Path, list[Wire]] = {path: [] for path in drawn}
        signs: dict[Wire, int] = {}  # at sums
        for wire in wires:
            leaving.setdefault(wire.source, []).append(wire)
            if isinstance(self.systems[wire.target], primitives.Adder):
                signs[wire] = 1
        gains = {path: sign for path in drawn if (sign := _gain_sign(self.systems[path]))}
        behind = {path: {wire.target for wire in leaving[path]} & gains.keys() for path in gains}
        minus = dict.fromkeys(drawn, "")
        stands: dict[Path, list[Wire]] = {}  # by gain: wires to sums that can have its sign
        for path in TopologicalSorter(behind).static_order():  # none before a gain behind it
            ends = [[w] if w in signs else stands.get(w.target, []) for w in leaving[path]]
            stands[path] = [*chain(*ends)] if all(ends) else []
            for wire in stands[path]:
                signs[wire] *= gains[path]
            if gains[path] < 0 and not stands[path]:
                minus[path] = "−"
        signed = [replace(w, sign="+−"[signs[w] < 0] if w in signs else "") for w in wires]
        return {path: self._block(path, minus[path]) for path in drawn}, signed

    def _block(self, path: Path, minus: str) -> Block:
        system, symbol = self.systems[path], self.symbols[path]
        if symbol:
            return Block(path, minus + symbol)
        if isinstance(system, primitives.Adder):  # a circle has three sides for inputs
            return Block(path, "", "sum") if system.num_input_ports() <= 3 else Block(path, "Σ")
        if isinstance(system, primitives.Integrator):
            return Block(path, "1/s")
        if isinstance(system, primitives.ZeroOrderHold):
            return Block(path, f"ZOH\n{1e3 * system.period():.6g} ms")
        return Block(path, minus + wrapped(path[-1].split(".")[-1]))

    def _frame(self, path: Path, blocks: dict[Path, Block]) -> Frame:
        items: list[Block | Frame] = []
        for child in self.children[path]:
            if child in self.children:
                inner = self._frame(child, blocks)
                # A frame around a single block is left out.
                alone = len(inner.items) == 1 and isinstance(inner.items[0], Block)
                is_bare = alone or self.symbols[child] == ""
                items += inner.items if is_bare else [inner] * bool(inner.items)
            elif child in blocks:
                items.append(blocks[child])
        title = self.systems[path].get_name()
        if path and len(items) == 1 and isinstance(items[0], Frame):
            return replace(items[0], title=f"{title}: {items[0].title}")
        return Frame(path, tuple(items), title)

    def _labels(self, wires: list[Wire], blocks: dict[Path, Block]) -> dict[Signal, str]:
        """Return the outermost name of each signal that Drake has not chosen itself."""
        labels: dict[Signal, str] = {}
        signals = {(wire.source, wire.output): None for wire in wires if wire.source in blocks}
        for path in [*sorted(self.children, key=len), *(path for path, _ in signals)]:
            for index in range(self._outputs(path)):
                source, _, output = self._chain((path, "out", index))[-1]
                name = self.systems[path].get_output_port(index).get_name()
                if _GENERIC.fullmatch(name):
                    name = path[-1] if self.symbols.get(path) else ""
                if (source, output) not in signals or not name:
                    continue
                if not blocks[source].text.startswith("−") and _gain_sign(self.systems[source]) < 0:
                    name = name.removeprefix("minus_")  # the minus is drawn at the sums
                # A block with one output may name it itself.
                if self._outputs(source) > 1 or name not in blocks[source].text.replace("\n", "_"):
                    labels.setdefault((source, output), name)
        return labels


def _classes(system: System) -> list[str]:
    """Return the names of a system's class and its bases."""
    return [kind.__name__.partition("_[")[0] for kind in type(system).__mro__]


def _gain_sign(system: System) -> int:
    """Return -1 for a gain without positive coefficients, 1 for another gain, 0 for no gain."""
    if not isinstance(system, (primitives.Gain, primitives.MatrixGain)):
        return 0
    context = system.CreateDefaultContext()
    system.get_input_port().FixValue(context, np.zeros(system.get_input_port().size()))
    gain = np.asarray(primitives.Linearize(system, context).D())
    return -1 if np.any(gain < 0) and not np.any(gain > 0) else 1
