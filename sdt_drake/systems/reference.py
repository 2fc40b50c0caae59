"""The reference, and tables along it. State: the sample that a table holds."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from pydrake.math import BsplineBasis
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import TrajectorySource, ZeroOrderHold
from pydrake.trajectories import BsplineTrajectory

from sdt_drake.io.arrays import Array
from sdt_drake.motion import Motion


class ReferenceSource(Diagram):
    """The reference of the planner, [q_ref, v_ref, vd_ref], over continuous time; joint side.

    Exact at the samples t = i * period; between them linear in all three. It does not hold: only
    the zero-order hold behind it makes the steps that the controller sees.

    .. pydrake_system::

        name: ReferenceSource
        output_ports: [reference]
    """

    def __init__(self, *, motion: Motion, delay: float = 0.0) -> None:
        """Of `motion`; with a `delay` [s] it rests on the first sample for that long."""
        super().__init__()
        samples = np.hstack([motion.q, motion.v, motion.vd])
        builder = DiagramBuilder()
        source = sample_source(motion.time + delay, samples)
        builder.AddNamedSystem("samples", source)
        builder.ExportOutput(source.get_output_port(), "reference")
        builder.BuildInto(self)


class SignalTable(Diagram):
    """Signals along a motion, computed before the run: each sample is held from its instant on.

    It needs no input, and no Python while the simulation runs; it knows nothing of any other
    motion.

    .. pydrake_system::

        name: SignalTable
        output_ports: [(signals)]
    """

    def __init__(self, *, motion: Motion, signals: Mapping[str, Array], delay: float = 0.0) -> None:
        """By name, samples of shape (N + 1, n) at the times of `motion`, late by `delay` [s]."""
        super().__init__()
        builder = DiagramBuilder()
        self._holds: list[tuple[ZeroOrderHold, Array]] = []
        for name, samples in signals.items():
            hold = hold_of(motion, samples.shape[1], delay=delay)
            source = builder.AddNamedSystem(name, sample_source(motion.time + delay, samples))
            builder.AddNamedSystem(f"{name}_hold", hold)
            builder.Connect(source.get_output_port(), hold.get_input_port())
            builder.ExportOutput(hold.get_output_port(), name)
            self._holds.append((hold, samples[0]))
        builder.BuildInto(self)

    def rest(self, context: Context) -> None:
        """Start with the first samples."""
        for hold, first in self._holds:
            hold.SetVectorState(self.GetMutableSubsystemContext(hold, context), first)


def hold_of(motion: Motion, size: int, *, delay: float = 0.0) -> ZeroOrderHold:
    """Drake's hold at the instants at which samples of `motion` arrive, late by `delay` [s].

    It does not delay by itself: a sample is in force from its own instant on. (A log sees the
    values from before the update at its instant.)
    """
    period = motion.period
    late = delay % period
    exact = min(late, period - late) < 1e-9 * period
    return ZeroOrderHold(period, size, 0.0 if exact else late)


def sample_source(time: Array, samples: Array) -> TrajectorySource:
    """Samples of shape (N, size) at `time` [s], linear in between."""
    # Linear, although often only the samples matter: a piecewise constant trajectory, sampled
    # exactly at its breaks, may return the segment before. As a B-spline of order 2 it is there in
    # a twentieth of the time that PiecewisePolynomial.FirstOrderHold takes.
    basis = BsplineBasis(2, [time[0], *time, time[-1]])
    return TrajectorySource(BsplineTrajectory(basis, list(samples[:, :, np.newaxis])))
