"""A static law written in symbols, as one block that Drake evaluates without Python. No state."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from pydrake.symbolic import Expression, Variable
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import Multiplexer, SymbolicVectorSystem

from sdt_drake.systems.composite import composite

Law = Callable[..., Sequence[Expression]]


def make_static_law(name: str, n: int, inputs: Sequence[str], output: str, law: Law) -> Diagram:
    """A block with vector inputs of length n and one output of length n.

    Args:
        name: of the block.
        n: length of each signal.
        inputs: names of the input ports.
        output: name of the output port.
        law: called once, with time and one array of n symbols for each input; returns n
            expressions.
    """
    time = Variable("t")
    signals = np.array([[Variable(f"{i}_{k}") for k in range(n)] for i in inputs])
    # Drake 1.51 aborts on a block of this kind without state in a continuous diagram.
    idle = Variable("idle")
    builder = DiagramBuilder()
    block = builder.AddNamedSystem(
        "law",
        SymbolicVectorSystem(
            time=time,
            state=[idle],
            input=signals.ravel(),
            dynamics=[Expression(0)],
            output=list(law(time, *signals)),
        ),
    )
    ports = [block.get_input_port()]
    if len(inputs) > 1:
        stack = builder.AddNamedSystem("inputs", Multiplexer([n] * len(inputs)))
        builder.Connect(stack.get_output_port(), block.get_input_port())
        ports = [stack.get_input_port(i) for i in range(len(inputs))]
    return composite(
        name,
        builder,
        inputs=dict(zip(inputs, ports, strict=True)),
        outputs={output: block.get_output_port()},
    )
