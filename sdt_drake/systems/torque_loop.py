"""The torque loop of the drives. State: the torque where it lags, over 100 times its limit."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import FirstOrderLowPassFilter, Gain

from sdt_drake.errors import checked_number, checked_vector


class TorqueLoop(Diagram):
    """What the motors make of the torque that they should give.

        T dtau/dt = (1 + error) tau_limited - tau,    T = 1 / (2 pi bandwidth)

    Torques motor side [N m]. It does not limit them. Without a bandwidth it does not lag, without
    an error it is exact.

    .. pydrake_system::

        name: TorqueLoop
        input_ports:
        - tau_limited
        output_ports:
        - tau
    """

    symbol = "torque\nloop"

    def __init__(
        self,
        *,
        motor_torque_limit: ArrayLike,
        bandwidth: float | None = None,
        error: ArrayLike | None = None,
    ) -> None:
        """Of n motors.

        Args:
            motor_torque_limit: largest torque of the motors, motor side [N m], shape (n,), > 0; the
                size of the signal.
            bandwidth: frequency at which the gain has fallen by 3 dB [Hz], > 0; infinite by
                default.
            error: share of the torque [-], shape (n,); 0 by default.

        Raises:
            InputError: for other values.
        """
        super().__init__()
        n = np.size(motor_torque_limit)
        limit = checked_vector(motor_torque_limit, n, "motor_torque_limit", positive=True)
        gain = 1 + (np.zeros(n) if error is None else checked_vector(error, n, "torque error"))
        self._lag = None
        # An error-controlled integrator takes 1 N m as seriously as 1 rad/s. In units of 100 limits
        # the torque is good to 1e-3 of the limit while it settles, the speeds to 1e-5.
        self._unit = 100 * limit
        builder = DiagramBuilder()
        add, connect = builder.AddNamedSystem, builder.Connect
        if bandwidth is None:
            first = last = add("gain", Gain(gain))
        else:
            checked_number(bandwidth, "torque bandwidth", minimum=0, exclusive=True)
            first, last = add("share", Gain(gain / self._unit)), add("unit", Gain(self._unit))
            self._lag = add("lag", FirstOrderLowPassFilter(1 / (2 * np.pi * bandwidth), n))
            connect(first.get_output_port(), self._lag.get_input_port())
            connect(self._lag.get_output_port(), last.get_input_port())
        builder.ExportInput(first.get_input_port(), "tau_limited")
        builder.ExportOutput(last.get_output_port(), "tau")
        builder.BuildInto(self)

    def rest(self, context: Context, tau: ArrayLike) -> None:
        """Start with motors that give `tau` [N m], motor side, shape (n,)."""
        if self._lag is not None:
            own = self.GetMutableSubsystemContext(self._lag, context)
            own.SetContinuousState(np.asarray(tau) / self._unit)
