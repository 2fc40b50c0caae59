from __future__ import annotations

from pydrake.systems.framework import System

from sdt_drake.run.controllers.base import Controller, add_feedforward
from sdt_drake.run.design import Design
from sdt_drake.systems import InverseDynamicsController, Wired
from sdt_drake.systems.gains import damping_ratio


class InverseDynamics(Wired, Controller, kind="inverse_dynamics"):
    """Computed torque from the state of all joints at the interpolation period, the law of
    `sdt_drake.systems.InverseDynamicsController`, with the poles of the speed loops.

    It has no integral: with a wrong model it does not start in equilibrium.

    .. pydrake_system::

        name: InverseDynamics
        input_ports: [reference, sampled_state]
        output_ports: [tau_cmd]
    """

    def __init__(self, design: Design, *, at: int | None = None) -> None:
        """Of a design; at: for linear analysis, its feedback alone."""
        super().__init__()
        law = InverseDynamicsController(
            model=design.model,
            omega_n=design.omega_n,
            zeta=damping_ratio(design.gains, design.gains.ki / design.omega_n**2),
        )
        self.add("inverse_dynamics", law)
        add_feedforward(self, design, at)
        self.build("tau_cmd")

    @classmethod
    def in_words(cls, design: Design) -> str:
        return f"feedback linearisation of the whole state every {design.motion.period:g} s"

    @classmethod
    def linear(cls, design: Design, sample: int) -> System:
        return cls(design, at=sample)

    @property
    def is_sampled(self) -> bool:
        return True
