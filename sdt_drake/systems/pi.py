"""PI speed controllers. State: the integral of the speed error of each motor."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.systems.primitives import (
    Adder,
    Gain,
    Integrator,
    LinearSystem,
    MatrixGain,
    Multiplexer,
)

from sdt_drake.control import STRUCTURES, SpeedGains
from sdt_drake.errors import checked_choice, checked_vector
from sdt_drake.systems.block import Block

Array = NDArray[np.float64]


def pi_speed_controller_block(
    block: Block,
    *,
    gains: SpeedGains,
    gear_ratio: ArrayLike,
    structure: str = "p_in_feedback",
    elements: bool = False,
) -> None:
    """n independent PI speed controllers (Eq. 5, Figure 5), one for each motor.

    With the motor speeds r v and r v_ref, all motor side:

        "pi":             tau_fb = K_IS int(r v_ref - r v) dt + K_PS (r v_ref - r v)
        "p_in_feedback":  tau_fb = K_IS int(r v_ref - r v) dt - K_PS r v

    Both have the same denominator; the second has no zero. It does not limit its output, nor stop
    its integral when the motor saturates.

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
    zero = np.zeros((n, n))
    kp_ref = kp if structure == "pi" else zero

    if elements:
        _place_elements(block, gains, r, structure)
        return
    # One linear system in [q_ref, v_ref, vd_ref, q, v] with the integral as its state: quicker in
    # the derivative path than integrator, gains and sums one by one, and Drake can linearise it.
    signals = block.add(Multiplexer([3 * n, 2 * n]), "inputs")
    law = block.add(
        LinearSystem(
            A=zero,
            B=np.hstack([zero, r, zero, zero, -r]),
            C=ki,
            D=np.hstack([zero, kp_ref @ r, zero, zero, -kp @ r]),
        )
    )
    block.connect(signals.get_output_port(), law.get_input_port())
    block.inputs["reference"] = signals.get_input_port(0)
    block.inputs["state"] = signals.get_input_port(1)
    block.outputs["tau_fb"] = law.get_output_port()


def _place_elements(block: Block, gains: SpeedGains, r: Array, structure: str) -> None:
    """The controller as Figure 5 draws it."""
    n = len(gains.kp)
    zero = np.zeros((n, n))
    motor_speed_ref = block.add(MatrixGain(np.hstack([zero, r, zero])), "motor_speed_ref")
    minus_motor_speed = block.add(MatrixGain(np.hstack([zero, -r])), "minus_motor_speed")
    error = block.add(Adder(2, n), "speed_error")
    integral = block.add(Integrator(n), "integral")
    k_is = block.add(Gain(gains.ki), "K_IS")
    k_ps = block.add(Gain(gains.kp), "K_PS")
    total = block.add(Adder(2, n), "sum")
    proportional_to = error if structure == "pi" else minus_motor_speed
    block.connect(motor_speed_ref.get_output_port(), error.get_input_port(0))
    block.connect(minus_motor_speed.get_output_port(), error.get_input_port(1))
    block.connect(error.get_output_port(), integral.get_input_port())
    block.connect(integral.get_output_port(), k_is.get_input_port())
    block.connect(proportional_to.get_output_port(), k_ps.get_input_port())
    block.connect(k_is.get_output_port(), total.get_input_port(0))
    block.connect(k_ps.get_output_port(), total.get_input_port(1))
    block.inputs["reference"] = motor_speed_ref.get_input_port()
    block.inputs["state"] = minus_motor_speed.get_input_port()
    block.outputs["tau_fb"] = total.get_output_port()
