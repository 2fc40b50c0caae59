"""The position loop of a cascade. No state: a function of held samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.primitives import MatrixGain, Multiplexer

from sdt_drake.errors import checked_vector
from sdt_drake.systems.block import Block


def position_loop_block(block: Block, *, position_gain: ArrayLike) -> None:
    """The reference of a speed loop that also keeps the position.

        v_ref + K_V (q_ref - q)  takes the place of  v_ref        [rad/s], joint side

    The state must be sampled at the instants of the reference: against the state of now, a held
    q_ref is late by half its period. It does not limit the speed that it asks for.

    .. pydrake_system::

        name: position_loop
        input_ports:
        - reference
        - state
        output_ports:
        - reference

    Args:
        position_gain: K_V [1/s], shape (n,), > 0.

    Raises:
        InputError: for gains that are not finite and > 0.
    """
    n = np.size(position_gain)
    k_v = np.diag(checked_vector(position_gain, n, "position_gain", positive=True))
    law = np.eye(3 * n, 5 * n)
    law[n : 2 * n, :n] = k_v
    law[n : 2 * n, 3 * n : 4 * n] = -k_v
    signals = block.add(Multiplexer([3 * n, 2 * n]), "inputs")
    loop = block.add(MatrixGain(law))
    block.connect(signals.get_output_port(), loop.get_input_port())
    block.inputs["reference"] = signals.get_input_port(0)
    block.inputs["state"] = signals.get_input_port(1)
    block.outputs["reference"] = loop.get_output_port()
