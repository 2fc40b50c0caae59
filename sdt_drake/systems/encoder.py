"""Encoders. State: the last two samples."""

from __future__ import annotations

import numpy as np
import pydrake.symbolic as sym
from numpy.typing import ArrayLike
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import MatrixGain, Multiplexer, ZeroOrderHold

from sdt_drake.errors import checked_count, checked_number, checked_vector
from sdt_drake.systems.symbolic import SymbolicLaw


class Encoder(Diagram):
    """Samples the state every `period` [s], first at time 0, and holds it: [q, v], joint side.

    With a resolution, the positions are those of an incremental encoder on the motor's shaft, and
    the speeds their differences, which lag by half a period:

        q_k = floor(q N r / (2 pi)) 2 pi / (N r),    v_k = (q_k - q_(k-1)) / period

    It does not delay: a sample is in force from its own instant on.

    .. pydrake_system::

        name: Encoder
        input_ports:
        - state
        output_ports:
        - measured
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

        Raises:
            InputError: for values that are not finite and > 0.
        """
        super().__init__()
        checked_count(n, "n")
        self._period = checked_number(period, "period", minimum=0, exclusive=True)
        self.symbol = f"encoder\n{1e3 * period:g} ms"
        builder = DiagramBuilder()
        add, connect = builder.AddNamedSystem, builder.Connect
        if resolution is None:
            self._increment = None
            self._now = first = last = add("now", ZeroOrderHold(period, 2 * n))
        else:
            resolution = checked_vector(resolution, n, "resolution", positive=True)
            r = checked_vector(gear_ratio, n, "gear_ratio", positive=True)
            self._increment = 2 * np.pi / (resolution * r)

            def count(_x, state):
                return [
                    sym.floor(q / step) * step
                    for q, step in zip(state[:n], self._increment, strict=True)
                ]

            first = add("count", SymbolicLaw(inputs={"state": 2 * n}, output="q", law=count))
            self._now = add("now", ZeroOrderHold(period, n))
            # Updated at the same instants as `now`, it sees what `now` held until then.
            self._before = add("before", ZeroOrderHold(period, n))
            samples = add("samples", Multiplexer([n, n]))
            one, zero = np.eye(n), np.zeros((n, n))
            difference = np.block([[one, zero], [one / period, -one / period]])
            last = add("difference", MatrixGain(difference))
            connect(first.get_output_port(), self._now.get_input_port())
            connect(self._now.get_output_port(), self._before.get_input_port())
            connect(self._now.get_output_port(), samples.get_input_port(0))
            connect(self._before.get_output_port(), samples.get_input_port(1))
            connect(samples.get_output_port(), last.get_input_port())
        builder.ExportInput(first.get_input_port(), "state")
        builder.ExportOutput(last.get_output_port(), "measured")
        builder.BuildInto(self)

    def rest(self, context: Context, q: ArrayLike, v: ArrayLike) -> None:
        """Start with samples taken at q [rad], moving with v [rad/s] for long; joint side."""
        q, v = np.asarray(q), np.asarray(v)
        now = self.GetMutableSubsystemContext(self._now, context)
        if self._increment is None:
            now.SetDiscreteState(np.concatenate([q, v]))
            return
        count = np.floor(q / self._increment) * self._increment
        now.SetDiscreteState(count)
        before = self.GetMutableSubsystemContext(self._before, context)
        before.SetDiscreteState(count - self._period * v)
