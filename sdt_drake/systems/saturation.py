from __future__ import annotations

import numpy as np
import pydrake.symbolic as sym
from numpy.typing import ArrayLike
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import Saturation

from sdt_drake.io.errors import InputError, checked_positive
from sdt_drake.robot.envelope import Envelope
from sdt_drake.robot.envelope import widened as widened_by
from sdt_drake.systems.symbolic import Symbols, add_law


class DynamicSaturation(Diagram):
    """The motors' torque limits, widened by the alleviating torque (Section 3.2, Figure 3).

        tau = clip(tau_cmd, -L + min(a, 0), L + max(a, 0))      [N m], motor side

    L is the largest motor torque, a the alleviating torque. The paper widens the limit in the
    direction of the reference acceleration; a always has its sign. The controller gets no signal of
    saturation.

    A torque-speed envelope reduces L in the direction of motion: along a straight line from its
    full value at motor speed n1 to 0 at n0. The braking torque is not reduced. The block then has
    one more input, `state`.

    Args:
        motor_torque_limit: L, motor side [N m], shape (n,), > 0.
        gear_ratio: r [-], shape (n,), for the envelope.
        n1, n0: motor speeds of the envelope [rad/s], shape (n,), 0 < n1 < n0, or inf for a motor
            with a constant limit; a constant limit by default.
        widened: True for an input `alleviating_torque`; else a = 0.

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
            raise InputError("one is missing, expected both or neither", place="n1, n0")
        super().__init__()
        builder = DiagramBuilder()
        limit = checked_positive(motor_torque_limit, "motor_torque_limit")
        n = len(limit)
        rated, no_load = (np.broadcast_to(np.inf if w is None else w, n) for w in (n1, n0))
        envelope = Envelope(rated, no_load, "")
        inputs = {"tau_cmd": n}
        inputs |= {"alleviating_torque": n} if widened else {}
        inputs |= {"state": 2 * n} if np.isfinite(no_load).any() else {}

        def law(*arguments: Symbols) -> list[sym.Expression]:
            signals = dict(zip(inputs, arguments, strict=True))
            speed = np.zeros(n)
            if "state" in signals:
                speed = np.asarray(gear_ratio) * signals["state"][n:]
            lower, upper = envelope.range(limit, speed)
            if "alleviating_torque" in signals:
                lower, upper = widened_by(lower, upper, signals["alleviating_torque"])
            # This order maps NaN to a limit: Drake never ends an integration of NaN.
            tau_cmd = signals["tau_cmd"]
            return [sym.min(sym.max(lower[k], tau_cmd[k]), upper[k]) for k in range(n)]

        if len(inputs) > 1:
            add_law(builder, inputs, "tau", law)
        else:  # Drake's own block is faster than a symbolic law
            constant = builder.AddNamedSystem("law", Saturation(-limit, limit))
            builder.ExportInput(constant.get_input_port(), "tau_cmd")
            builder.ExportOutput(constant.get_output_port(), "tau")
        builder.BuildInto(self)
