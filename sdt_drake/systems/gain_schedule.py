from pydrake.symbolic import Expression
from pydrake.systems.framework import Diagram, DiagramBuilder

from sdt_drake.io.arguments import whole_number
from sdt_drake.systems.symbolic import Symbols, symbolic_law
from sdt_drake.systems.wiring import build


def gain_schedule(*, n: int) -> Diagram:
    """Make a gain schedule: speeds weighted with the inertia, for a PI tuned at the largest one.

        v_ref, v  ->  s v_ref, s v        with s = I_eff / I_eff,max [-]

    The controller behind this block has the gains s K_PS and s K_IS: the same natural frequency and
    damping at every inertia. The weight is inside the integral, so a change of s does not change
    the integral. It changes the proportional feedback: with an I-P controller it acts like a load
    at constant speed. Positions and vd_ref pass unchanged.

    Args:
        n: number of joints.

    .. pydrake_system::

        name: gain_schedule
        input_ports: [reference, inertia_share, measured]
        output_ports: [weighted_reference, weighted_measured]
    """
    whole_number(n, "n")

    def law(signal: Symbols, share: Symbols) -> list[Expression]:
        return [*signal[:n], *(share * signal[n : 2 * n]), *signal[2 * n :]]

    def weighted(name: str, size: int) -> Diagram:
        inputs = {name: size, "inertia_share": n}
        return symbolic_law(inputs=inputs, output=f"weighted_{name}", law=law)

    builder = DiagramBuilder()
    reference = builder.AddNamedSystem("weighted_reference", weighted("reference", 3 * n))
    measured = builder.AddNamedSystem("weighted_measured", weighted("measured", 2 * n))
    builder.ExportInput(reference.GetInputPort("reference"), "reference")
    builder.ExportInput(reference.GetInputPort("inertia_share"), "inertia_share")
    builder.ConnectInput("inertia_share", measured.GetInputPort("inertia_share"))
    builder.ExportInput(measured.GetInputPort("measured"), "measured")
    builder.ExportOutput(reference.get_output_port(), "weighted_reference")
    builder.ExportOutput(measured.get_output_port(), "weighted_measured")
    return build(builder, "gain_schedule")
