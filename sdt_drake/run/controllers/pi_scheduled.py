"""PI speed controllers with gains that are scheduled with the inertia."""

from __future__ import annotations

from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort

from sdt_drake.io.arrays import Array
from sdt_drake.motion import Motion
from sdt_drake.run.controllers.pi import Pi
from sdt_drake.run.design import Design
from sdt_drake.run.feedforward import table_of
from sdt_drake.systems import gain_schedule
from sdt_drake.systems.reference import start_table


class PiScheduled(Pi, kind="pi_scheduled"):
    """PI speed controllers whose gains K_PS and K_IS are proportional to I_eff(q_ref).

    .. pydrake_system::

        name: pi_scheduled
        input_ports: [reference, measured]
        output_ports: [tau_fb]
    """

    @classmethod
    def in_words(cls, design: Design) -> str:
        return f"{super().in_words(design)}, their gains those at the largest inertia"

    @classmethod
    def start(
        cls, system: Diagram, context: Context, design: Design, tau_fb: Array, start: Motion | None
    ) -> None:
        super().start(system, context, design, tau_fb, start)
        table = system.GetSubsystemByName("inertia_table")
        start_table(table, system.GetMutableSubsystemContext(table, context))

    @classmethod
    def _add_ahead(
        cls, builder: DiagramBuilder, design: Design, at: int | None
    ) -> dict[str, OutputPort]:
        if at is not None:  # Drake cannot linearise the schedule of a sampled controller
            return {}
        table = table_of(design, inertia_share=design.inertia_share)
        builder.AddNamedSystem("inertia_table", table)
        schedule = builder.AddNamedSystem("gain_schedule", gain_schedule(n=design.robot.n))
        builder.Connect(table.get_output_port(), schedule.GetInputPort("inertia_share"))
        builder.ExportInput(schedule.GetInputPort("reference"), "reference")
        builder.ExportInput(schedule.GetInputPort("measured"), "measured")
        return {x: schedule.GetOutputPort(f"weighted_{x}") for x in ("reference", "measured")}

    @classmethod
    def _share(cls, design: Design, sample: int) -> Array:
        return design.inertia_share[sample]
