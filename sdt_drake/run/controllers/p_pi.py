"""The cascade of position and speed controllers."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from pydrake.systems.framework import DiagramBuilder, OutputPort

from sdt_drake.io.fields import EachJoint, Positive, field
from sdt_drake.run.controllers.pi import PiLoops
from sdt_drake.run.design import Design
from sdt_drake.run.options import ChosenFeedforward, ControllerOptions
from sdt_drake.systems import position_loop


@dataclass(frozen=True)
class PositionGain(ControllerOptions):
    """Options of controllers with a proportional position controller for each joint."""

    position_gain: EachJoint[Positive] | None = field(None, unit="1/s")
    """Position gain K_V; omega_n / 4 by default."""


@dataclass(frozen=True)
class PPi(PiLoops, ChosenFeedforward, PositionGain):
    """The industrial cascade: PI speed controllers that track v_ref + K_V (q_ref - q).

    .. pydrake_system::

        name: p_pi
        input_ports: [reference, sampled_state, measured]
        output_ports: [tau_fb]
    """

    kind: Literal["p_pi"] = "p_pi"

    def ahead(
        self, builder: DiagramBuilder, design: Design, sample: int | None
    ) -> Mapping[str, OutputPort]:
        loop = position_loop(position_gain=design.tuning.position_gain)
        builder.AddNamedSystem("position_loop", loop)
        builder.ExportInput(loop.GetInputPort("reference"), "reference")
        builder.ExportInput(loop.GetInputPort("sampled_state"), "sampled_state")
        return {"reference": loop.get_output_port()}

    def in_words(self, design: Design) -> str:
        k_v = self.position_gain
        gain = "K_V = omega_n / 4" if k_v is None else f"K_V = {k_v} 1/s at every omega_n"
        return f"{super().in_words(design)} in position loops, {gain}"
