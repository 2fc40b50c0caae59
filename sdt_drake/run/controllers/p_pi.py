"""The cascade of position and speed controllers."""

from __future__ import annotations

from pydrake.systems.framework import DiagramBuilder, OutputPort

from sdt_drake.run.controllers.pi import Pi
from sdt_drake.run.design import Design
from sdt_drake.systems import position_loop


class PPi(Pi, kind="p_pi"):
    """The industrial cascade: PI speed controllers that track v_ref + K_V (q_ref - q).

    .. pydrake_system::

        name: p_pi
        input_ports: [reference, sampled_state, measured]
        output_ports: [tau_fb]
    """

    @classmethod
    def in_words(cls, design: Design) -> str:
        k_v = design.scenario.controller.position_gain
        gain = "K_V = omega_n / 4" if k_v is None else f"K_V = {k_v} 1/s at every omega_n"
        return f"{super().in_words(design)} in position loops, {gain}"

    @classmethod
    def _add_ahead(
        cls, builder: DiagramBuilder, design: Design, at: int | None
    ) -> dict[str, OutputPort]:
        loop = position_loop(position_gain=design.position_gain)
        builder.AddNamedSystem("position_loop", loop)
        builder.ExportInput(loop.GetInputPort("reference"), "reference")
        builder.ExportInput(loop.GetInputPort("sampled_state"), "sampled_state")
        return {"reference": loop.get_output_port()}
