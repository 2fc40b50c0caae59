"""PI speed controllers. State: the integral of the speed error of each motor."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.primitives import LinearSystem, Multiplexer

from sdt_drake.control import STRUCTURES, SpeedGains
from sdt_drake.errors import checked_choice, checked_vector
from sdt_drake.systems.block import Block


def pi_speed_controller_block(
    block: Block, *, gains: SpeedGains, gear_ratio: ArrayLike, structure: str = "p_in_feedback"
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
