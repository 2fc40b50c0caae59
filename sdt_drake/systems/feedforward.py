from __future__ import annotations

from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import Adder

from sdt_drake.io.errors import checked_count


class CtcFeedforward(Diagram):
    """Computed torque compensation: the sum of feedback and feedforward (Section 3.4, Figure 6).

        tau_cmd = tau_fb + tau_ff        [N m], motor side

    The paper's tau_ff is the load torque tau_LD, which leaves the joint's own acceleration
    (d_kk vd_ref) to the feedback. This block accepts any tau_ff.

    Args:
        n: number of motors.

    .. pydrake_system::

        name: CtcFeedforward
        input_ports: [tau_fb, tau_ff]
        output_ports: [tau_cmd]
    """

    def __init__(self, *, n: int) -> None:
        super().__init__()
        checked_count(n, "n")
        builder = DiagramBuilder()
        total = builder.AddNamedSystem("tau_cmd", Adder(2, n))
        builder.ExportInput(total.get_input_port(0), "tau_fb")
        builder.ExportInput(total.get_input_port(1), "tau_ff")
        builder.ExportOutput(total.get_output_port(), "tau_cmd")
        builder.BuildInto(self)
