import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import Diagram
from pydrake.systems.primitives import MatrixGain

from sdt_drake.io.arguments import positives
from sdt_drake.systems.wiring import block_of


def position_loop(*, position_gain: ArrayLike) -> Diagram:
    """Make a position loop: the position error corrects the speed reference.

        speed_reference = [q_ref, v_ref + K_V (q_ref - q), vd_ref]        joint side

    The state must be sampled at the instants at which the reference arrives: a held q_ref lags the
    continuous state by half its period. The speed is not limited.

    Args:
        position_gain: K_V [1/s], shape (n,), > 0.

    .. pydrake_system::

        name: position_loop
        input_ports: [reference, sampled_state]
        output_ports: [speed_reference]
    """
    position_gain = positives(position_gain, "position_gain")
    n = len(position_gain)
    law = np.eye(3 * n, 5 * n)
    law[n : 2 * n, :n] = np.diag(position_gain)
    law[n : 2 * n, 3 * n : 4 * n] = -np.diag(position_gain)
    inputs = {"reference": 3 * n, "sampled_state": 2 * n}
    return block_of("position_loop", MatrixGain(law), inputs, "speed_reference")
