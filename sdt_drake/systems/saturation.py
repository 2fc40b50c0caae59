"""Dynamic saturation of the motors' torque. No state."""

from __future__ import annotations

import numpy as np
import pydrake.symbolic as sym
from numpy.typing import ArrayLike

from sdt_drake.errors import checked_vector
from sdt_drake.systems.block import Block
from sdt_drake.systems.symbolic import add_static_law

_TINY = np.finfo(float).tiny


def dynamic_saturation_block(block: Block, *, motor_torque_limit: ArrayLike) -> None:
    """The motors' limits, widened by the help of the other motors (Section 3.2, Figure 3).

        tau = clip(tau_cmd, -L + min(a, 0), L + max(a, 0))      [N m], motor side

    with L the largest motor torque and a the alleviating torque. The paper widens the limit in the
    direction of the reference acceleration; a always has the sign of that. With a = 0 it is a
    plain saturation. It does not tell the controller that it saturates.

    .. pydrake_system::

        name: dynamic_saturation
        input_ports:
        - tau_cmd
        - alleviating_torque
        output_ports:
        - tau

    Args:
        motor_torque_limit: L, motor side [N m], shape (n,), > 0.

    Raises:
        InputError: for limits that are not finite and > 0.
    """
    n = np.size(motor_torque_limit)
    limit = checked_vector(motor_torque_limit, n, "motor_torque_limit", positive=True)

    def law(_time, tau_cmd, a):
        # min(a, 0) and max(a, 0) with a derivative at a = 0 as well: Drake's are NaN there.
        lower = [sym.if_then_else(a[k] < -_TINY, a[k], 0) - limit[k] for k in range(n)]
        upper = [sym.if_then_else(a[k] > _TINY, a[k], 0) + limit[k] for k in range(n)]
        return [sym.min(sym.max(tau_cmd[k], lower[k]), upper[k]) for k in range(n)]

    add_static_law(block, n, inputs=("tau_cmd", "alleviating_torque"), output="tau", law=law)
