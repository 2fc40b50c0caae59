from __future__ import annotations

from numpy.typing import ArrayLike
from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.primitives import Gain, Integrator, Multiplexer

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import checked_positive

_UNIT = 1e12  # of the integral: so large that no error-controlled integrator sees it


def add_meter(
    builder: DiagramBuilder,
    *,
    motor_torque_limit: ArrayLike,
    tau_cmd: OutputPort,
    tau_limited: OutputPort,
    tau: OutputPort,
) -> OutputPort:
    """Add a meter of the torque's integral to a diagram, to log at the integrator's steps.

        metered = int tau / (1e12 L) dt

    The integral takes no part in the choice of an integrator's steps: it is as good as the steps
    that the rest of the diagram needs.

    Args:
        builder: of the diagram.
        motor_torque_limit: L, largest torque of the motors [N m], shape (n,), > 0.
        tau_cmd, tau_limited, tau: torques before and after the saturation, and as the drives give
            it, motor side [N m], length n.

    Returns:
        The three torques and the integral side by side, length 4n.
    """
    limit = checked_positive(motor_torque_limit, "motor_torque_limit")
    n = len(limit)
    # Names of logs: what only measures is no block of a loop.
    scale = builder.AddNamedSystem("log.scale", Gain(1 / (_UNIT * limit)))
    integral = builder.AddNamedSystem("log.meter", Integrator(n))
    signals = builder.AddNamedSystem("log.signals", Multiplexer([n] * 4))
    builder.Connect(tau, scale.get_input_port())
    builder.Connect(scale.get_output_port(), integral.get_input_port())
    for i, port in enumerate((tau_cmd, tau_limited, tau, integral.get_output_port())):
        builder.Connect(port, signals.get_input_port(i))
    return signals.get_output_port()


def mean_torque(metered: Array, limit: Array, span: Array) -> Array:
    """Return the mean torque of each step [N m], shape (N, n).

    Args:
        metered: integral at the beginning and at the end of N steps, shape (2, N, n).
        limit: L, as of the meter.
        span: length of each step [s], shape (N, 1).
    """
    start, end = metered
    return (end - start) * (_UNIT * limit) / span
