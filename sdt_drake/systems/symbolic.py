from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from pydrake.symbolic import Expression, Variable
from pydrake.systems.primitives import Multiplexer, SymbolicVectorSystem

from sdt_drake.systems.wiring import Wired

Symbols = NDArray[np.object_]
Law = Callable[..., Sequence[Expression]]


class SymbolicLaw(Wired):
    """Vector inputs, one vector output, and if need be a continuous state.

        dx/dt = rates(x, *inputs),    output = law(x, *inputs)

    Both are called once, with arrays of symbols, without x where there is no state. It does not
    sample, and knows no time but `self.time`, the symbol t, where `timed`.
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
        """Inputs by name with their lengths; `rates` of `states` states, none by default."""
        super().__init__()
        signals = [np.array([Variable(f"{i}_{k}") for k in range(n)]) for i, n in inputs.items()]
        # Drake 1.51 aborts on a system of this kind without state in a continuous diagram.
        x = np.array([Variable(f"x_{k}") for k in range(max(states, 1))])
        arguments = [x, *signals] if states else signals
        with np.errstate(invalid="ignore"):  # numpy takes symbols for invalid numbers
            system = SymbolicVectorSystem(
                time=self.time if timed else None,
                state=x,
                dynamics=np.array([Expression(0)] if rates is None else rates(*arguments)),
                input=np.concatenate(signals),
                output=np.array(law(*arguments)),
            )
        if len(inputs) > 1:
            self.add("inputs", Multiplexer(list(inputs.values())), *inputs, "inputs")
        self.add("law", system, "inputs" if len(inputs) > 1 else next(iter(inputs)), output)
        self.build(output)
