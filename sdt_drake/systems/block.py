"""Blocks: a few systems with named ports, placed flat in a diagram or in a box of their own.

Every `*_block` function of this package describes one block of the loops. It gets a `Block` to
fill, and does not know where its systems will stand:

- flat, in the diagram that is simulated, with dotted names ("pi_speed_controller.law"). Drake
  tells every sub-diagram of every change of time or state; boxes cost the coupled loop a fifth
  of its speed;
- in a box, a sub-diagram whose named ports a reader of the exported block diagram sees.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from pydrake.systems.framework import Diagram, DiagramBuilder, InputPort, OutputPort, System

S = TypeVar("S", bound=System)


class Block:
    """Named ports of a block, and the builder that its systems go into.

    Attributes:
        inputs: input ports by name.
        outputs: output ports by name.
    """

    def __init__(self, builder: DiagramBuilder, name: str, *, prefix: str = "") -> None:
        self._builder = builder
        self._name = name
        self._prefix = prefix
        self.inputs: dict[str, InputPort] = {}
        self.outputs: dict[str, OutputPort] = {}

    def add(self, system: S, part: str = "") -> S:
        """Add one of its systems: the main one takes the block's name, others are a part of it."""
        name = f"{self._prefix}{part}" if part else self._name
        return self._builder.AddNamedSystem(name, system)

    def connect(self, output: OutputPort, target: InputPort) -> None:
        """Connect two of its systems."""
        self._builder.Connect(output, target)


Describe = Callable[..., None]


def place_flat(builder: DiagramBuilder, name: str, describe: Describe, **arguments) -> Block:
    """Put a block's systems side by side with those of the others."""
    block = Block(builder, name, prefix=f"{name}.")
    describe(block, **arguments)
    return block


def place_boxed(builder: DiagramBuilder, name: str, describe: Describe, **arguments) -> Block:
    """Put a block into a sub-diagram of its own."""
    box = builder.AddSystem(make_block(name, describe, **arguments))
    block = Block(builder, name)
    block.inputs = {
        port.get_name(): port for port in map(box.get_input_port, range(box.num_input_ports()))
    }
    block.outputs = {
        port.get_name(): port for port in map(box.get_output_port, range(box.num_output_ports()))
    }
    return block


def make_block(name: str, describe: Describe, **arguments) -> Diagram:
    """A block alone, as a diagram with its named ports."""
    builder = DiagramBuilder()
    block = Block(builder, name)
    describe(block, **arguments)
    for port_name, input_port in block.inputs.items():
        builder.ExportInput(input_port, port_name)
    for port_name, output_port in block.outputs.items():
        builder.ExportOutput(output_port, port_name)
    diagram = builder.Build()
    diagram.set_name(name)
    return diagram
