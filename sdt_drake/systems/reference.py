"""The reference, and tables along it. State: the sample that a table holds."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from pydrake.math import BsplineBasis
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import TrajectorySource, ZeroOrderHold
from pydrake.trajectories import BsplineTrajectory

from sdt_drake.errors import InputError, checked_count, checked_number
from sdt_drake.motion import Motion

Array = NDArray[np.float64]


class ReferenceSource(Diagram):
    """The reference of the planner, [q_ref, v_ref, vd_ref], over continuous time; joint side.

    Exact at the samples t = i * period; between them linear in all three. It does not hold: only
    the zero-order hold behind it makes the steps that the controller sees.

    .. pydrake_system::

        name: ReferenceSource
        output_ports:
        - reference
    """

    symbol = "planner"

    def __init__(self, *, motion: Motion, delay: float = 0.0) -> None:
        """Of `motion`; with a `delay` [s] it rests on the first sample for that long.

        Raises:
            InputError: for a delay that is not finite and >= 0.
        """
        super().__init__()
        samples = np.hstack([motion.q, motion.v, motion.vd])
        builder = DiagramBuilder()
        source = builder.AddNamedSystem("samples", _table(motion, samples, delay, "reference"))
        builder.ExportOutput(source.get_output_port(), "reference")
        builder.BuildInto(self)


class SignalTable(Diagram):
    """Signals along a motion, computed before the run: each sample is held from its instant on.

    It needs no input, and no Python while the simulation runs; it knows nothing of any other
    motion.

    .. pydrake_system::

        name: SignalTable
        output_ports:
        - (signals)
    """

    symbol = "table"

    def __init__(self, *, motion: Motion, signals: Mapping[str, Array], delay: float = 0.0) -> None:
        """By name, samples of shape (N + 1, n) at the times of `motion`, late by `delay` [s].

        Raises:
            InputError: for a delay that is not finite and >= 0, or another number of samples.
        """
        super().__init__()
        builder = DiagramBuilder()
        for name, samples in signals.items():
            source = builder.AddNamedSystem(name, _table(motion, samples, delay, name))
            hold = builder.AddNamedSystem(
                f"{name}_hold", hold_of(motion, samples.shape[1], delay=delay)
            )
            builder.Connect(source.get_output_port(), hold.get_input_port())
            builder.ExportOutput(hold.get_output_port(), name)
        builder.BuildInto(self)


def hold_of(motion: Motion, size: int, *, delay: float = 0.0) -> ZeroOrderHold:
    """Drake's hold at the instants at which samples of `motion` arrive, late by `delay` [s].

    It does not delay by itself: a sample is in force from its own instant on. (A log sees the
    values from before the update at its instant.)

    Raises:
        InputError: for a size that is not > 0, or a delay that is not finite and >= 0.
    """
    checked_count(size, "size")
    checked_number(delay, "delay", minimum=0)
    period = motion.period
    late = delay % period
    exact = min(late, period - late) < 1e-9 * period
    return ZeroOrderHold(period, size, 0.0 if exact else late)


def _table(motion: Motion, samples: Array, delay: float, name: str) -> TrajectorySource:
    checked_number(delay, "delay", minimum=0)
    if samples.ndim != 2 or len(samples) != len(motion.q):
        raise InputError(
            f"signal '{name}': samples of shape {samples.shape}, expected ({len(motion.q)}, n)"
        )
    time = motion.time + delay
    # Linear, although only the samples matter: a piecewise constant trajectory, sampled exactly
    # at its breaks, may return the segment before. As a B-spline of order 2 it is there in a
    # twentieth of the time that PiecewisePolynomial.FirstOrderHold takes.
    knots = np.concatenate([time[:1], time, time[-1:]])
    return TrajectorySource(BsplineTrajectory(BsplineBasis(2, knots), samples[:, :, np.newaxis]))
