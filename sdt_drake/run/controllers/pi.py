"""PI speed controllers, alone and with a torque feedforward (Sections 3.3 and 3.4)."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort

from sdt_drake.io.arrays import Array
from sdt_drake.motion import Motion
from sdt_drake.run.controllers.base import Shipped
from sdt_drake.run.design import Design
from sdt_drake.systems import pi_speed_controller
from sdt_drake.systems.gains import SpeedGains
from sdt_drake.systems.pi import set_integral
from sdt_drake.systems.wiring import build


class Pi(Shipped, kind="pi"):
    """A PI speed controller for each motor (Section 3.3), sampled if the drive samples.

    With anti-windup there are two more inputs, `tau_cmd` and `tau_limited`.

    .. pydrake_system::

        name: pi
        input_ports: [reference, measured]
        output_ports: [tau_fb]
    """

    @classmethod
    def diagram(cls, design: Design, at: int | None = None) -> Diagram:
        builder, choice = DiagramBuilder(), design.scenario.controller
        share = 1.0 if at is None else cls._share(design, at)
        pi = pi_speed_controller(
            gains=SpeedGains(kp=share * design.gains.kp, ki=share * design.gains.ki),
            gear_ratio=design.robot.gear_ratio,
            structure=choice.structure_in_use,
            anti_windup=choice.anti_windup and at is None,  # a linear loop does not saturate
            period=design.drive.period,
        )
        builder.AddNamedSystem("pi_speed_controller", pi)
        ahead = cls._add_ahead(builder, design, at)
        for name in ("reference", "measured", "tau_cmd", "tau_limited"):
            if name in ahead:
                builder.Connect(ahead[name], pi.GetInputPort(name))
            elif pi.HasInputPort(name):
                builder.ExportInput(pi.GetInputPort(name), name)
        builder.ExportOutput(pi.get_output_port(), "tau_fb")
        return build(builder, choice.kind)

    @classmethod
    def in_words(cls, design: Design) -> str:
        structure = design.scenario.controller.structure_in_use
        return f"PI speed loops with structure {structure}"

    @classmethod
    def start(
        cls, system: Diagram, context: Context, design: Design, tau_fb: Array, start: Motion | None
    ) -> None:
        # The speed error is zero in steady motion.
        v = (design.motion if start is None else start).v[0]
        is_on_error = design.scenario.controller.structure_in_use == "pi"
        gain = cls._share(design, 0) * design.gains.kp * design.robot.gear_ratio
        proportional = np.zeros_like(v) if is_on_error else -gain * v
        pi = system.GetSubsystemByName("pi_speed_controller")
        own = system.GetMutableSubsystemContext(pi, context)
        set_integral(pi, own, tau_fb - proportional, gains=design.gains)

    # --- overridden by subclasses --------------------------------------------------------------

    @classmethod
    def _add_ahead(
        cls, builder: DiagramBuilder, design: Design, at: int | None
    ) -> dict[str, OutputPort]:
        """Add blocks ahead of the PI controllers; return what these read, by their inputs."""
        return {}

    @classmethod
    def _share(cls, design: Design, sample: int) -> Array | float:
        """Return the factor on the tuned gains at a sample; 1 unless gains are scheduled."""
        return 1.0


class PiCtc(Pi, kind="pi_ctc"):
    """PI speed controllers with feedforward of the load torque (Section 3.4, Figure 6).

    The loop adds the feedforward: that is the paper's computed torque control. The kind
    `inverse_dynamics` is feedback linearisation, which books call by the same name.

    .. pydrake_system::

        name: pi_ctc
        input_ports: [reference, measured]
        output_ports: [tau_fb]
    """


class PiId(Pi, kind="pi_id"):
    """PI speed controllers with feedforward of the whole inverse dynamics.

    Both gains act on the error, so with an exact model nothing is left for the feedback.

    .. pydrake_system::

        name: pi_id
        input_ports: [reference, measured]
        output_ports: [tau_fb]
    """
