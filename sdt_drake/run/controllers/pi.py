"""PI speed controllers, alone and with a torque feedforward (Sections 3.3 and 3.4)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import Context, DiagramBuilder, System

from sdt_drake.io.arrays import Array, Index
from sdt_drake.motion import Motion
from sdt_drake.run.controllers.base import Shipped
from sdt_drake.run.design import Design
from sdt_drake.systems import PiSpeedController
from sdt_drake.systems.gains import SpeedGains


class Pi(Shipped, kind="pi"):
    """A PI speed controller for each motor (Section 3.3), sampled if the drive samples.

    With anti-windup there is one more input, `tau_limited`.

    .. pydrake_system::

        name: Pi
        input_ports: [reference, state]
        output_ports: [tau_cmd]
    """

    def __init__(self, design: Design, *, at: int | None = None) -> None:
        """Make the controller of a design.

        Args:
            design: the design of the loop.
            at: a sample for linear analysis: the feedback alone, with its gains there.
        """
        super().__init__()
        self._design = design
        choice, gains = design.scenario.controller, design.gains
        self._kp = gains.kp * design.robot.gear_ratio  # acts on the joint speed [N m s/rad]
        share = 1.0 if at is None else self._share(at)
        self._pi = PiSpeedController(
            gains=SpeedGains(kp=share * gains.kp, ki=share * gains.ki),
            gear_ratio=design.robot.gear_ratio,
            structure=choice.structure_in_use,
            anti_windup=choice.anti_windup and at is None,  # a linear loop does not saturate
            period=design.drive.period,
        )
        builder = DiagramBuilder()
        inputs = {"tau": "tau_limited"} | self._add_ahead(builder, at)
        builder.AddNamedSystem("pi_speed_controller", self._pi)
        aliases = {("pi_speed_controller", port): signal for port, signal in inputs.items()}
        self._build(builder, design, at, aliases)

    @classmethod
    def in_words(cls, design: Design) -> str:
        structure = design.scenario.controller.structure_in_use
        return f"PI speed loops with structure {structure}"

    @classmethod
    def linear(cls, design: Design, sample: int) -> System:
        return cls(design, at=sample)

    def rest(self, context: Context, tau_cmd: ArrayLike, start: Motion | None = None) -> None:
        super().rest(context, tau_cmd)
        design = self._design
        v, steady_ff = design.motion.v[0], design.steady_ff
        if start is not None:
            v, steady_ff = start.v[0], design.steady_ff_at(start)
        # The speed error is zero in steady motion.
        fed_back = self._share(0) * self._kp * (0.0 if self._is_on_error else v)
        integral = np.asarray(tau_cmd) + fed_back - steady_ff
        self._pi.rest(self.GetMutableSubsystemContext(self._pi, context), integral)

    def after_updates(self, tau_cmd: Array, measured: Array, held: Index) -> Array:
        if self._design.drive.period is not None:
            return tau_cmd[1:]  # held until the next update
        q, v = np.hsplit(measured[:-1], 2)
        before = np.maximum(np.arange(len(held)) - 1, 0)
        jump = self._at_once(held, q, v) - self._at_once(held[before], q[before], v)
        return tau_cmd[:-1] + jump

    def _at_once(self, held: Index, q: Array, v: Array) -> Array:
        """Return the part of the command that jumps with held inputs, motor side [N m]."""
        v_ref = self._speed_reference(held, q) if self._is_on_error else 0.0
        tau_ff = 0.0 if self._design.tau_ff is None else self._design.tau_ff[held]
        return self._share(held) * self._kp * (v_ref - v) + tau_ff

    @property
    def _is_on_error(self) -> bool:
        """True if the proportional gain acts on the speed error (structure "pi")."""
        return self._design.scenario.controller.structure_in_use == "pi"

    # --- overridden by subclasses --------------------------------------------------------------

    def _add_ahead(self, builder: DiagramBuilder, at: int | None) -> dict[str, str]:
        """Add blocks ahead of the PI controllers; return names of signals by renamed input."""
        return {}

    def _speed_reference(self, held: Index, q: Array) -> Array:
        """Return the reference of the speed loops for sampled positions q, joint side [rad/s]."""
        return self._design.reference.v[held]

    def _share(self, held: Index | int) -> Array | float:
        """Return the factor on the tuned gains at samples; 1 unless gains are scheduled."""
        return 1.0


class PiCtc(Pi, kind="pi_ctc"):
    """PI speed controllers with feedforward of the load torque (Section 3.4, Figure 6).

    If that torque differs from the load torque of the loop, the controller computes it and has no
    such input.

    .. pydrake_system::

        name: PiCtc
        input_ports: [reference, state, load_torque]
        output_ports: [tau_cmd]
    """


class PiId(Pi, kind="pi_id"):
    """PI speed controllers with feedforward of the whole inverse dynamics.

    Both gains act on the error, so with an exact model nothing is left for the feedback.

    .. pydrake_system::

        name: PiId
        input_ports: [reference, state]
        output_ports: [tau_cmd]
    """
