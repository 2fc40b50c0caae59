"""PI speed controllers. State: the integral of the speed error of each motor."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import Adder, Gain, Integrator, LinearSystem, MatrixGain

from sdt_drake.control import STRUCTURES, SpeedGains
from sdt_drake.errors import checked_choice, checked_number, checked_vector


class PiSpeedController(Diagram):
    """n independent PI speed controllers (Eq. 5, Figure 5), one for each motor.

    With the motor speeds r v and r v_ref, all motor side:

        "pi":             tau_fb = K_IS int(r v_ref - r v) dt + K_PS (r v_ref - r v)
        "p_in_feedback":  tau_fb = K_IS int(r v_ref - r v) dt - K_PS r v

    Both have the same denominator; the second has no zero. It does not limit its output.

    With anti-windup, (tau - tau_cmd) / K_PS is added to what is integrated (back-calculation):
    while the motor saturates, the integral follows what the motor can give, with the time constant
    K_PS / K_IS. The block then has two more inputs, `tau_cmd` and `tau`, before and after the
    saturation. Without it the integral does not stop when the motor saturates.

    .. pydrake_system::

        name: PiSpeedController
        input_ports:
        - reference
        - state
        output_ports:
        - tau_fb
    """

    symbols: ClassVar = {
        "motor_speed_ref": "r",
        "motor_speed": "r",
        "integral": "1/s",
        "given": "1/K_PS",
        "asked": "1/K_PS",
    }

    def __init__(
        self,
        *,
        gains: SpeedGains,
        gear_ratio: ArrayLike,
        structure: str = "p_in_feedback",
        anti_windup: bool = False,
        period: float | None = None,
    ) -> None:
        """Built from integrator, gains and sums, as Figure 5 draws it.

        Args:
            gains: K_PS and K_IS, motor side.
            gear_ratio: r [-], shape (n,).
            structure: "pi" or "p_in_feedback".
            anti_windup: see above.
            period: of a sampled controller [s], whose state is sampled at the same instants: the
                integral grows by period times the error at each. Continuous by default.

        Raises:
            InputError: for another structure, or gains and ratios that do not fit each other.
        """
        super().__init__()
        n = len(gains.kp)
        checked_choice(structure, STRUCTURES, "structure of the PI controller")
        self._ki = checked_vector(gains.ki, n, "ki", positive=True)
        kp = checked_vector(gains.kp, n, "kp", positive=True)
        r = np.diag(checked_vector(gear_ratio, n, "gear_ratio", positive=True))
        zero, one = np.zeros((n, n)), np.eye(n)
        builder = DiagramBuilder()
        add, connect = builder.AddNamedSystem, builder.Connect

        motor_speed_ref = add("motor_speed_ref", MatrixGain(np.hstack([zero, r, zero])))
        motor_speed = add("motor_speed", MatrixGain(np.hstack([zero, -r])))  # to be subtracted
        error = add("speed_error", Adder(2, n))
        if period is None:
            self._integral = add("integral", Integrator(n))
        else:
            checked_number(period, "period", minimum=0, exclusive=True)
            sum_up = LinearSystem(A=one, B=period * one, C=one, D=zero, time_period=period)
            self._integral = add("integral", sum_up)
        k_is, k_ps = add("K_IS", Gain(self._ki)), add("K_PS", Gain(kp))
        total = add("tau_fb", Adder(2, n))

        builder.ExportInput(motor_speed_ref.get_input_port(), "reference")
        builder.ExportInput(motor_speed.get_input_port(), "state")
        connect(motor_speed_ref.get_output_port(), error.get_input_port(0))
        connect(motor_speed.get_output_port(), error.get_input_port(1))
        to_integrate = error
        if anti_windup:
            given, asked = add("given", Gain(1 / kp)), add("asked", Gain(-1 / kp))
            to_integrate = add("shortened_error", Adder(3, n))
            for i, part in enumerate((error, given, asked)):
                connect(part.get_output_port(), to_integrate.get_input_port(i))
            builder.ExportInput(asked.get_input_port(), "tau_cmd")
            builder.ExportInput(given.get_input_port(), "tau")
        connect(to_integrate.get_output_port(), self._integral.get_input_port())
        connect(self._integral.get_output_port(), k_is.get_input_port())
        proportional_to = error if structure == "pi" else motor_speed
        connect(proportional_to.get_output_port(), k_ps.get_input_port())
        connect(k_is.get_output_port(), total.get_input_port(0))
        connect(k_ps.get_output_port(), total.get_input_port(1))
        builder.ExportOutput(total.get_output_port(), "tau_fb")
        builder.BuildInto(self)

    def rest(self, context: Context, tau_integral: ArrayLike) -> None:
        """Start with an integral that gives `tau_integral` [N m], motor side."""
        own = self.GetMutableSubsystemContext(self._integral, context)
        start = np.asarray(tau_integral) / self._ki
        if own.num_discrete_state_groups():
            own.SetDiscreteState(start)
        else:
            own.SetContinuousState(start)
