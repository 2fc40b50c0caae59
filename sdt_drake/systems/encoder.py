from __future__ import annotations

import numpy as np
import pydrake.symbolic as sym
from numpy.typing import ArrayLike
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import MatrixGain, Multiplexer, ZeroOrderHold

from sdt_drake.io.errors import InputError, checked_count, checked_number, checked_positive
from sdt_drake.systems.symbolic import SymbolicLaw, Symbols


class Encoder(Diagram):
    """An encoder: samples the state [q, v], joint side, every period from `offset` on and holds it.

    With a resolution, the positions are those of an incremental encoder on the motor's shaft. The
    speeds are their differences, which lag by half a period:

        q_k = floor(q N r / (2 pi)) 2 pi / (N r),    v_k = (q_k - q_(k-1)) / period

    State: the last sample, or the last two. The block does not delay: a sample is valid from its
    own instant on.

    Args:
        n: number of joints.
        period: sample period [s], > 0.
        resolution: N, increments per revolution of the motor [-], shape (n,); ideal by default.
        gear_ratio: r [-], shape (n,); required with a resolution.
        offset: time of the first sample [s]; 0 by default.

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
        offset: float = 0.0,
    ) -> None:
        super().__init__()
        builder = DiagramBuilder()
        add, connect = builder.AddNamedSystem, builder.Connect
        checked_count(n, "n")
        self._period = checked_number(period, "period", minimum=0, exclusive=True)
        self._offset = checked_number(offset, "offset", minimum=0)
        self._increment = None
        if resolution is None:
            self._now = ZeroOrderHold(period, 2 * n, offset)
            add("now", self._now)
            builder.ExportInput(self._now.get_input_port(), "state")
            builder.ExportOutput(self._now.get_output_port(), "measured")
        else:
            if gear_ratio is None:
                raise InputError("missing, required with a resolution", place="gear_ratio")
            shaft = checked_positive(gear_ratio, "gear_ratio", n)
            increment = 2 * np.pi / (checked_positive(resolution, "resolution", n) * shaft)
            self._increment = increment

            def count(state: Symbols) -> list[sym.Expression]:
                return [sym.floor(state[k] / step) * step for k, step in enumerate(increment)]

            one, zero = np.eye(n), np.zeros((n, n))
            difference = np.block([[one, zero], [one / period, -one / period]])
            counts = add("count", SymbolicLaw(inputs={"state": 2 * n}, output="q", law=count))
            # `before` is updated at the same instants, with the value that `now` held until then.
            self._now, self._before = (ZeroOrderHold(period, n, offset) for _ in range(2))
            now, before = add("now", self._now), add("before", self._before)
            samples = add("samples", Multiplexer([n, n]))
            measured = add("difference", MatrixGain(difference))
            builder.ExportInput(counts.get_input_port(), "state")
            connect(counts.get_output_port(), now.get_input_port())
            connect(now.get_output_port(), before.get_input_port())
            connect(now.get_output_port(), samples.get_input_port(0))
            connect(before.get_output_port(), samples.get_input_port(1))
            connect(samples.get_output_port(), measured.get_input_port())
            builder.ExportOutput(measured.get_output_port(), "measured")
        builder.BuildInto(self)

    def rest(self, context: Context, q: ArrayLike, v: ArrayLike) -> None:
        """Set the samples of a steady motion through q [rad] at v [rad/s], joint side.

        Without an offset, a sample at time 0 follows. The last one before is then a period old.
        """
        now = self.GetMutableSubsystemContext(self._now, context)
        if self._increment is None:
            self._now.SetVectorState(now, np.concatenate([q, v]))
            return
        q, turned = np.asarray(q), self._period * np.asarray(v)
        last = q if self._offset else q - turned
        count = np.floor(last / self._increment) * self._increment
        self._now.SetVectorState(now, count)
        before = self.GetMutableSubsystemContext(self._before, context)
        self._before.SetVectorState(before, count - turned)
