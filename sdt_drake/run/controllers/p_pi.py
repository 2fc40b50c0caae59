"""The cascade of position and speed controllers."""

from __future__ import annotations

from pydrake.systems.framework import DiagramBuilder

from sdt_drake.io.arrays import Array, Index
from sdt_drake.run.controllers.pi import Pi
from sdt_drake.run.design import Design
from sdt_drake.systems import PositionLoop


class PPi(Pi, kind="p_pi"):
    """The industrial cascade: PI speed controllers that track v_ref + K_V (q_ref - q).

    .. pydrake_system::

        name: PPi
        input_ports: [reference, sampled_state, state]
        output_ports: [tau_cmd]
    """

    @classmethod
    def in_words(cls, design: Design) -> str:
        k_v = design.scenario.controller.position_gain
        gain = "K_V = omega_n / 4" if k_v is None else f"K_V = {k_v} 1/s at every omega_n"
        return f"{super().in_words(design)} in position loops, {gain}"

    def _add_ahead(self, builder: DiagramBuilder, at: int | None) -> dict[str, str]:
        loop = PositionLoop(position_gain=self._design.position_gain)
        builder.AddNamedSystem("position_loop", loop)
        return {"reference": "speed_reference"}

    def _speed_reference(self, held: Index, q: Array) -> Array:
        reference = self._design.reference
        return reference.v[held] + self._design.position_gain * (reference.q[held] - q)
