"""A law written in symbols, evaluated by Drake without Python; static, or with a state."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from pydrake.symbolic import Expression, Variable
from pydrake.systems.primitives import Multiplexer, SymbolicVectorSystem

from sdt_drake.systems.block import Block

Law = Callable[..., Sequence[Expression]]


def _symbols() -> np.errstate:
    """numpy takes symbols in arrays for invalid numbers, and would warn."""
    return np.errstate(invalid="ignore")


def add_static_law(block: Block, *, inputs: Mapping[str, int], output: str, law: Law) -> None:
    """Give `block` vector inputs, by name with their lengths, and one output that they determine.

    `law` is called once, with time and an array of symbols for each input, and returns the
    expressions of the output.
    """
    time, signals = Variable("t"), _signals(inputs)
    with _symbols():
        output_law = list(law(time, *signals))
    system = SymbolicVectorSystem(
        time=time,
        # Drake 1.51 aborts on a system of this kind without state in a continuous diagram.
        state=[Variable("idle")],
        dynamics=[Expression(0)],
        input=np.concatenate(signals),
        output=output_law,
    )
    _wire(block, system, inputs, output)


def add_dynamic_law(
    block: Block, *, inputs: Mapping[str, int], output: str, size: int, rates: Law, law: Law
) -> None:
    """The same with `size` continuous states: `rates` and `law` get the state and the inputs."""
    signals = _signals(inputs)
    state = np.array([Variable(f"x_{k}") for k in range(size)])
    with _symbols():
        state_law, output_law = list(rates(state, *signals)), list(law(state, *signals))
    system = SymbolicVectorSystem(
        state=state,
        dynamics=state_law,
        input=np.concatenate(signals),
        output=output_law,
    )
    _wire(block, system, inputs, output)


def _signals(inputs: Mapping[str, int]) -> list[NDArray]:
    return [np.array([Variable(f"{i}_{k}") for k in range(n)]) for i, n in inputs.items()]


def _wire(block: Block, system, inputs: Mapping[str, int], output: str) -> None:
    block.add(system)
    ports = [system.get_input_port()]
    if len(inputs) > 1:
        stack = block.add(Multiplexer(list(inputs.values())), "inputs")
        block.connect(stack.get_output_port(), system.get_input_port())
        ports = [stack.get_input_port(i) for i in range(len(inputs))]
    block.inputs.update(zip(inputs, ports, strict=True))
    block.outputs[output] = system.get_output_port()
