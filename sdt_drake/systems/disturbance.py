"""Disturbance injection: the error of the load torque model. No state: functions of time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pydrake.symbolic as sym
from pydrake.systems.primitives import Adder

from sdt_drake.errors import checked_count, checked_number
from sdt_drake.systems.block import Block
from sdt_drake.systems.symbolic import add_static_law


def disturbance_block(block: Block, *, n: int, amplitude: float, omega_d: float) -> None:
    """The part of the load that the model does not know (Section 3.4, Figure 6).

        disturbance = A sin(omega_D t) load_torque        [N m], motor side

    so that the true load is tau_LD (1 + A sin(omega_D t)). It does not add it to anything.

    .. pydrake_system::

        name: disturbance
        input_ports:
        - load_torque
        output_ports:
        - disturbance

    Args:
        n: number of joints.
        amplitude: A, share of the load torque [-], >= 0.
        omega_d: omega_D [rad/s], >= 0.

    Raises:
        InputError: for values that are not finite and >= 0.
    """
    checked_count(n, "n")
    amplitude = checked_number(amplitude, "disturbance amplitude", minimum=0)
    omega_d = checked_number(omega_d, "disturbance omega_d", minimum=0)

    def law(time, load_torque):
        return np.array([amplitude * sym.sin(omega_d * time) * tau for tau in load_torque])

    add_static_law(block, inputs={"load_torque": n}, output="disturbance", law=law)


def true_load_block(
    block: Block, *, n: int, parts: Sequence[str] = ("modelled_load", "disturbance")
) -> None:
    """The load that the motors really have: the sum of its parts.

        load_torque = modelled_load + disturbance        [N m], motor side

    .. pydrake_system::

        name: true_load
        input_ports:
        - modelled_load
        - disturbance
        output_ports:
        - load_torque

    Args:
        n: number of joints.
        parts: names of the inputs.
    """
    total = block.add(Adder(len(parts), checked_count(n, "n")))
    for i, part in enumerate(parts):
        block.inputs[part] = total.get_input_port(i)
    block.outputs["load_torque"] = total.get_output_port()
