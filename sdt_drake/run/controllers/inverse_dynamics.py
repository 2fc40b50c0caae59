"""The computed torque controller."""

from dataclasses import dataclass
from typing import Literal

from pydrake.systems.framework import Diagram

from sdt_drake.run.design import Design
from sdt_drake.run.options import LINKS, MOTORS, ControllerOptions
from sdt_drake.systems import inverse_dynamics_controller
from sdt_drake.systems.gains import damping_ratio


@dataclass(frozen=True)
class InverseDynamics(ControllerOptions):
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
        gains, omega_n = design.tuning.gains, design.tuning.omega_n
        zeta = damping_ratio(gains, gains.ki / omega_n**2)
        law = inverse_dynamics_controller(model=design.device.model, omega_n=omega_n, zeta=zeta)
        law.set_name("inverse_dynamics")
        return law

    def linear(self, design: Design, sample: int) -> Diagram:
        return self.feedback(design)

    def in_words(self, design: Design) -> str:
        return (
            f"feedback linearisation of the whole state every {design.reference.tracked.period:g} s"
        )
