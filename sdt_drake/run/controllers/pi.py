"""PI speed controllers, alone and with a torque feedforward (Sections 3.3 and 3.4)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, cast

from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort, System

from sdt_drake.io.arrays import Array
from sdt_drake.io.fields import Number, field
from sdt_drake.motion import Motion
from sdt_drake.run.design import Design
from sdt_drake.run.options import LARGEST_INERTIA, AntiWindup, FeedforwardGain
from sdt_drake.systems import pi_speed_controller
from sdt_drake.systems.gains import SpeedGains
from sdt_drake.systems.pi import set_integral
from sdt_drake.systems.wiring import build


@dataclass(frozen=True)
class PiLoops(AntiWindup):
    """Options of all controllers with a PI speed controller for each motor."""

    needs = (LARGEST_INERTIA,)
    takes_feedforward = True

    @property
    def setpoint_weight(self) -> float:
        """Set-point weight b of the PI controllers [-]; 1 if it is no option."""
        return 1.0

    def ahead(
        self, builder: DiagramBuilder, design: Design, sample: int | None
    ) -> Mapping[str, OutputPort]:
        """Add the blocks ahead of the PI controllers; return what these read, by input."""
        return {}

    def share(self, design: Design, sample: int) -> Array | float:
        """Return the factor on the tuned gains at a sample [-], shape (n,) or one for all."""
        return 1.0

    def feedback(self, design: Design, sample: int | None = None) -> Diagram:
        """Make PI controllers of a design, and the blocks ahead of them.

        Args:
            design: the design of the loop.
            sample: sample for linear analysis, without anti-windup, as nothing saturates there.
        """
        builder, gains = DiagramBuilder(), design.tuning.gains
        share = 1.0 if sample is None else self.share(design, sample)
        pi = pi_speed_controller(
            gains=SpeedGains(kp=share * gains.kp, ki=share * gains.ki),
            gear_ratio=design.device.simulated.gear_ratio,
            setpoint_weight=self.setpoint_weight,
            anti_windup=self.anti_windup and sample is None,
            period=design.drive.period,
        )
        builder.AddNamedSystem("pi_speed_controller", pi)
        signals = self.ahead(builder, design, sample)
        for name in ("reference", "measured", "tau_cmd", "tau_limited"):
            if name in signals:
                builder.Connect(signals[name], pi.GetInputPort(name))
            elif pi.HasInputPort(name):
                builder.ExportInput(pi.GetInputPort(name), name)
        builder.ExportOutput(pi.get_output_port(), "tau_fb")
        return build(builder, self.kind)

    def linear(self, design: Design, sample: int) -> Diagram:
        return self.feedback(design, sample)

    def start(
        self, system: System, context: Context, design: Design, tau: Array, start: Motion | None
    ) -> None:
        """Set the integrals to a torque in steady motion, where the speed error is zero.

        The proportional gain then commands K_PS (b - 1) r v.
        """
        v, gains = (design.reference.tracked if start is None else start).v[0], design.tuning.gains
        kp_r = self.share(design, 0) * gains.kp * design.device.simulated.gear_ratio
        proportional = -(1 - self.setpoint_weight) * kp_r * v
        pi = cast(Diagram, system).GetSubsystemByName("pi_speed_controller")
        own = cast(Diagram, system).GetMutableSubsystemContext(pi, context)
        set_integral(pi, own, tau - proportional, gains=gains)

    def in_words(self, design: Design) -> str:
        b = self.setpoint_weight
        return {1.0: "PI speed loops", 0.0: "I-P speed loops"}.get(
            b, f"PI speed loops with set-point weight {b:g}"
        )


@dataclass(frozen=True)
class WeightedPi(PiLoops):
    """Options of PI controllers whose set-point weight the scenario chooses."""

    setpoint_weight: Number = field(0.0, ge=0, le=1, unit="-")
    """Set-point weight b of the proportional gain, which acts on b r v_ref - r v: 0 is I-P
    (Figure 5), 1 is PI with both gains on the error, as in other kinds."""


@dataclass(frozen=True)
class Pi(WeightedPi):
    """A PI speed controller for each motor (Section 3.3), sampled if the drive samples.

    With anti-windup there are two more inputs, `tau_cmd` and `tau_limited`.

    .. pydrake_system::

        name: pi
        input_ports: [reference, measured]
        output_ports: [tau_fb]
    """

    kind: Literal["pi"] = "pi"


@dataclass(frozen=True)
class PiCtc(WeightedPi, FeedforwardGain):
    """PI speed controllers with feedforward of the load torque (Section 3.4, Figure 6).

    The loop adds the feedforward: that is the paper's computed torque control. The kind
    `inverse_dynamics` is feedback linearisation, which books call by the same name.

    .. pydrake_system::

        name: pi_ctc
        input_ports: [reference, measured]
        output_ports: [tau_fb]
    """

    kind: Literal["pi_ctc"] = "pi_ctc"

    @property
    def feedforward_in_use(self) -> str:
        return "ctc"


@dataclass(frozen=True)
class PiId(PiLoops, FeedforwardGain):
    """PI speed controllers with feedforward of the whole inverse dynamics.

    Both gains act on the error, so with an exact model nothing is left for the feedback.

    .. pydrake_system::

        name: pi_id
        input_ports: [reference, measured]
        output_ports: [tau_fb]
    """

    kind: Literal["pi_id"] = "pi_id"

    @property
    def feedforward_in_use(self) -> str:
        return "id"
