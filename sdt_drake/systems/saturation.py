from __future__ import annotations

import numpy as np
import pydrake.symbolic as sym
from numpy.typing import ArrayLike
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import Saturation

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, checked_positive
from sdt_drake.systems.symbolic import Symbols, add_law

_TINY = np.finfo(float).tiny
_NOTHING, _ALL = sym.Expression(0), sym.Expression(1)


class DynamicSaturation(Diagram):
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
        super().__init__()
        builder = DiagramBuilder()
        limit = checked_positive(motor_torque_limit, "motor_torque_limit")
        n = len(limit)
        rated, no_load = (np.broadcast_to(np.inf if w is None else w, n) for w in (n1, n0))
        inputs = {"tau_cmd": n}
        inputs |= {"alleviating_torque": n} if widened else {}
        inputs |= {"state": 2 * n} if np.isfinite(no_load).any() else {}

        def law(*arguments: Symbols) -> list[sym.Expression]:
            signals = dict(zip(inputs, arguments, strict=True))
            lower: Array | Symbols = -limit
            upper: Array | Symbols = limit
            if "state" in signals:
                motor_speed = np.asarray(gear_ratio) * signals["state"][n:]
                lower = -limit * _envelope(-motor_speed, rated, no_load)
                upper = limit * _envelope(motor_speed, rated, no_load)
            if "alleviating_torque" in signals:
                lower, upper = _widened(lower, upper, signals["alleviating_torque"])
            # In this order NaN becomes a limit: at a NaN in its state Drake integrates for ever.
            tau_cmd = signals["tau_cmd"]
            return [sym.min(sym.max(lower[k], tau_cmd[k]), upper[k]) for k in range(n)]

        if len(inputs) > 1:
            add_law(builder, inputs, "tau", law)
        else:  # Drake's own block is quicker than a law in symbols
            constant = builder.AddNamedSystem("law", Saturation(-limit, limit))
            builder.ExportInput(constant.get_input_port(), "tau_cmd")
            builder.ExportOutput(constant.get_output_port(), "tau")
        builder.BuildInto(self)


def _envelope(motor_speed: Symbols, rated: Array, no_load: Array) -> Symbols:
    """Share of the largest torque in the direction of the speed: all up to n1, none from n0 on."""
    share = [_ALL] * len(no_load)
    for k in np.flatnonzero(np.isfinite(no_load)):
        left = (no_load[k] - motor_speed[k]) / (no_load[k] - rated[k])
        share[k] = sym.min(sym.max(left, _NOTHING), _ALL)
    return np.array(share)


def _widened(
    lower: Array | Symbols, upper: Array | Symbols, help_: Symbols
) -> tuple[Symbols, Symbols]:
    """Limits moved apart by min(a, 0) and max(a, 0), of the alleviating torque a."""
    # With a derivative at a = 0 as well: that of Drake's own min and max is NaN there.
    down = [sym.if_then_else(a < -_TINY, a, _NOTHING) for a in help_]
    up = [sym.if_then_else(a > _TINY, a, _NOTHING) for a in help_]
    return lower + down, upper + up
