from __future__ import annotations

import numpy as np
import pydrake.symbolic as sym
from numpy.typing import ArrayLike
from pydrake.systems.primitives import Saturation

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, checked_positive
from sdt_drake.systems.symbolic import SymbolicLaw, Symbols
from sdt_drake.systems.wiring import Wired

_TINY = np.finfo(float).tiny


class DynamicSaturation(SymbolicLaw):
    """The motors' limits, widened by the help of the other motors (Section 3.2, Figure 3).

        tau = clip(tau_cmd, -L + min(a, 0), L + max(a, 0))      [N m], motor side

    with L the largest motor torque and a the alleviating torque. The paper widens the limit in the
    direction of the reference acceleration; a always has the sign of that. It does not tell the
    controller that it saturates.

    With a torque-speed envelope, L falls on a straight line from its full value at the motor speed
    n1 to 0 at n0, in the direction in which the motor turns; against it (braking) the supply
    voltage limits nothing. The block then has one more input, `state`.

    Args:
        motor_torque_limit: L, motor side [N m], shape (n,), > 0.
        gear_ratio: r [-], shape (n,), for the envelope.
        n1, n0: motor speeds of the envelope [rad/s], shape (n,), 0 < n1 < n0, or inf for a motor
            with a constant limit; a constant limit by default.
        widened: whether there is an input `alleviating_torque`; else a = 0.

    .. pydrake_system::

        name: DynamicSaturation
        input_ports: [tau_cmd, alleviating_torque]
        output_ports: [tau]
    """

    symbol = "dynamic\nsaturation"

    def __init__(
        self,
        *,
        motor_torque_limit: ArrayLike,
        gear_ratio: ArrayLike = 1.0,
        n1: ArrayLike | None = None,
        n0: ArrayLike | None = None,
        widened: bool = True,
    ) -> None:
        if (n1 is None) != (n0 is None):
            raise InputError("n1, n0: one is missing, expected both or neither")
        limit = checked_positive(motor_torque_limit, "motor_torque_limit")
        n = len(limit)
        rated, no_load = (np.broadcast_to(np.inf if w is None else w, n) for w in (n1, n0))
        has_envelope = bool(np.isfinite(no_load).any())
        if not has_envelope and not widened:
            self.symbol = "saturation"
            Wired.__init__(self)  # Drake's own block is quicker than a law in symbols
            self.add("law", Saturation(-limit, limit), "tau_cmd", "tau")
            self.build("tau")
            return

        nothing, all_of_it = sym.Expression(0), sym.Expression(1)

        def within_envelope(motor_speed: Symbols) -> Symbols:
            left = [all_of_it] * n
            for k in np.flatnonzero(np.isfinite(no_load)):
                share = (no_load[k] - motor_speed[k]) / (no_load[k] - rated[k])
                left[k] = sym.min(sym.max(share, nothing), all_of_it)
            return limit * np.array(left)

        def law(tau_cmd: Symbols, *others: Symbols) -> list[sym.Expression]:
            lower: Array | Symbols = -limit
            upper: Array | Symbols = limit
            if has_envelope:
                motor_speed = np.asarray(gear_ratio) * others[-1][n:]
                lower, upper = -within_envelope(-motor_speed), within_envelope(motor_speed)
            if widened:
                # min(a, 0) and max(a, 0) with a derivative at a = 0 as well: Drake's are NaN there.
                a = others[0]
                lower = lower + [sym.if_then_else(help_ < -_TINY, help_, nothing) for help_ in a]
                upper = upper + [sym.if_then_else(help_ > _TINY, help_, nothing) for help_ in a]
            # In this order NaN becomes a limit: at a NaN in its state Drake integrates for ever.
            return [sym.min(sym.max(lower[k], tau_cmd[k]), upper[k]) for k in range(n)]

        inputs = {"tau_cmd": n}
        inputs |= {"alleviating_torque": n} if widened else {}
        inputs |= {"state": 2 * n} if has_envelope else {}
        super().__init__(inputs=inputs, output="tau", law=law)
