"""CTC feedforward: adds the load torque to the feedback. No state."""

from __future__ import annotations

from pydrake.systems.primitives import Adder

from sdt_drake.errors import checked_count
from sdt_drake.systems.block import Block


def ctc_feedforward_block(block: Block, *, n: int) -> None:
    """Computed torque compensation of the load (Section 3.4, Figure 6).

        tau_cmd = tau_fb + tau_ff        [N m], motor side

    The paper's tau_ff is the load torque tau_LD: it leaves the joint's own acceleration
    (d_kk vd_ref) to the feedback. What tau_ff holds is not decided here.

    .. pydrake_system::

        name: ctc_feedforward
        input_ports:
        - tau_fb
        - tau_ff
        output_ports:
        - tau_cmd
    """
    total = block.add(Adder(2, checked_count(n, "n")))
    block.inputs["tau_fb"] = total.get_input_port(0)
    block.inputs["tau_ff"] = total.get_input_port(1)
    block.outputs["tau_cmd"] = total.get_output_port()
