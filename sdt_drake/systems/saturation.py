"""Dynamic saturation of the motors' torque. No state."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pydrake.symbolic as sym
from numpy.typing import ArrayLike, NDArray
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import Saturation

from sdt_drake.errors import InputError, checked_vector
from sdt_drake.systems.symbolic import SymbolicLaw

Array = NDArray[np.float64]

_TINY = np.finfo(float).tiny


@dataclass(frozen=True, eq=False)
class Envelope:
    """Torque-speed envelope of n motors: full torque up to n1, then a straight line to 0 at n0.

    Attributes:
        n1, n0: motor speeds [rad/s], shape (n,), 0 < n1 < n0.
        gear_ratio: r [-], shape (n,).
    """

    n1: Array
    n0: Array
    gear_ratio: Array

    def checked(self, n: int) -> Envelope:
        """The same, of n motors.

        Raises:
            InputError: for values that are not finite and > 0, or n1 >= n0.
        """
        n1, n0, gear_ratio = (
            checked_vector(getattr(self, name), n, name, positive=True)
            for name in ("n1", "n0", "gear_ratio")
        )
        if np.any(n1 >= n0):
            raise InputError(f"n0: {n0.tolist()}, expected more than n1, {n1.tolist()}, everywhere")
        return Envelope(n1, n0, gear_ratio)

    def share(self, motor_speed):
        """What is left of the torque in the direction of `motor_speed` (symbols), in [0, 1]."""
        left = (self.n0 - motor_speed) / (self.n0 - self.n1)
        return np.array([sym.min(sym.max(share, 0.0), 1.0) for share in left])


class DynamicSaturation(SymbolicLaw):
    """The motors' limits, widened by the help of the other motors (Section 3.2, Figure 3).

        tau = clip(tau_cmd, -L + min(a, 0), L + max(a, 0))      [N m], motor side

    with L the largest motor torque and a the alleviating torque. The paper widens the limit in the
    direction of the reference acceleration; a always has the sign of that. It does not tell the
    controller that it saturates.

    With an envelope, L falls from its full value at the motor speed n1 to 0 at n0, in the direction
    in which the motor turns; against it (braking) the supply voltage limits nothing. The block then
    has one more input, `state`.

    .. pydrake_system::

        name: DynamicSaturation
        input_ports:
        - tau_cmd
        - alleviating_torque
        output_ports:
        - tau
    """

    symbol = "dynamic\nsaturation"

    def __init__(
        self,
        *,
        motor_torque_limit: ArrayLike,
        envelope: Envelope | None = None,
        widened: bool = True,
    ) -> None:
        """Of n motors.

        Args:
            motor_torque_limit: L, motor side [N m], shape (n,), > 0.
            envelope: the speeds n1 and n0; a constant limit by default.
            widened: whether there is an input `alleviating_torque`; else a = 0.

        Raises:
            InputError: for limits or an envelope that are not finite and > 0, or n1 >= n0.
        """
        n = np.size(motor_torque_limit)
        limit = checked_vector(motor_torque_limit, n, "motor_torque_limit", positive=True)
        if envelope is not None:
            envelope = envelope.checked(n)
        elif not widened:
            self._build_plain(limit)
            return

        def law(_x, tau_cmd, *others):
            down, up = limit, limit
            if envelope is not None:
                motor_speed = envelope.gear_ratio * others[-1][n:]
                down, up = limit * envelope.share(-motor_speed), limit * envelope.share(motor_speed)
            lower, upper = -down, up
            if widened:
                # min(a, 0) and max(a, 0) with a derivative at a = 0 as well: Drake's are NaN there.
                a = others[0]
                lower = [sym.if_then_else(a[k] < -_TINY, a[k], 0) - down[k] for k in range(n)]
                upper = [sym.if_then_else(a[k] > _TINY, a[k], 0) + up[k] for k in range(n)]
            return [sym.min(sym.max(tau_cmd[k], lower[k]), upper[k]) for k in range(n)]

        inputs = {"tau_cmd": n}
        if widened:
            inputs["alleviating_torque"] = n
        if envelope is not None:
            inputs["state"] = 2 * n
        super().__init__(inputs=inputs, output="tau", law=law)

    def _build_plain(self, limit: Array) -> None:
        """With constant limits: Drake's own block, which is quicker than a law in symbols."""
        Diagram.__init__(self)
        builder = DiagramBuilder()
        clip = builder.AddNamedSystem("law", Saturation(-limit, limit))
        builder.ExportInput(clip.get_input_port(), "tau_cmd")
        builder.ExportOutput(clip.get_output_port(), "tau")
        builder.BuildInto(self)
