"""PI speed controllers with gains that are scheduled with the inertia."""

from __future__ import annotations

from pydrake.systems.framework import DiagramBuilder

from sdt_drake.io.arrays import Array, Index
from sdt_drake.run.controllers.pi import Pi
from sdt_drake.run.design import Design
from sdt_drake.systems import GainSchedule


class PiScheduled(Pi, kind="pi_scheduled"):
    """PI speed controllers whose gains K_PS and K_IS are proportional to I_eff(q_ref).

    .. pydrake_system::

        name: PiScheduled
        input_ports: [reference, state]
        output_ports: [tau_cmd]
    """

    @classmethod
    def in_words(cls, design: Design) -> str:
        return f"{super().in_words(design)}, their gains those at the largest inertia"

    def _add_ahead(self, builder: DiagramBuilder, at: int | None) -> dict[str, str]:
        if at is not None:  # Drake cannot linearise the schedule of a sampled controller
            return {}
        share = self._design.inertia_share
        self._add_table(builder, "inertia_table", self._design, inertia_share=share)
        builder.AddNamedSystem("gain_schedule", GainSchedule(n=self._design.robot.n))
        return {"reference": "weighted_reference", "state": "weighted_state"}

    def _share(self, held: Index | int) -> Array:
        return self._design.inertia_share[held]
