"""PI speed controllers, alone and with a torque feedforward (Sections 3.3 and 3.4)."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort, System
from pydrake.systems.primitives import LinearSystem

from sdt_drake.io.arrays import Array
from sdt_drake.io.fields import Number, field
from sdt_drake.motion import Motion
from sdt_drake.run.design import Design
from sdt_drake.run.filters import Filters
from sdt_drake.run.options import LARGEST_INERTIA, AntiWindup, FeedforwardGain
from sdt_drake.systems import pi_speed_controller
from sdt_drake.systems.filters import PASS, filter_of, set_filter
from sdt_drake.systems.gains import SpeedGains
from sdt_drake.systems.pi import set_integral
from sdt_drake.systems.torque_loop import torque_unit
from sdt_drake.systems.wiring import build, nested


@dataclass(frozen=True)
class PiLoops(AntiWindup):
    """Options of all controllers with a PI speed controller for each motor."""

    filters: Filters | None = field(None)
    """Filters of torque, measured speed and speed reference; none by default."""

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

    def behind(
        self, builder: DiagramBuilder, design: Design, tau_fb: OutputPort, sample: int | None
    ) -> OutputPort:
        """Add the blocks between the PI controllers and the filters; return their torque."""
        return tau_fb

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
        filters = {name: builder.AddNamedSystem(name, x) for name, x in _filters(self, design)}
        for name in ("reference", "measured", "tau_cmd", "tau_limited"):
            if not pi.HasInputPort(name):
                continue
            port = pi.GetInputPort(name)
            if one := filters.get(_FILTERED.get(name, "")):
                builder.Connect(one.get_output_port(), port)
                port = one.get_input_port()
            if name in signals:
                builder.Connect(signals[name], port)
            else:
                builder.ExportInput(port, name)
        tau_fb = self.behind(builder, design, pi.get_output_port(), sample)
        for one in (filters[name] for name in _OF_TORQUE if name in filters):
            builder.Connect(tau_fb, one.get_input_port())
            tau_fb = one.get_output_port()
        builder.ExportOutput(tau_fb, "tau_fb")
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
        pi = nested(system, context, "pi_speed_controller")
        set_integral(*pi, tau - proportional, gains=gains)
        self.start_filters(system, context, design, tau, self.share(design, 0) * v)

    def start_filters(
        self, system: System, context: Context, design: Design, tau: Array, v: Array
    ) -> None:
        """Set the filters to a constant torque [N m], motor side, and speed of joints [rad/s]."""
        zero = np.zeros_like(v)
        steady = {
            "speed_low_pass": np.concatenate([zero, v]),
            "reference_low_pass": np.concatenate([zero, v, zero]),
        }
        for name in self.filters.sections() if self.filters else ():
            set_filter(*nested(system, context, name), steady.get(name, tau))

    def in_words(self, design: Design) -> str:
        b, filtered = self.setpoint_weight, "filtered " * bool(self.filters)
        kind = {0.0: "I-P speed loops"}.get(b, "PI speed loops")
        return f"{filtered}{kind}" + (f" with set-point weight {b:g}" if b not in (0, 1) else "")


_FILTERED = {"reference": "reference_low_pass", "measured": "speed_low_pass"}
"""Filters of inputs of a PI controller."""

_OF_TORQUE = ("notch", "torque_low_pass")
"""Filters of its output, in their order."""


def _filters(choice: PiLoops, design: Design) -> Iterator[tuple[str, LinearSystem]]:
    """Yield the filters of PI controllers by name, each of a whole signal."""
    none = [PASS] * design.device.simulated.n
    if choice.filters is None:
        return
    for name, sections in choice.filters.sections().items():
        whole, unit = sections, np.ones(len(none))
        if name == "speed_low_pass":
            whole, unit = none + sections, np.ones(2 * len(none))
        elif name == "reference_low_pass":
            whole, unit = none + sections + none, np.ones(3 * len(none))
        else:
            unit = torque_unit(design.device.simulated.motor_torque_limit)
        yield name, filter_of(whole, unit=unit, period=design.drive.period)


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
