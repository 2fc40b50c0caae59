"""The torque loop of the drives. State: the torque where it lags, over 100 times its limit."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.systems.primitives import FirstOrderLowPassFilter, Gain

from sdt_drake.errors import checked_number, checked_vector
from sdt_drake.systems.block import Block

Array = NDArray[np.float64]


def torque_loop_block(
    block: Block,
    *,
    motor_torque_limit: ArrayLike,
    bandwidth: float | None = None,
    error: ArrayLike | None = None,
) -> None:
    """What the motors make of the torque that they should give.

        T dtau/dt = (1 + error) tau_limited - tau,    T = 1 / (2 pi bandwidth)

    Torques motor side [N m]. It does not limit them. Without a bandwidth it does not lag, without
    an error it is exact.

    .. pydrake_system::

        name: torque_loop
        input_ports:
        - tau_limited
        output_ports:
        - tau

    Args:
        motor_torque_limit: largest torque of the motors, motor side [N m], shape (n,), > 0; the
            size of the signal.
        bandwidth: frequency at which the gain has fallen by 3 dB [Hz], > 0; infinite by default.
        error: share of the torque [-], shape (n,); 0 by default.

    Raises:
        InputError: for other values.
    """
    n = np.size(motor_torque_limit)
    limit = checked_vector(motor_torque_limit, n, "motor_torque_limit", positive=True)
    gain = 1 + (np.zeros(n) if error is None else checked_vector(error, n, "torque error"))
    if bandwidth is None:
        motor = block.add(Gain(gain))
        block.inputs["tau_limited"] = motor.get_input_port()
        block.outputs["tau"] = motor.get_output_port()
        return
    checked_number(bandwidth, "torque bandwidth", minimum=0, exclusive=True)
    unit = torque_unit(limit)
    share = block.add(Gain(gain / unit), "share")
    lag = block.add(FirstOrderLowPassFilter(1 / (2 * np.pi * bandwidth), n))
    motor = block.add(Gain(unit), "unit")
    block.connect(share.get_output_port(), lag.get_input_port())
    block.connect(lag.get_output_port(), motor.get_input_port())
    block.inputs["tau_limited"] = share.get_input_port()
    block.outputs["tau"] = motor.get_output_port()


def torque_unit(motor_torque_limit: ArrayLike) -> Array:
    """Of the state of a torque loop that lags [N m], shape (n,).

    An error-controlled integrator takes 1 N m as seriously as 1 rad/s. In units of 100 limits the
    torque is good to 1e-3 of the limit while it settles, the speeds to 1e-5.
    """
    return 100 * np.asarray(motor_torque_limit)
