"""PI speed controllers with gains that are scheduled with the inertia."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from pydrake.systems.framework import Context, DiagramBuilder, OutputPort, System

from sdt_drake.io.arrays import Array
from sdt_drake.motion import Motion
from sdt_drake.run.controllers.pi import WeightedPi
from sdt_drake.run.design import Design
from sdt_drake.run.options import ChosenFeedforward
from sdt_drake.systems import gain_schedule, signal_table
from sdt_drake.systems.reference import start_table
from sdt_drake.systems.wiring import nested


@dataclass(frozen=True)
class PiScheduled(WeightedPi, ChosenFeedforward):
    """PI speed controllers whose gains K_PS and K_IS are proportional to I_eff(q_ref).

    .. pydrake_system::

        name: pi_scheduled
        input_ports: [reference, measured]
        output_ports: [tau_fb]
    """

    kind: Literal["pi_scheduled"] = "pi_scheduled"

    needs = ("inertia along the motion",)

    def share(self, design: Design, sample: int) -> Array:
        return design.tuning.inertia_share[sample]

    def ahead(
        self, builder: DiagramBuilder, design: Design, sample: int | None
    ) -> Mapping[str, OutputPort]:
        if sample is not None:  # Drake cannot linearise the schedule of a sampled controller
            return {}
        share = {"inertia_share": design.tuning.inertia_share}
        delay = design.drive.reference_delay
        table = signal_table(motion=design.reference.held, signals=share, delay=delay)
        builder.AddNamedSystem("inertia_table", table)
        schedule = gain_schedule(n=design.device.simulated.n)
        builder.AddNamedSystem("gain_schedule", schedule)
        builder.Connect(table.get_output_port(), schedule.GetInputPort("inertia_share"))
        builder.ExportInput(schedule.GetInputPort("reference"), "reference")
        builder.ExportInput(schedule.GetInputPort("measured"), "measured")
        return {x: schedule.GetOutputPort(f"weighted_{x}") for x in ("reference", "measured")}

    def start(
        self, system: System, context: Context, design: Design, tau: Array, start: Motion | None
    ) -> None:
        super().start(system, context, design, tau, start)
        start_table(*nested(system, context, "inertia_table"))

    def in_words(self, design: Design) -> str:
        return f"{super().in_words(design)}, their gains those at the largest inertia"
