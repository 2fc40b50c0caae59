from __future__ import annotations

from pydrake.symbolic import Expression

from sdt_drake.io.errors import checked_count
from sdt_drake.systems.symbolic import SymbolicLaw, Symbols
from sdt_drake.systems.wiring import Wired


class GainSchedule(Wired):
    """Speeds weighted with the inertia, for a PI speed controller that is tuned for the largest.

        v_ref, v  ->  s v_ref, s v        with s = I_eff / I_eff,max [-]

    Behind it the controller has the gains s K_PS and s K_IS, and so the same natural frequency and
    damping at every inertia. The weight is inside the integral, so that what has been integrated
    does not change with s. What K_PS feeds back does: with P in the feedback path a motor at
    constant speed feels a change of s like a load. Positions and vd_ref pass unchanged.

    Args:
        n: number of joints.

    .. pydrake_system::

        name: GainSchedule
        input_ports: [reference, inertia_share, state]
        output_ports: [weighted_reference, weighted_state]
    """

    symbol = "speeds x\nI_eff / I_eff,max"

    def __init__(self, *, n: int) -> None:
        super().__init__()
        checked_count(n, "n")

        def law(signal: Symbols, share: Symbols) -> list[Expression]:
            return [*signal[:n], *(share * signal[n : 2 * n]), *signal[2 * n :]]

        for name, size in (("reference", 3 * n), ("state", 2 * n)):
            inputs, output = {name: size, "inertia_share": n}, f"weighted_{name}"
            self.add(output, SymbolicLaw(inputs=inputs, output=output, law=law))
        self.build("weighted_reference", "weighted_state")
