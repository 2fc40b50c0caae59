"""The decoupled axes. State: position and speed of each joint."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.primitives import LinearSystem, Multiplexer

from sdt_drake.errors import checked_vector
from sdt_drake.systems.block import Block


def axis_process_block(block: Block, *, i_eff: ArrayLike, gear_ratio: ArrayLike) -> None:
    """n motors with constant inertia, each on its own (Eq. 1).

        I_eff r dv/dt = tau - load_torque,    dq/dt = v

    Torques and I_eff motor side, q and v joint side. It knows no coupling, gravity or friction
    but what `load_torque` brings.

    .. pydrake_system::

        name: axis_process
        input_ports:
        - tau
        - load_torque
        output_ports:
        - state

    Args:
        i_eff: effective inertia, motor side [kg m²], shape (n,), > 0.
        gear_ratio: r [-], shape (n,), > 0.

    Raises:
        InputError: for values that are not finite and > 0.
    """
    n = np.size(i_eff)
    i_eff = checked_vector(i_eff, n, "i_eff", positive=True)
    gear_ratio = checked_vector(gear_ratio, n, "gear_ratio", positive=True)
    zero, one = np.zeros((n, n)), np.eye(n)
    per_torque = np.diag(1 / (i_eff * gear_ratio))
    torques = block.add(Multiplexer([n, n]), "inputs")
    motors = block.add(
        LinearSystem(
            A=np.block([[zero, one], [zero, zero]]),
            B=np.block([[zero, zero], [per_torque, -per_torque]]),
            C=np.eye(2 * n),
            D=np.zeros((2 * n, 2 * n)),
        )
    )
    block.connect(torques.get_output_port(), motors.get_input_port())
    block.inputs["tau"] = torques.get_input_port(0)
    block.inputs["load_torque"] = torques.get_input_port(1)
    block.outputs["state"] = motors.get_output_port()
