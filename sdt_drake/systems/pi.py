import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, System
from pydrake.systems.primitives import Adder, DiscreteTimeIntegrator, Gain, Integrator, MatrixGain

from sdt_drake.io.arguments import finite_number, positives
from sdt_drake.systems.gains import SpeedGains
from sdt_drake.systems.wiring import build, set_state


def pi_speed_controller(
    *,
    gains: SpeedGains,
    gear_ratio: ArrayLike,
    setpoint_weight: float = 0.0,
    anti_windup: bool = False,
    period: float | None = None,
) -> Diagram:
    """Make n independent PI speed controllers, one for each motor (Eq. 5, Figure 5).

    All quantities are motor side, with motor speeds r v and r v_ref, and the set-point weight b:

        tau_fb = K_IS int(r v_ref - r v) dt + K_PS (b r v_ref - r v)

    The weight changes the zero alone: b = 1 is PI on the error, b = 0 is I-P (Figure 5), without a
    zero. The output is not limited. State: the integral of the speed error of each motor.

    Anti-windup is by back-calculation: (tau_limited - tau_cmd) / K_PS is added to the integrated
    error. While a motor saturates, its integral follows the available torque with the time constant
    K_PS / K_IS. The block then has two more inputs: `tau_cmd` before and `tau_limited` after
    saturation. Without anti-windup the integral grows on while the motor saturates.

    Args:
        gains: K_PS and K_IS, motor side.
        gear_ratio: r [-], shape (n,), > 0.
        setpoint_weight: b [-], >= 0.
        anti_windup: True to add anti-windup.
        period: sample period of a sampled controller [s], whose integral grows by period times the
            error at each sample. Continuous by default.

    .. pydrake_system::

        name: pi_speed_controller
        input_ports: [reference, measured]
        output_ports: [tau_fb]
    """
    b = finite_number(setpoint_weight, "setpoint_weight", minimum=0)
    n, kp = len(gains.kp), gains.kp
    r = np.diag(positives(gear_ratio, "gear_ratio", n))
    zero = np.zeros((n, n))
    integrator: System = Integrator(n)
    if period is not None:
        integrator = DiscreteTimeIntegrator(n, period)

    builder = DiagramBuilder()
    add, connect = builder.AddNamedSystem, builder.Connect
    v_ref = add("motor_speed_ref", MatrixGain(np.hstack([zero, r, zero])))
    minus_v = add("minus_motor_speed", MatrixGain(-np.hstack([zero, r])))
    error = to_integrate = add("speed_error", Adder(2, n))
    builder.ExportInput(v_ref.get_input_port(), "reference")
    builder.ExportInput(minus_v.get_input_port(), "measured")
    connect(v_ref.get_output_port(), error.get_input_port(0))
    connect(minus_v.get_output_port(), error.get_input_port(1))
    if anti_windup:
        command, saturated = add("command", Gain(-1 / kp)), add("saturated", Gain(1 / kp))
        to_integrate = add("anti_windup_sum", Adder(3, n))
        builder.ExportInput(command.get_input_port(), "tau_cmd")
        builder.ExportInput(saturated.get_input_port(), "tau_limited")
        connect(error.get_output_port(), to_integrate.get_input_port(0))
        connect(saturated.get_output_port(), to_integrate.get_input_port(1))
        connect(command.get_output_port(), to_integrate.get_input_port(2))
    integral = add("integral", integrator)
    k_is, k_ps = add("K_IS", Gain(gains.ki)), add("K_PS", Gain(kp))
    tau_fb = add("tau_fb", Adder(2, n))
    connect(to_integrate.get_output_port(), integral.get_input_port())
    connect(integral.get_output_port(), k_is.get_input_port())
    proportional_to = error if b == 1 else minus_v
    if b not in (0, 1):
        weight = add("setpoint_weight", Gain(b, n))
        proportional_to = add("weighted_error", Adder(2, n))
        connect(v_ref.get_output_port(), weight.get_input_port())
        connect(weight.get_output_port(), proportional_to.get_input_port(0))
        connect(minus_v.get_output_port(), proportional_to.get_input_port(1))
    connect(proportional_to.get_output_port(), k_ps.get_input_port())
    connect(k_is.get_output_port(), tau_fb.get_input_port(0))
    connect(k_ps.get_output_port(), tau_fb.get_input_port(1))
    builder.ExportOutput(tau_fb.get_output_port(), "tau_fb")
    return build(builder, "pi_speed_controller")


def set_integral(
    controller: System, context: Context, tau: ArrayLike, *, gains: SpeedGains
) -> None:
    """Set the integrals of PI controllers to torques `tau` [N m], motor side, shape (n,)."""
    set_state(controller, context, "integral", np.asarray(tau) / gains.ki)
