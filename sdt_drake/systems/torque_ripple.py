from collections.abc import Sequence

import numpy as np
import pydrake.symbolic as sym
from numpy.typing import ArrayLike
from pydrake.systems.framework import Diagram

from sdt_drake.io.arguments import positives
from sdt_drake.io.arrays import Array
from sdt_drake.systems.symbolic import Symbols, symbolic_law


def torque_ripple(
    *,
    harmonics: Sequence[float],
    amplitudes: Sequence[float],
    gear_ratio: ArrayLike,
    motor_torque_limit: ArrayLike,
) -> Diagram:
    """Make the ripple of motors, harmonics of their angle r q.

        ripple = L sum_h a_h sin(h r q)      [N m], motor side

    Args:
        harmonics: h, periods per revolution of the motor [-].
        amplitudes: a_h, share of the largest torque [-], for each harmonic.
        gear_ratio: r [-], shape (n,), > 0.
        motor_torque_limit: L, motor side [N m], shape (n,), > 0.

    .. pydrake_system::

        name: torque_ripple
        input_ports: [motor_state]
        output_ports: [ripple]
    """
    limit = positives(motor_torque_limit, "motor_torque_limit")
    n = len(limit)
    r = positives(gear_ratio, "gear_ratio", n)

    def law(motor_state: Symbols) -> list[sym.Expression]:
        return [
            limit[k] * sum(
                a * sym.sin(h * r[k] * motor_state[k])
                for h, a in zip(harmonics, amplitudes, strict=True)
            )
            for k in range(n)
        ]  # fmt: skip

    inputs = {"motor_state": 2 * n}
    return symbolic_law(inputs=inputs, output="ripple", law=law, name="torque_ripple")


def ripple_at(harmonics: Sequence[float], amplitudes: Sequence[float], angle: Array) -> Array:
    """Return the ripple at angles of motors [rad], over their largest torque [-], shape (n,)."""
    waves = np.sin(np.multiply.outer(angle, np.array(harmonics)))
    return np.asarray(waves @ np.array(amplitudes))
