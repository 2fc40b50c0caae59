import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import Diagram
from pydrake.systems.primitives import LinearSystem

from sdt_drake.io.arguments import positives
from sdt_drake.systems.wiring import block_of


def axis_process(*, i_eff: ArrayLike, gear_ratio: ArrayLike) -> Diagram:
    """Make the axis plant: n independent motors with constant inertia (Eq. 1).

        I_eff r dv/dt = tau - load_torque,    dq/dt = v

    Torques and I_eff are motor side, q and v joint side. State: q and v, of the nested system
    "motors". Coupling, gravity and friction act only through `load_torque`.

    Args:
        i_eff: effective inertia, motor side [kg m²], shape (n,), > 0.
        gear_ratio: r [-], shape (n,), > 0.

    .. pydrake_system::

        name: axis_process
        input_ports: [tau, load_torque]
        output_ports: [state]
    """
    i_eff = positives(i_eff, "i_eff")
    n = len(i_eff)
    zero, one = np.zeros((n, n)), np.eye(n)
    per_torque = np.diag(1 / (i_eff * positives(gear_ratio, "gear_ratio", n)))
    motors = LinearSystem(
        A=np.block([[zero, one], [zero, zero]]),
        B=np.block([[zero, zero], [per_torque, -per_torque]]),
        C=np.eye(2 * n),
    )
    return block_of("axis_process", motors, {"tau": n, "load_torque": n}, "state", "motors")
