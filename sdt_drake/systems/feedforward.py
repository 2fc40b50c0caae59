"""Torque feedforward: its sum with the feedback, and the torque itself, on line. No state."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import Adder

from sdt_drake.errors import checked_count
from sdt_drake.robot import Robot
from sdt_drake.systems.load_torque import ReferenceTorque

Array = NDArray[np.float64]


class CtcFeedforward(Diagram):
    """Computed torque compensation of the load (Section 3.4, Figure 6).

        tau_cmd = tau_fb + tau_ff        [N m], motor side

    The paper's tau_ff is the load torque tau_LD: it leaves the joint's own acceleration
    (d_kk vd_ref) to the feedback. What tau_ff holds is not decided here.

    .. pydrake_system::

        name: CtcFeedforward
        input_ports:
        - tau_fb
        - tau_ff
        output_ports:
        - tau_cmd
    """

    def __init__(self, *, n: int) -> None:
        """For n motors.

        Raises:
            InputError: for n that is not > 0.
        """
        super().__init__()
        checked_count(n, "n")
        builder = DiagramBuilder()
        total = builder.AddNamedSystem("tau_cmd", Adder(2, n))
        builder.ExportInput(total.get_input_port(0), "tau_fb")
        builder.ExportInput(total.get_input_port(1), "tau_ff")
        builder.ExportOutput(total.get_output_port(), "tau_cmd")
        builder.BuildInto(self)


class FeedforwardTorque(ReferenceTorque):
    """Torque feedforward of the reference from the controller's model, motor side [N m].

    What it consists of is a function of the model's torque groups, see
    `sdt_drake.control.feedforward_torque`. It does not see the state.

    .. pydrake_system::

        name: FeedforwardTorque
        input_ports:
        - reference
        output_ports:
        - tau_ff
    """

    symbol = "inverse\ndynamics"

    def __init__(
        self, *, model: Robot, law: Callable[[Sequence[Array], Array, Array], Array]
    ) -> None:
        """Of `model`; law(groups, v_ref, vd_ref) gives tau_ff, shape (n,)."""
        super().__init__(robot=model, outputs=("tau_ff",), law=lambda *sample: [law(*sample)])
