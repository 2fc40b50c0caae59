"""Gains that follow the inertia. No state."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import Diagram, DiagramBuilder

from sdt_drake.systems.symbolic import SymbolicLaw


class GainSchedule(Diagram):
    """Speeds weighted with the inertia, for a PI speed controller that is tuned for the largest.

        v_ref, v  ->  s v_ref, s v        with s = I_eff / I_eff,max [-]

    Behind it the controller has the gains s K_PS and s K_IS, and so the same natural frequency and
    damping at every inertia. The weight is inside the integral, so that what has been integrated
    does not change with s. What K_PS feeds back does: with P in the feedback path a motor at
    constant speed feels a change of s like a load. Positions and vd_ref pass unchanged.

    .. pydrake_system::

        name: GainSchedule
        input_ports:
        - reference
        - inertia_share
        - state
        output_ports:
        - weighted_reference
        - weighted_state
    """

    symbol = "speeds x\nI_eff / I_eff,max"

    def __init__(self, *, n: int) -> None:
        """For n joints."""
        super().__init__()

        def reference_law(_x, share, reference):
            q_ref, v_ref, vd_ref = np.split(reference, 3)
            return [*q_ref, *(share * v_ref), *vd_ref]

        def state_law(_x, share, state):
            return [*state[:n], *(share * state[n:])]

        builder = DiagramBuilder()
        for name, size, law in (("reference", 3 * n, reference_law), ("state", 2 * n, state_law)):
            inputs, output = {"inertia_share": n, name: size}, f"weighted_{name}"
            weighted = SymbolicLaw(inputs=inputs, output=output, law=law)
            builder.AddNamedSystem(output, weighted)
            builder.ExportInput(weighted.GetInputPort(name), name)
            builder.ExportOutput(weighted.get_output_port(), output)
            if name == "reference":
                builder.ExportInput(weighted.GetInputPort("inertia_share"), "inertia_share")
            else:
                builder.ConnectInput("inertia_share", weighted.GetInputPort("inertia_share"))
        builder.BuildInto(self)
