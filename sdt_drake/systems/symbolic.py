from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from pydrake.symbolic import Expression, Variable
from pydrake.systems.framework import Diagram, DiagramBuilder, System
from pydrake.systems.primitives import Multiplexer, SymbolicVectorSystem

Symbols = NDArray[np.object_]
Law = Callable[..., Sequence[Expression] | Symbols]
TIME = Variable("t")


class SymbolicLaw(Diagram):
    """Vector inputs, one vector output, and if need be a continuous state.

        dx/dt = rates(x, *inputs),    output = law(x, *inputs)

    Both are called once, with arrays of symbols, without x where there is no state. It does not
    sample, and knows no time but `self.time`, the symbol t, where `timed`.
    """

    time = TIME

    def __init__(
        self,
        *,
        inputs: Mapping[str, int],
        output: str,
        law: Law,
        rates: Law | None = None,
        states: int = 0,
        timed: bool = False,
    ) -> None:
        """Inputs by name with their lengths; `rates` of `states` states, none by default."""
        super().__init__()
        builder = DiagramBuilder()
        add_law(builder, inputs, output, law, rates=rates, states=states, timed=timed)
        builder.BuildInto(self)


def add_law(
    builder: DiagramBuilder,
    inputs: Mapping[str, int],
    output: str,
    law: Law,
    *,
    rates: Law | None = None,
    states: int = 0,
    timed: bool = False,
) -> None:
    """Add the blocks of a `SymbolicLaw`, and export its ports."""
    signals = [np.array([Variable(f"{i}_{k}") for k in range(n)]) for i, n in inputs.items()]
    # Drake 1.51 aborts on a system of this kind without state in a continuous diagram.
    x = np.array([Variable(f"x_{k}") for k in range(max(states, 1))])
    arguments = [x, *signals] if states else signals
    with np.errstate(invalid="ignore"):  # numpy takes symbols for invalid numbers
        system = SymbolicVectorSystem(
            time=TIME if timed else None,
            state=x,
            dynamics=np.array([Expression(0)] if rates is None else rates(*arguments)),
            input=np.concatenate(signals),
            output=np.array(law(*arguments)),
        )
    first: System = system
    if len(inputs) > 1:
        first = builder.AddNamedSystem("inputs", Multiplexer(list(inputs.values())))
    builder.AddNamedSystem("law", system)
    if first is not system:
        builder.Connect(first.get_output_port(), system.get_input_port())
    for index, name in enumerate(inputs):
        builder.ExportInput(first.get_input_port(index), name)
    builder.ExportOutput(system.get_output_port(), output)
