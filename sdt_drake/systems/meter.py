from __future__ import annotations

import numpy as np
import pydrake.symbolic as sym
from numpy.typing import ArrayLike
from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.primitives import Multiplexer, SymbolicVectorSystem

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import checked_positive

_TINY = np.finfo(float).tiny
_UNIT = 1e12  # of the state: so large that no error-controlled integrator sees it


def add_meter(
    builder: DiagramBuilder,
    *,
    motor_torque_limit: ArrayLike,
    tau_cmd: OutputPort,
    tau_limited: OutputPort,
    tau: OutputPort,
) -> tuple[OutputPort, OutputPort]:
    """Add a meter of mean torque, RMS torque and time in saturation to a diagram.

        state = [int tau / L dt, int (tau / L)² dt, int [tau_cmd != tau_limited] dt] / 1e12

    A command that sits exactly at its limit is not saturated. The state takes no part in the choice
    of an integrator's steps: it is as good as the steps that the rest of the diagram needs. So the
    start or end of a saturation is good to a third of a step; on the average they are right. The
    meter knows nothing of peaks.

    Args:
        builder: of the diagram.
        motor_torque_limit: L, largest torque of the motors [N m], shape (n,), > 0.
        tau_cmd, tau_limited, tau: torques before and after the saturation, and as the drives give
            it, motor side [N m], length n.

    Returns:
        The three torques side by side, and the state, both of length 3n.
    """
    limit = checked_positive(motor_torque_limit, "motor_torque_limit")
    size = 3 * len(limit)
    signals = Multiplexer([len(limit)] * 3)
    state, torques = (np.array([sym.Variable(f"{x}_{k}") for k in range(size)]) for x in "xu")
    asked, limited, given = np.split(torques, 3)
    on, off = sym.Expression(1 / _UNIT), sym.Expression(0)
    scale = 1 / (_UNIT * limit)
    with np.errstate(invalid="ignore"):  # numpy takes symbols for invalid numbers
        # Not !=: its derivative is NaN where both are the same.
        saturated = [sym.if_then_else(lost**2 > _TINY, on, off) for lost in asked - limited]
        rates = [*(scale * given), *(scale / limit * given * given), *saturated]
    law = SymbolicVectorSystem(
        state=state,
        input=torques,
        dynamics=np.array(rates),
        output=np.array([sym.Expression(x) for x in state]),
    )
    # Names of logs: what only measures is no block of a loop. A Diagram around both costs 5 %.
    builder.AddNamedSystem("log.signals", signals)
    builder.AddNamedSystem("log.meter", law)
    for i, port in enumerate((tau_cmd, tau_limited, tau)):
        builder.Connect(port, signals.get_input_port(i))
    builder.Connect(signals.get_output_port(), law.get_input_port())
    return signals.get_output_port(), law.get_output_port()


def read_meter(state: Array, limit: Array, period: float) -> tuple[Array, Array, Array]:
    """Mean and RMS torque [N m], and share of the time in saturation [-], of each period.

    Args:
        state: of the meter at the ends of N periods, shape (N + 1, 3 n).
        limit: L, as of the meter.
        period: length of each [s].

    Returns:
        Each of shape (N, n).
    """
    mean, square, share = np.hsplit(np.diff(state, axis=0) * (_UNIT / period), 3)
    return limit * mean, limit * np.sqrt(square), share
