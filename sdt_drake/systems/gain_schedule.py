"""Gains that follow the inertia. No state."""

from __future__ import annotations

import numpy as np
from pydrake.systems.primitives import Demultiplexer

from sdt_drake.errors import checked_count
from sdt_drake.systems.block import Block
from sdt_drake.systems.symbolic import add_static_law


def gain_schedule_block(block: Block, *, n: int) -> None:
    """Speeds weighted with the inertia, for a PI speed controller that is tuned for the largest.

        v_ref, v  ->  s v_ref, s v        with s = I_eff / I_eff,max [-]

    Behind it the controller has the gains s K_PS and s K_IS, and so the same natural frequency and
    damping at every inertia. The weight is inside the integral, so that what has been integrated
    does not change with s. What K_PS feeds back does: with P in the feedback path a motor at
    constant speed feels a change of s like a load. Positions and vd_ref pass unchanged.

    .. pydrake_system::

        name: gain_schedule
        input_ports:
        - reference
        - state
        - inertia_share
        output_ports:
        - reference
        - state

    Args:
        n: number of joints.
    """
    checked_count(n, "n")

    def law(_time, reference, state, share):
        q_ref, v_ref, vd_ref = np.split(reference, 3)
        q, v = np.split(state, 2)
        return [*q_ref, *(share * v_ref), *vd_ref, *q, *(share * v)]

    add_static_law(
        block,
        inputs={"reference": 3 * n, "state": 2 * n, "inertia_share": n},
        output="weighted",
        law=law,
    )
    split = block.add(Demultiplexer([3 * n, 2 * n]), "outputs")
    block.connect(block.outputs.pop("weighted"), split.get_input_port())
    block.outputs["reference"] = split.get_output_port(0)
    block.outputs["state"] = split.get_output_port(1)
