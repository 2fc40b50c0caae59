"""The computed torque controller."""

from __future__ import annotations

from pydrake.systems.framework import DiagramBuilder, System

from sdt_drake.io.arrays import Array, Index
from sdt_drake.run.controllers.base import Shipped
from sdt_drake.run.design import Design
from sdt_drake.systems import InverseDynamicsController
from sdt_drake.systems.gains import damping_ratio


class InverseDynamics(Shipped, kind="inverse_dynamics"):
    """Computed torque from the state of all joints, sampled at the interpolation period.

    The law is that of `sdt_drake.systems.InverseDynamicsController` with the poles of the speed
    loops. It has no integral, so with a wrong model a run does not start in equilibrium.

    .. pydrake_system::

        name: InverseDynamics
        input_ports: [reference, sampled_state]
        output_ports: [tau_cmd]
    """

    def __init__(self, design: Design, *, at: int | None = None) -> None:
        """Make the controller of a design; with `at` its feedback alone, for linear analysis."""
        super().__init__()
        law = InverseDynamicsController(
            model=design.model,
            omega_n=design.omega_n,
            zeta=damping_ratio(design.gains, design.gains.ki / design.omega_n**2),
        )
        builder = DiagramBuilder()
        builder.AddNamedSystem("inverse_dynamics", law)
        self._build(builder, design, at, {})

    @classmethod
    def in_words(cls, design: Design) -> str:
        return f"feedback linearisation of the whole state every {design.motion.period:g} s"

    @classmethod
    def linear(cls, design: Design, sample: int) -> System:
        return cls(design, at=sample)

    def after_updates(self, tau_cmd: Array, measured: Array, held: Index) -> Array:
        return tau_cmd[1:]  # held until the next update
