import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, System
from pydrake.systems.primitives import Adder, Gain, LinearSystem, MatrixGain

from sdt_drake.io.arguments import positives
from sdt_drake.systems.torque_loop import torque_unit
from sdt_drake.systems.wiring import build, set_state


def disturbance_observer(
    *,
    inertia: ArrayLike,
    bandwidth: ArrayLike,
    gear_ratio: ArrayLike,
    motor_torque_limit: ArrayLike,
    period: float | None = None,
) -> Diagram:
    """Make n independent disturbance observers, one for each motor.

        disturbance = g / (s + g) (tau - J r dv/dt)      [N m], motor side

    It is the torque that the motor's torque tau needs beyond that for its acceleration: load,
    friction, and other inertia than J. The law has no derivative, with a state z of dz/dt = g (tau
    + g J r v - z) and the output z - g J r v. The output does not depend on tau at once. State: z
    over 30 limits, of the nested system "low_pass".

    Args:
        inertia: J, motor side [kg m²], shape (n,), > 0.
        bandwidth: g [rad/s], shape (n,), > 0.
        gear_ratio: r [-], shape (n,), > 0.
        motor_torque_limit: largest torque of the motors, motor side [N m], shape (n,), > 0; the
            scale of the state.
        period: sample period of a sampled observer [s], which is exact for held inputs. Continuous
            by default.

    .. pydrake_system::

        name: disturbance_observer
        input_ports: [tau, measured]
        output_ports: [disturbance]
    """
    inertia = positives(inertia, "inertia")
    n = len(inertia)
    g, unit = positives(bandwidth, "bandwidth", n), torque_unit(motor_torque_limit)
    momentum = np.diag(g * inertia * positives(gear_ratio, "gear_ratio", n))
    a, b = (-g, g) if period is None else (np.exp(-g * period), -np.expm1(-g * period))
    builder = DiagramBuilder()
    add, connect = builder.AddNamedSystem, builder.Connect
    rate = add("momentum_rate", MatrixGain(np.hstack([np.zeros((n, n)), momentum])))
    total, minus = add("acting", Adder(2, n)), add("minus", Gain(-1.0, n))
    zero, one = np.zeros((n, n)), np.diag(unit)
    law = LinearSystem(np.diag(a), np.diag(b / unit), one, zero, period or 0.0)
    low_pass, found = add("low_pass", law), add("disturbance", Adder(2, n))
    builder.ExportInput(total.get_input_port(0), "tau")
    builder.ExportInput(rate.get_input_port(), "measured")
    connect(rate.get_output_port(), total.get_input_port(1))
    connect(total.get_output_port(), low_pass.get_input_port())
    connect(low_pass.get_output_port(), found.get_input_port(0))
    connect(rate.get_output_port(), minus.get_input_port())
    connect(minus.get_output_port(), found.get_input_port(1))
    builder.ExportOutput(found.get_output_port(), "disturbance")
    return build(builder, "disturbance_observer")


def set_disturbance(
    observer: System,
    context: Context,
    tau: ArrayLike,
    v: ArrayLike,
    *,
    momentum: ArrayLike,
    motor_torque_limit: ArrayLike,
) -> None:
    """Set observers to a constant torque and speed of the joints.

    Args:
        observer: the block.
        context: its own context.
        tau: torque and disturbance, motor side [N m], shape (n,).
        v: speed, joint side [rad/s], shape (n,).
        momentum: g J r [N m s/rad], shape (n,).
        motor_torque_limit: that of the block.
    """
    z = np.asarray(tau) + np.asarray(momentum) * np.asarray(v)
    set_state(observer, context, "low_pass", z / torque_unit(motor_torque_limit))
