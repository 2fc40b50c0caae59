import numpy as np
import pydrake.symbolic as sym
from numpy.typing import ArrayLike
from pydrake.systems.framework import Diagram
from pydrake.systems.primitives import Saturation

from sdt_drake.io.arguments import positives
from sdt_drake.io.errors import InputError
from sdt_drake.robot.envelope import Envelope
from sdt_drake.robot.envelope import widened as widened_by
from sdt_drake.systems.symbolic import Symbols, symbolic_law
from sdt_drake.systems.wiring import block_of


def dynamic_saturation(
    *,
    motor_torque_limit: ArrayLike,
    gear_ratio: ArrayLike = 1.0,
    n1: ArrayLike | None = None,
    n0: ArrayLike | None = None,
    widened: bool = True,
) -> Diagram:
    """Make the motors' torque limits, widened by the alleviating torque (Section 3.2, Figure 3).

        tau_limited = clip(tau_cmd, -L + min(a, 0), L + max(a, 0))      [N m], motor side

    L is the largest motor torque, a the alleviating torque. The paper widens the limit in the
    direction of the reference acceleration; a always has its sign. The controller gets no signal of
    saturation.

    A torque-speed envelope reduces L in the direction of motion: along a straight line from its
    full value at motor speed n1 to 0 at n0. The braking torque is not reduced. The block then has
    one more input, `motor_state`.

    Args:
        motor_torque_limit: L, motor side [N m], shape (n,), > 0.
        gear_ratio: r [-], shape (n,), for the envelope.
        n1, n0: motor speeds of the envelope [rad/s], shape (n,), 0 < n1 < n0, or inf for a motor
            with a constant limit; a constant limit by default.
        widened: True for an input `alleviating_torque`; else a = 0.

    .. pydrake_system::

        name: dynamic_saturation
        input_ports: [tau_cmd, alleviating_torque]
        output_ports: [tau_limited]
    """
    if (n1 is None) != (n0 is None):
        raise InputError("one is missing, expected both or neither", place="n1, n0")
    limit = positives(motor_torque_limit, "motor_torque_limit")
    n = len(limit)
    rated, no_load = (np.broadcast_to(np.inf if w is None else w, n) for w in (n1, n0))
    envelope = Envelope(rated, no_load, "")
    inputs = {"tau_cmd": n}
    inputs |= {"alleviating_torque": n} if widened else {}
    inputs |= {"motor_state": 2 * n} if envelope.limits else {}
    if len(inputs) == 1:  # Drake's own block is faster than a symbolic law
        return block_of("dynamic_saturation", Saturation(-limit, limit), inputs, "tau_limited")

    # By symbols: Drake's Saturation with ports for its limits is not bound in Python.
    def law(*arguments: Symbols) -> list[sym.Expression]:
        signals = dict(zip(inputs, arguments, strict=True))
        speed = np.zeros(n)
        if "motor_state" in signals:
            speed = np.asarray(gear_ratio) * signals["motor_state"][n:]
        lower, upper = envelope.range(limit, speed)
        if "alleviating_torque" in signals:
            lower, upper = widened_by(lower, upper, signals["alleviating_torque"])
        # This order maps NaN to a limit: Drake never ends an integration of NaN.
        tau_cmd = signals["tau_cmd"]
        return [sym.min(sym.max(lower[k], tau_cmd[k]), upper[k]) for k in range(n)]

    return symbolic_law(inputs=inputs, output="tau_limited", law=law, name="dynamic_saturation")
