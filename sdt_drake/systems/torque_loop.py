from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import FirstOrderLowPassFilter, Gain

from sdt_drake.io.errors import checked_positive


class TorqueLoop(Diagram):
    """The torque loop of the drives: from commanded to real motor torque.

        T dtau/dt = (1 + error) tau_limited - tau,    T = 1 / (2 pi bandwidth)

    Torques are motor side [N m] and not limited. State, if there is a bandwidth: the torque over
    30 times its limit.

    Args:
        motor_torque_limit: largest torque of the motors, motor side [N m], shape (n,), > 0; the
            scale of the state.
        bandwidth: frequency at a gain of -3 dB [Hz], > 0; unlimited by default.
        error: relative error of the torque [-], shape (n,); 0 by default.

    .. pydrake_system::

        name: TorqueLoop
        input_ports: [tau_limited]
        output_ports: [tau]
    """

    def __init__(
        self,
        *,
        motor_torque_limit: ArrayLike,
        bandwidth: float | None = None,
        error: ArrayLike | None = None,
    ) -> None:
        super().__init__()
        builder = DiagramBuilder()
        limit = checked_positive(motor_torque_limit, "motor_torque_limit")
        gain = np.ones(len(limit)) if error is None else 1 + np.asarray(error)
        self._lag = None
        # Error control treats 1 N m like 1 rad/s. In units of 30 limits the torque is accurate to
        # 2e-3 of the limit at the default accuracy. 100 limits need up to 30 % fewer evaluations of
        # the loop, and give 7e-3.
        self._unit = 30 * limit
        if bandwidth is None:
            first = last = builder.AddNamedSystem("gain", Gain(gain))
        else:
            self._lag = FirstOrderLowPassFilter(1 / (2 * np.pi * bandwidth), len(limit))
            first = builder.AddNamedSystem("share", Gain(gain / self._unit))
            builder.AddNamedSystem("lag", self._lag)
            last = builder.AddNamedSystem("unit", Gain(self._unit))
            builder.Connect(first.get_output_port(), self._lag.get_input_port())
            builder.Connect(self._lag.get_output_port(), last.get_input_port())
        builder.ExportInput(first.get_input_port(), "tau_limited")
        builder.ExportOutput(last.get_output_port(), "tau")
        builder.BuildInto(self)

    def rest(self, context: Context, tau: ArrayLike) -> None:
        """Set the torque of the motors to `tau` [N m], motor side, shape (n,)."""
        if self._lag is not None:
            lag = self.GetMutableSubsystemContext(self._lag, context)
            lag.SetContinuousState(np.asarray(tau) / self._unit)
