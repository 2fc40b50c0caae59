import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.primitives import LinearSystem, Multiplexer

from sdt_drake.io.arguments import positives
from sdt_drake.io.arrays import Array

_UNIT = 1e12  # unit of the integral [-]: makes it negligible in the integrator's error control


def add_meter(
    builder: DiagramBuilder,
    *,
    motor_torque_limit: ArrayLike,
    tau_cmd: OutputPort,
    tau_limited: OutputPort,
    tau: OutputPort,
) -> OutputPort:
    """Add an integrator of the motors' torque to a diagram, for a log at the integrator's steps.

        metered = int tau / (1e12 L) dt

    The integral does not affect the step size of an error-controlled integrator. It is as accurate
    as the steps for the other states.

    Args:
        builder: builder of the diagram.
        motor_torque_limit: L, largest torque of the motors [N m], shape (n,), > 0.
        tau_cmd, tau_limited, tau: outputs of length n: torque before saturation, after saturation
            and of the motors, motor side [N m].

    Returns:
        Output of length 4n: the three torques and the integral.
    """
    limit = positives(motor_torque_limit, "motor_torque_limit")
    n = len(limit)
    # Named "log.": `blocks_of` leaves measuring blocks out.
    zero, one = np.zeros((n, n)), np.eye(n)
    integrator = LinearSystem(A=zero, B=np.diag(1 / (_UNIT * limit)), C=one, D=zero)
    integral = builder.AddNamedSystem("log.meter", integrator)
    signals = builder.AddNamedSystem("log.signals", Multiplexer([n] * 4))
    builder.Connect(tau, integral.get_input_port())
    for i, port in enumerate((tau_cmd, tau_limited, tau, integral.get_output_port())):
        builder.Connect(port, signals.get_input_port(i))
    return signals.get_output_port()


def mean_torque(metered: Array, limit: Array, span: Array) -> Array:
    """Return the mean torque of each step [N m], shape (N, n).

    Args:
        metered: integral at the start and at the end of N steps [s], shape (2, N, n).
        limit: L, motor_torque_limit of `add_meter` [N m], shape (n,).
        span: duration of each step [s], shape (N, 1).
    """
    start, end = metered
    return (end - start) * (_UNIT * limit) / span
