"""A static law written in symbols, evaluated by Drake without Python. No state."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from pydrake.symbolic import Expression, Variable
from pydrake.systems.primitives import Multiplexer, SymbolicVectorSystem

from sdt_drake.systems.block import Block

Law = Callable[..., Sequence[Expression]]


def add_static_law(block: Block, n: int, *, inputs: Sequence[str], output: str, law: Law) -> None:
    """Give `block` vector inputs of length n, and one output of length n that they determine.

    `law` is called once, with time and one array of n symbols for each input, and returns n
    expressions.
    """
    time = Variable("t")
    signals = np.array([[Variable(f"{i}_{k}") for k in range(n)] for i in inputs])
    system = block.add(
        SymbolicVectorSystem(
            time=time,
            # Drake 1.51 aborts on a system of this kind without state in a continuous diagram.
            state=[Variable("idle")],
            dynamics=[Expression(0)],
            input=signals.ravel(),
            output=list(law(time, *signals)),
        )
    )
    ports = [system.get_input_port()]
    if len(inputs) > 1:
        stack = block.add(Multiplexer([n] * len(inputs)), "inputs")
        block.connect(stack.get_output_port(), system.get_input_port())
        ports = [stack.get_input_port(i) for i in range(len(inputs))]
    block.inputs.update(zip(inputs, ports, strict=True))
    block.outputs[output] = system.get_output_port()
