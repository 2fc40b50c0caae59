from __future__ import annotations

import numpy as np
import pydrake.symbolic as sym
from numpy.typing import ArrayLike
from pydrake.systems.framework import Context
from pydrake.systems.primitives import MatrixGain, Multiplexer, ZeroOrderHold

from sdt_drake.io.errors import InputError, checked_count, checked_number, checked_positive
from sdt_drake.systems.symbolic import SymbolicLaw, Symbols
from sdt_drake.systems.wiring import Wired


class Encoder(Wired):
    """Samples the state every `period` [s], first at time 0, and holds it: [q, v], joint side.

    With a resolution, the positions are those of an incremental encoder on the motor's shaft, and
    the speeds their differences, which lag by half a period:

        q_k = floor(q N r / (2 pi)) 2 pi / (N r),    v_k = (q_k - q_(k-1)) / period

    State: the last sample, or the last two. It does not delay: a sample is in force from its own
    instant on.

    Args:
        n: number of joints.
        period: [s], > 0.
        resolution: N, increments per revolution of the motor [-], shape (n,); ideal by default.
        gear_ratio: r [-], shape (n,); needed with a resolution.

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
