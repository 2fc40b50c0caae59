"""What stands between a controller and the plant: drives and encoders."""

from __future__ import annotations

import numpy as np
import pydrake.symbolic as sym
from numpy.typing import ArrayLike
from pydrake.systems.framework import Context
from pydrake.systems.primitives import (
    FirstOrderLowPassFilter,
    Gain,
    MatrixGain,
    Multiplexer,
    Saturation,
    ZeroOrderHold,
)

from sdt_drake.arrays import Array
from sdt_drake.errors import InputError, checked_count, checked_number, checked_positive
from sdt_drake.systems.symbolic import SymbolicLaw, Symbols
from sdt_drake.systems.wiring import Wired

_TINY = np.finfo(float).tiny


class DynamicSaturation(SymbolicLaw):
    """The motors' limits, widened by the help of the other motors (Section 3.2, Figure 3).

        tau = clip(tau_cmd, -L + min(a, 0), L + max(a, 0))      [N m], motor side

    with L the largest motor torque and a the alleviating torque. The paper widens the limit in the
    direction of the reference acceleration; a always has the sign of that. No state. It does not
    tell the controller that it saturates.

    With a torque-speed envelope, L falls on a straight line from its full value at the motor speed
    n1 to 0 at n0, in the direction in which the motor turns; against it (braking) the supply
    voltage limits nothing. The block then has one more input, `state`.

    .. pydrake_system::

        name: DynamicSaturation
        input_ports: [tau_cmd, alleviating_torque]
        output_ports: [tau]
    """

    symbol = "dynamic\nsaturation"

    def __init__(
        self,
        *,
        motor_torque_limit: ArrayLike,
        gear_ratio: ArrayLike = 1.0,
        n1: ArrayLike | None = None,
        n0: ArrayLike | None = None,
        widened: bool = True,
    ) -> None:
        """Of n motors.

        Args:
            motor_torque_limit: L, motor side [N m], shape (n,), > 0.
            gear_ratio: r [-], shape (n,), for the envelope.
            n1, n0: motor speeds of the envelope [rad/s], shape (n,), 0 < n1 < n0; a constant limit
                by default.
            widened: whether there is an input `alleviating_torque`; else a = 0.
        """
        if (n1 is None) != (n0 is None):
            raise InputError("n1, n0: one is missing, expected both or neither")
        limit = checked_positive(motor_torque_limit, "motor_torque_limit")
        n, has_envelope = len(limit), n1 is not None
        if not has_envelope and not widened:
            Wired.__init__(self)  # Drake's own block is quicker than a law in symbols
            self.add("law", Saturation(-limit, limit), "tau_cmd", "tau")
            self.build("tau")
            return

        rated, no_load = np.asarray(n1), np.asarray(n0)
        nothing, all_of_it = sym.Expression(0), sym.Expression(1)

        def within_envelope(motor_speed: Symbols) -> Symbols:
            left = (no_load - motor_speed) / (no_load - rated)
            return limit * np.array([sym.min(sym.max(share, nothing), all_of_it) for share in left])

        def law(tau_cmd: Symbols, *others: Symbols) -> list[sym.Expression]:
            lower: Array | Symbols = -limit
            upper: Array | Symbols = limit
            if has_envelope:
                motor_speed = np.asarray(gear_ratio) * others[-1][n:]
                lower, upper = -within_envelope(-motor_speed), within_envelope(motor_speed)
            if widened:
                # min(a, 0) and max(a, 0) with a derivative at a = 0 as well: Drake's are NaN there.
                a = others[0]
                lower = lower + [sym.if_then_else(help_ < -_TINY, help_, nothing) for help_ in a]
                upper = upper + [sym.if_then_else(help_ > _TINY, help_, nothing) for help_ in a]
            return [sym.min(sym.max(tau_cmd[k], lower[k]), upper[k]) for k in range(n)]

        inputs = {"tau_cmd": n}
        inputs |= {"alleviating_torque": n} if widened else {}
        inputs |= {"state": 2 * n} if has_envelope else {}
        super().__init__(inputs=inputs, output="tau", law=law)


