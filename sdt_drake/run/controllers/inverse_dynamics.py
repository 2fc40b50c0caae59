"""The computed torque controller."""

from dataclasses import dataclass
from typing import Literal

from pydrake.systems.framework import Diagram, DiagramBuilder

from sdt_drake.run.controllers.base import Feedback
from sdt_drake.run.design import Design
from sdt_drake.run.options import LINKS, MOTORS
from sdt_drake.systems import inverse_dynamics_controller
from sdt_drake.systems.gains import damping_ratio
from sdt_drake.systems.wiring import build


@dataclass(frozen=True)
class InverseDynamics(Feedback):
    """Computed torque from the state of all joints, sampled at the interpolation period.

    The law is that of `sdt_drake.systems.inverse_dynamics_controller` with the poles of the speed
    loops. It has no integral, so with a wrong model a run does not start in equilibrium.

    .. pydrake_system::

        name: inverse_dynamics
        input_ports: [reference, sampled_state]
        output_ports: [tau_fb]
    """

    kind: Literal["inverse_dynamics"] = "inverse_dynamics"

    needs = (LINKS, MOTORS, "state of all joints at once")
    plants = ("coupled",)

    def feedback(self, design: Design) -> Diagram:
        builder = DiagramBuilder()
        law = inverse_dynamics_controller(
            model=design.device.model,
            omega_n=design.tuning.omega_n,
            zeta=damping_ratio(
                design.tuning.gains, design.tuning.gains.ki / design.tuning.omega_n**2
            ),
        )
        builder.AddNamedSystem("inverse_dynamics", law)
        for name in ("reference", "sampled_state"):
            builder.ExportInput(law.GetInputPort(name), name)
        builder.ExportOutput(law.get_output_port(), "tau_fb")
        return build(builder, "inverse_dynamics")

    def linear(self, design: Design, sample: int) -> Diagram:
        return self.feedback(design)

    def in_words(self, design: Design) -> str:
        return (
            f"feedback linearisation of the whole state every {design.reference.tracked.period:g} s"
        )
