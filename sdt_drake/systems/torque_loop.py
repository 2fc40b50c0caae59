import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, System
from pydrake.systems.primitives import FirstOrderLowPassFilter, Gain

from sdt_drake.io.arguments import positives
from sdt_drake.io.arrays import Array
from sdt_drake.systems.wiring import build, set_state


def torque_loop(
    *,
    motor_torque_limit: ArrayLike,
    bandwidth: float | None = None,
    error: ArrayLike | None = None,
) -> Diagram:
    """Make the torque loop of the drives: from commanded to real motor torque.

        T dtau/dt = (1 + error) tau_limited - tau,    T = 1 / (2 pi bandwidth)

    Torques are motor side [N m] and not limited. State, if there is a bandwidth: the torque over
    30 times its limit.

    Args:
        motor_torque_limit: largest torque of the motors, motor side [N m], shape (n,), > 0; the
            scale of the state.
        bandwidth: frequency at a gain of -3 dB [Hz], > 0; unlimited by default.
        error: relative error of the torque [-], shape (n,); 0 by default.

    .. pydrake_system::

        name: torque_loop
        input_ports: [tau_limited]
        output_ports: [tau]
    """
    builder = DiagramBuilder()
    unit = torque_unit(motor_torque_limit)
    gain = np.ones(len(unit)) if error is None else 1 + np.asarray(error)
    if bandwidth is None:
        first = last = builder.AddNamedSystem("gain", Gain(gain))
    else:
        lag = FirstOrderLowPassFilter(1 / (2 * np.pi * bandwidth), len(unit))
        first = builder.AddNamedSystem("share", Gain(gain / unit))
        builder.AddNamedSystem("lag", lag)
        last = builder.AddNamedSystem("unit", Gain(unit))
        builder.Connect(first.get_output_port(), lag.get_input_port())
        builder.Connect(lag.get_output_port(), last.get_input_port())
    builder.ExportInput(first.get_input_port(), "tau_limited")
    builder.ExportOutput(last.get_output_port(), "tau")
    return build(builder, "torque_loop")


def set_motor_torque(
    loop: System, context: Context, tau: ArrayLike, *, motor_torque_limit: ArrayLike
) -> None:
    """Set the motors' torque to `tau` [N m], motor side, shape (n,), in a loop with a bandwidth."""
    if isinstance(loop, Diagram) and loop.HasSubsystemNamed("lag"):
        set_state(loop, context, "lag", np.asarray(tau) / torque_unit(motor_torque_limit))


def torque_unit(motor_torque_limit: ArrayLike) -> Array:
    """Return the torque of 1 unit of the state [N m], shape (n,).

    Error control treats 1 N m like 1 rad/s. In units of 30 limits the torque is accurate to 2e-3 of
    the limit at the default accuracy. 100 limits need up to 30 % fewer evaluations of the loop, and
    give 7e-3.
    """
    return 30 * positives(motor_torque_limit, "motor_torque_limit")