class TorqueLoop(Wired):
    """What the motors make of the torque that they should give.

        T dtau/dt = (1 + error) tau_limited - tau,    T = 1 / (2 pi bandwidth)

    Torques motor side [N m]. Without a bandwidth it does not lag, without an error it is exact.
    State, where it lags: the torque over 100 times its limit. It does not limit the torques.

    .. pydrake_system::

        name: TorqueLoop
        input_ports: [tau_limited]
        output_ports: [tau]
    """

    symbol = "torque\nloop"

    def __init__(
        self,
        *,
        motor_torque_limit: ArrayLike,
        bandwidth: float | None = None,
        error: ArrayLike | None = None,
    ) -> None:
        """Of n motors.

        Args:
            motor_torque_limit: largest torque of the motors, motor side [N m], shape (n,), > 0; the
                size of the signal.
            bandwidth: frequency at which the gain has fallen by 3 dB [Hz], > 0; infinite by
                default.
            error: share of the torque [-], shape (n,); 0 by default.
        """
        super().__init__()
        limit = checked_positive(motor_torque_limit, "motor_torque_limit")
        gain = np.ones(len(limit)) if error is None else 1 + np.asarray(error)
        self._lag = None
        # An error-controlled integrator takes 1 N m as seriously as 1 rad/s. In units of 100 limits
        # the torque is good to 1e-3 of the limit while it settles, the speeds to 1e-5.
        self._unit = 100 * limit
        if bandwidth is None:
            self.add("gain", Gain(gain), "tau_limited", "tau")
        else:
            lag = FirstOrderLowPassFilter(1 / (2 * np.pi * bandwidth), len(limit))
            self.add("share", Gain(gain / self._unit), "tau_limited", "share")
            self._lag = self.add("lag", lag, "share", "lagging")
            self.add("unit", Gain(self._unit), "lagging", "tau")
        self.build("tau")

    def rest(self, context: Context, tau: ArrayLike) -> None:
        """Start with motors that give `tau` [N m], motor side, shape (n,)."""
        if self._lag is not None:
            self.set_state(context, self._lag, np.asarray(tau) / self._unit)


class Encoder(Wired):
    """Samples the state every `period` [s], first at time 0, and holds it: [q, v], joint side.

    With a resolution, the positions are those of an incremental encoder on the motor's shaft, and
    the speeds their differences, which lag by half a period:

        q_k = floor(q N r / (2 pi)) 2 pi / (N r),    v_k = (q_k - q_(k-1)) / period

    State: the last sample, or the last two. It does not delay: a sample is in force from its own
    instant on.

    .. pydrake_system::

        name: Encoder
        input_ports: [state]
        output_ports: [measured]
    """

    def __init__(
        self,
        *,
        n: int,
        period: float,
        resolution: ArrayLike | None = None,
        gear_ratio: ArrayLike | None = None,
    ) -> None:
        """Of n joints.

        Args:
            n: number of joints.
            period: [s], > 0.
            resolution: N, increments per revolution of the motor [-], shape (n,); ideal by default.
            gear_ratio: r [-], shape (n,); needed with a resolution.
        """
        super().__init__()
        checked_count(n, "n")
        self._period = checked_number(period, "period", minimum=0, exclusive=True)
        self._increment = None
        self.symbol = f"encoder\n{1e3 * period:g} ms"
        if resolution is None:
            self._now = self.add("now", ZeroOrderHold(period, 2 * n), "state", "measured")
        else:
            if gear_ratio is None:
                raise InputError("gear_ratio: missing, expected with a resolution")
            shaft = checked_positive(gear_ratio, "gear_ratio", n)
            increment = 2 * np.pi / (checked_positive(resolution, "resolution", n) * shaft)
            self._increment = increment

            def count(state: Symbols) -> list[sym.Expression]:
                return [sym.floor(state[k] / step) * step for k, step in enumerate(increment)]

            one, zero = np.eye(n), np.zeros((n, n))
            difference = np.block([[one, zero], [one / period, -one / period]])
            self.add("count", SymbolicLaw(inputs={"state": 2 * n}, output="q", law=count))
            self._now = self.add("now", ZeroOrderHold(period, n), "q", "now")
            # Updated at the same instants as `now`, it sees what `now` held until then.
            self._before = self.add("before", ZeroOrderHold(period, n), "now", "before")
            self.add("samples", Multiplexer([n, n]), "now", "before", "samples")
            self.add("difference", MatrixGain(difference), "samples", "measured")
        self.build("measured")

    def rest(self, context: Context, q: ArrayLike, v: ArrayLike) -> None:
        """Start with samples taken at q [rad], moving with v [rad/s] for long; joint side."""
        if self._increment is None:
            self.set_state(context, self._now, np.concatenate([q, v]))
            return
        count = np.floor(np.asarray(q) / self._increment) * self._increment
        self.set_state(context, self._now, count)
        self.set_state(context, self._before, count - self._period * np.asarray(v))
