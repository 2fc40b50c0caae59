from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import Context, System
from pydrake.systems.primitives import Adder, Gain, Integrator, LinearSystem, MatrixGain

from sdt_drake.io.errors import checked_choice, checked_positive
from sdt_drake.systems.gains import STRUCTURES, SpeedGains
from sdt_drake.systems.wiring import Wired


class PiSpeedController(Wired):
    """n independent PI speed controllers (Eq. 5, Figure 5), one for each motor.

    With the motor speeds r v and r v_ref, all motor side:

        "pi":             tau_fb = K_IS int(r v_ref - r v) dt + K_PS (r v_ref - r v)
        "p_in_feedback":  tau_fb = K_IS int(r v_ref - r v) dt - K_PS r v

    Both have the same denominator; the second has no zero. It does not limit its output. State: the
    integral of the speed error of each motor.

    With anti-windup, (tau - tau_cmd) / K_PS is added to what is integrated (back-calculation):
    while the motor saturates, the integral follows what the motor can give, with the time constant
    K_PS / K_IS. The block then has two more inputs, `tau_cmd` and `tau`, before and after the
    saturation. Without it the integral does not stop when the motor saturates.

    Args:
        gains: K_PS and K_IS, motor side.
        gear_ratio: r [-], shape (n,).
        structure: "pi" or "p_in_feedback".
        anti_windup: see above.
        period: of a sampled controller [s], whose state is sampled at the same instants: the
            integral grows by period times the error at each. Continuous by default.

    .. pydrake_system::

        name: PiSpeedController
        input_ports: [reference, state]
        output_ports: [tau_fb]
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
        super().__init__()
        checked_choice(structure, STRUCTURES, "structure")
        n, kp = len(gains.kp), gains.kp
        r = np.diag(checked_positive(gear_ratio, "gear_ratio", n))
        zero, one = np.zeros((n, n)), np.eye(n)
        integral: System = Integrator(n)
        if period is not None:
            integral = LinearSystem(A=one, B=period * one, C=one, D=zero, time_period=period)
        self._ki = gains.ki

        speed_ref, speed = np.hstack([zero, r, zero]), np.hstack([zero, r])
        self.add("motor_speed_ref", MatrixGain(speed_ref), "reference", "r v_ref")
        self.add("motor_speed", MatrixGain(-speed), "state", "-r v")
        self.add("speed_error", Adder(2, n), "r v_ref", "-r v", "error")
        if anti_windup:
            self.add("asked", Gain(-1 / kp), "tau_cmd", "asked")
            self.add("given", Gain(1 / kp), "tau", "given")
            self.add("shortened_error", Adder(3, n), "error", "given", "asked", "to_integrate")
        else:
            self.same("to_integrate", "error")
        self._integral = self.add("integral", integral, "to_integrate", "integral")
        self.add("K_IS", Gain(gains.ki), "integral", "integral_torque")
        proportional_to = "error" if structure == "pi" else "-r v"
        self.add("K_PS", Gain(kp), proportional_to, "proportional_torque")
        self.add("tau_fb", Adder(2, n), "integral_torque", "proportional_torque", "tau_fb")
        self.build("tau_fb")

    def rest(self, context: Context, tau_integral: ArrayLike) -> None:
        """Start with an integral that gives `tau_integral` [N m], motor side."""
        self.set_state(context, self._integral, np.asarray(tau_integral) / self._ki)
