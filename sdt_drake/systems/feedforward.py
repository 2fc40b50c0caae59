from __future__ import annotations

from pydrake.systems.primitives import Adder

from sdt_drake.io.errors import checked_count
from sdt_drake.systems.wiring import Wired


class CtcFeedforward(Wired):
    """Computed torque compensation of the load (Section 3.4, Figure 6).

        tau_cmd = tau_fb + tau_ff        [N m], motor side

    The paper's tau_ff is the load torque tau_LD: it leaves the joint's own acceleration
    (d_kk vd_ref) to the feedback. What tau_ff holds is not decided here.

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
        self.add("tau_cmd", Adder(2, n), "tau_fb", "tau_ff", "tau_cmd")
        self.build("tau_cmd")
