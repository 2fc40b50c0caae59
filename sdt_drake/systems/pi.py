"""PI speed controllers. State: the integral of the speed error of each motor."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.systems.framework import OutputPort
from pydrake.systems.primitives import (
    Adder,
    Gain,
    Integrator,
    LinearSystem,
    MatrixGain,
    Multiplexer,
)

from sdt_drake.control import STRUCTURES, SpeedGains
from sdt_drake.errors import checked_choice, checked_number, checked_vector
from sdt_drake.systems.block import Block

Array = NDArray[np.float64]


def pi_speed_controller_block(
    block: Block,
    *,
    gains: SpeedGains,
    gear_ratio: ArrayLike,
    structure: str = "p_in_feedback",
    anti_windup: bool = False,
    period: float | None = None,
    elements: bool = False,
) -> None:
    """n independent PI speed controllers (Eq. 5, Figure 5), one for each motor.

    With the motor speeds r v and r v_ref, all motor side:

        "pi":             tau_fb = K_IS int(r v_ref - r v) dt + K_PS (r v_ref - r v)
        "p_in_feedback":  tau_fb = K_IS int(r v_ref - r v) dt - K_PS r v

    Both have the same denominator; the second has no zero. It does not limit its output.

    With anti-windup, (tau - tau_cmd) / K_PS is added to what is integrated (back-calculation):
    while the motor saturates, the integral follows what the motor can give, with the time constant
    K_PS / K_IS. The block then has two more inputs, `tau_cmd` and `tau`, before and after the
    saturation. Without it the integral does not stop when the motor saturates.

    .. pydrake_system::

        name: pi_speed_controller
        input_ports:
        - reference
        - state
        output_ports:
        - tau_fb

    Args:
        gains: K_PS and K_IS, motor side.
        gear_ratio: r [-], shape (n,).
        structure: "pi" or "p_in_feedback".
        anti_windup: see above.
        period: of a sampled controller [s], whose state is sampled at the same instants: the
            integral grows by period times the error at each. Continuous by default.
        elements: build it from integrator, gains and sums one by one, as Figure 5 draws it. The
            same law, slower: for export.

    Raises:
        InputError: for another structure, or gains and ratios that do not fit each other.
    """
    n = len(gains.kp)
    checked_choice(structure, STRUCTURES, "structure of the PI controller")
    kp = np.diag(checked_vector(gains.kp, n, "kp", positive=True))
    ki = np.diag(checked_vector(gains.ki, n, "ki", positive=True))
    r = np.diag(checked_vector(gear_ratio, n, "gear_ratio", positive=True))
    if period is not None:
        checked_number(period, "period", minimum=0, exclusive=True)
    zero = np.zeros((n, n))
    # In [q_ref, v_ref, vd_ref, q, v]:
    error = np.hstack([zero, r, zero, zero, -r])
    proportional_to = error if structure == "pi" else np.hstack([zero, zero, zero, zero, -r])
    # In [tau_cmd, tau], which shorten the error:
    excess = np.hstack([-np.linalg.inv(kp), np.linalg.inv(kp)])
    if elements:
        _place_elements(block, gains, r, structure, excess if anti_windup else None, period)
        return

    signals = block.add(Multiplexer([3 * n, 2 * n]), "inputs")
    block.inputs["reference"] = signals.get_input_port(0)
    block.inputs["state"] = signals.get_input_port(1)
    if not anti_windup:
        # One linear system with the integral as its state: quicker in the derivative path than
        # integrator, gains and sums one by one, and Drake can linearise it.
        law = block.add(_integrating(error, ki, kp @ proportional_to, period))
        block.connect(signals.get_output_port(), law.get_input_port())
        block.outputs["tau_fb"] = law.get_output_port()
        return
    # The integral on its own: it must not pass tau on, which follows from tau_fb.
    nothing = np.zeros((n, 7 * n))
    integral = block.add(_integrating(np.hstack([error, excess]), ki, nothing, period), "integral")
    torques = block.add(Multiplexer([5 * n, n, n]), "with_torques")
    proportional = block.add(MatrixGain(kp @ proportional_to), "proportional")
    total = block.add(Adder(2, n))
    block.connect(signals.get_output_port(), torques.get_input_port(0))
    block.connect(signals.get_output_port(), proportional.get_input_port())
    block.connect(torques.get_output_port(), integral.get_input_port())
    block.connect(integral.get_output_port(), total.get_input_port(0))
    block.connect(proportional.get_output_port(), total.get_input_port(1))
    block.inputs["tau_cmd"] = torques.get_input_port(1)
    block.inputs["tau"] = torques.get_input_port(2)
    block.outputs["tau_fb"] = total.get_output_port()


def _integrating(B: Array, C: Array, D: Array, period: float | None) -> LinearSystem:
    """x' = B u, or x += period B u; y = C x + D u."""
    n = len(C)
    if period is None:
        return LinearSystem(A=np.zeros((n, n)), B=B, C=C, D=D)
    return LinearSystem(A=np.eye(n), B=period * B, C=C, D=D, time_period=period)


def _place_elements(
    block: Block,
    gains: SpeedGains,
    r: Array,
    structure: str,
    excess: Array | None,
    period: float | None,
) -> None:
    """The controller as Figure 5 draws it."""
    n = len(gains.kp)
    zero, one = np.zeros((n, n)), np.eye(n)
    motor_speed_ref = block.add(MatrixGain(np.hstack([zero, r, zero])), "motor_speed_ref")
    minus_motor_speed = block.add(MatrixGain(np.hstack([zero, -r])), "minus_motor_speed")
    block.inputs["reference"] = motor_speed_ref.get_input_port()
    block.inputs["state"] = minus_motor_speed.get_input_port()
    error = block.add(Adder(2, n), "speed_error")
    integral = block.add(
        Integrator(n) if period is None else _integrating(one, one, zero, period), "integral"
    )
    k_is = block.add(Gain(gains.ki), "K_IS")
    k_ps = block.add(Gain(gains.kp), "K_PS")
    total = block.add(Adder(2, n), "sum")
    proportional_to = error if structure == "pi" else minus_motor_speed
    block.connect(motor_speed_ref.get_output_port(), error.get_input_port(0))
    block.connect(minus_motor_speed.get_output_port(), error.get_input_port(1))
    to_integrate: OutputPort = error.get_output_port()
    if excess is not None:
        torques = block.add(Multiplexer([n, n]), "tau_cmd_and_tau")
        back_calculation = block.add(MatrixGain(excess), "back_calculation")
        shortened = block.add(Adder(2, n), "shortened_error")
        block.connect(torques.get_output_port(), back_calculation.get_input_port())
        block.connect(to_integrate, shortened.get_input_port(0))
        block.connect(back_calculation.get_output_port(), shortened.get_input_port(1))
        to_integrate = shortened.get_output_port()
        block.inputs["tau_cmd"] = torques.get_input_port(0)
        block.inputs["tau"] = torques.get_input_port(1)
    block.connect(to_integrate, integral.get_input_port())
    block.connect(integral.get_output_port(), k_is.get_input_port())
    block.connect(proportional_to.get_output_port(), k_ps.get_input_port())
    block.connect(k_is.get_output_port(), total.get_input_port(0))
    block.connect(k_ps.get_output_port(), total.get_input_port(1))
    block.outputs["tau_fb"] = total.get_output_port()
