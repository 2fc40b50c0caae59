from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from pydrake.symbolic import Expression, Variable
from pydrake.systems.framework import Diagram
from pydrake.systems.primitives import SymbolicVectorSystem

from sdt_drake.systems.wiring import block_of

Symbols = NDArray[np.object_]
Law = Callable[..., Sequence[Expression] | Symbols]
TIME = Variable("t")
"""Symbol of the time in laws."""


def symbolic_law(
    *,
    inputs: Mapping[str, int],
    output: str,
    law: Law,
    rates: Law | None = None,
    states: int = 0,
    timed: bool = False,
    name: str = "symbolic_law",
) -> Diagram:
    """Make a block of vector inputs, one vector output and an optional continuous state.

        dx/dt = rates(x, *inputs),    output = law(x, *inputs)

    Both functions are called once, with arrays of symbols (without x if there is no state); they
    return expressions. The block is continuous. Formulas in C++ keep Python out of derivatives.

    Args:
        inputs: lengths of the inputs by name.
        output: name of the output.
        law: function that returns the output.
        rates: function that returns the derivatives of the states.
        states: number of states, those of the nested system "law".
        timed: True if `law` or `rates` use the time, the symbol `TIME`.
        name: name of the diagram.
    """
    signals = [np.array([Variable(f"{i}_{k}") for k in range(n)]) for i, n in inputs.items()]
    # At least one state: without it Drake 1.51 aborts in a continuous diagram.
    x = np.array([Variable(f"x_{k}") for k in range(max(states, 1))])
    arguments = [x, *signals] if states else signals
    with np.errstate(invalid="ignore"):  # numpy warns of symbols as invalid numbers
        system = SymbolicVectorSystem(
            time=TIME if timed else None,
            state=x,
            dynamics=np.array([Expression(0)] if rates is None else rates(*arguments)),
            input=np.concatenate(signals),
            output=np.array(law(*arguments)),
        )
    return block_of(name, system, inputs, output)
