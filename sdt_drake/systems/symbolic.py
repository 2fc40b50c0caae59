"""A law in symbols, which Drake evaluates without Python and can differentiate."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from pydrake.symbolic import Expression, Variable
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import Multiplexer, SymbolicVectorSystem

from sdt_drake.errors import checked_count

Law = Callable[..., Sequence[Expression]]


class SymbolicLaw(Diagram):
    """Vector inputs, one vector output, and if need be a continuous state.

        dx/dt = rates(x, *inputs),    output = law(x, *inputs)

    Both are called once, with arrays of symbols. It does not sample, and knows no time but
    `self.time`, the symbol t, where `timed`.
    """

    time = Variable("t")

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
        """Inputs by name with their lengths; `rates` of `states` states, none by default.

        Raises:
            InputError: for a length that is not > 0.
        """
        super().__init__()
        for name, n in inputs.items():
            checked_count(n, f"length of {name}")
        signals = [np.array([Variable(f"{i}_{k}") for k in range(n)]) for i, n in inputs.items()]
        # Drake 1.51 aborts on a system of this kind without state in a continuous diagram.
        x = np.array([Variable(f"x_{k}") for k in range(max(states, 1))])
        with np.errstate(invalid="ignore"):  # numpy takes symbols for invalid numbers
            system = SymbolicVectorSystem(
                time=self.time if timed else None,
                state=x,
                dynamics=[Expression(0)] if rates is None else list(rates(x, *signals)),
                input=np.concatenate(signals),
                output=list(law(x, *signals)),
            )
        builder = DiagramBuilder()
        builder.AddNamedSystem("law", system)
        ports = [system.get_input_port()]
        if len(inputs) > 1:
            stack = builder.AddNamedSystem("inputs", Multiplexer(list(inputs.values())))
            builder.Connect(stack.get_output_port(), system.get_input_port())
            ports = [stack.get_input_port(i) for i in range(len(inputs))]
        for name, port in zip(inputs, ports, strict=True):
            builder.ExportInput(port, name)
        builder.ExportOutput(system.get_output_port(), output)
        builder.BuildInto(self)
