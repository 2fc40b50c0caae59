"""Encoders. State: the last two samples."""

from __future__ import annotations

import numpy as np
import pydrake.symbolic as sym
from numpy.typing import ArrayLike
from pydrake.systems.primitives import MatrixGain, Multiplexer, ZeroOrderHold

from sdt_drake.errors import checked_count, checked_number, checked_vector
from sdt_drake.systems.block import Block
from sdt_drake.systems.symbolic import add_static_law


def encoder_block(
    block: Block,
    *,
    n: int,
    period: float,
    resolution: ArrayLike | None = None,
    gear_ratio: ArrayLike | None = None,
) -> None:
    """Samples the state every `period` [s], first at time 0, and holds it: [q, v], joint side.

    With a resolution, the positions are those of an incremental encoder on the motor's shaft, and
    the speeds their differences, which lag by half a period:

        q_k = floor(q N r / (2 pi)) 2 pi / (N r),    v_k = (q_k - q_(k-1)) / period

    It does not delay: a sample is in force from its own instant on.

    .. pydrake_system::

        name: encoder
        input_ports:
        - state
        output_ports:
        - state

    Args:
        n: number of joints.
        period: [s], > 0.
        resolution: N, increments per revolution of the motor [-], shape (n,); ideal by default.
        gear_ratio: r [-], shape (n,); needed with a resolution.

    Raises:
        InputError: for values that are not finite and > 0.
    """
    checked_count(n, "n")
    checked_number(period, "period", minimum=0, exclusive=True)
    if resolution is None:
        hold = block.add(ZeroOrderHold(period, 2 * n))
        block.inputs["state"] = hold.get_input_port()
        block.outputs["state"] = hold.get_output_port()
        return

    resolution = checked_vector(resolution, n, "resolution", positive=True)
    r = checked_vector(gear_ratio, n, "gear_ratio", positive=True)
    increment = 2 * np.pi / (resolution * r)

    def count(_time, state):
        return [sym.floor(state[k] / increment[k]) * increment[k] for k in range(n)]

    add_static_law(block, inputs={"state": 2 * n}, output="position", law=count)
    now = block.add(ZeroOrderHold(period, n), "now")
    # Updated at the same instants as `now`, it sees what `now` held until then.
    before = block.add(ZeroOrderHold(period, n), "before")
    samples = block.add(Multiplexer([n, n]), "samples")
    one, zero = np.eye(n), np.zeros((n, n))
    difference = np.block([[one, zero], [one / period, -one / period]])
    measured = block.add(MatrixGain(difference), "difference")
    block.connect(block.outputs.pop("position"), now.get_input_port())
    block.connect(now.get_output_port(), before.get_input_port())
    block.connect(now.get_output_port(), samples.get_input_port(0))
    block.connect(before.get_output_port(), samples.get_input_port(1))
    block.connect(samples.get_output_port(), measured.get_input_port())
    block.outputs["state"] = measured.get_output_port()
