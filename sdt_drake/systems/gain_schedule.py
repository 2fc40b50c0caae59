from __future__ import annotations

from pydrake.symbolic import Expression
from pydrake.systems.framework import Diagram, DiagramBuilder

from sdt_drake.io.errors import checked_count
from sdt_drake.systems.symbolic import SymbolicLaw, Symbols
from sdt_drake.systems.wiring import connect_by_name


class GainSchedule(Diagram):
    """A gain schedule: speeds weighted with the inertia, for a PI tuned at the largest inertia.

        v_ref, v  ->  s v_ref, s v        with s = I_eff / I_eff,max [-]

    The controller behind this block has the gains s K_PS and s K_IS: the same natural frequency and
    damping at every inertia. The weight is inside the integral, so a change of s does not change
    the integral. It changes the proportional feedback: with "p_in_feedback" it acts like a load at
    constant speed. Positions and vd_ref pass unchanged.

    Args:
        n: number of joints.

    .. pydrake_system::

        name: GainSchedule
        input_ports: [reference, inertia_share, state]
        output_ports: [weighted_reference, weighted_state]
    """

    def __init__(self, *, n: int) -> None:
        super().__init__()
        checked_count(n, "n")

        def law(signal: Symbols, share: Symbols) -> list[Expression]:
            return [*signal[:n], *(share * signal[n : 2 * n]), *signal[2 * n :]]

        builder = DiagramBuilder()
        for name, size in (("reference", 3 * n), ("state", 2 * n)):
            inputs, output = {name: size, "inertia_share": n}, f"weighted_{name}"
            weighted = SymbolicLaw(inputs=inputs, output=output, law=law)
            builder.AddNamedSystem(output, weighted)
            builder.ExportOutput(weighted.get_output_port(), output)
        connect_by_name(builder)
        builder.BuildInto(self)
