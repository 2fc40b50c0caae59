"""Sources along a motion: the reference, and tables of signals."""

from collections.abc import Mapping

import numpy as np
from pydrake.math import BsplineBasis
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, System
from pydrake.systems.primitives import TrajectorySource, ZeroOrderHold
from pydrake.trajectories import BsplineTrajectory

from sdt_drake.io.arrays import Array
from sdt_drake.motion import Motion
from sdt_drake.systems.wiring import block_of, build


def reference_source(*, motion: Motion, delay: float = 0.0) -> Diagram:
    """Make the reference [q_ref, v_ref, vd_ref] over continuous time, joint side.

    It is exact at the samples t = i * period, and linear between them. The steps in front of the
    controller come from a zero-order hold behind this block.

    Args:
        motion: motion that the controller tracks.
        delay: delay of the samples [s]; until then the first sample.

    .. pydrake_system::

        name: reference_source
        output_ports: [reference]
    """
    samples = np.hstack([motion.q, motion.v, motion.vd])
    source = sample_source(motion.time + delay, samples)
    return block_of("reference_source", source, {}, "reference", "samples")


def signal_table(*, motion: Motion, signals: Mapping[str, Array], delay: float = 0.0) -> Diagram:
    """Make a table of signals along a motion, computed before the run.

    Each sample is held from its own instant on. There are no inputs, and no Python is called during
    the simulation. State: the held samples.

    Args:
        motion: motion of the signals.
        signals: samples by the name of the signal, shape (N + 1, n), at the times of `motion`.
        delay: delay of the samples [s]; until then the first ones.

    .. pydrake_system::

        name: signal_table
        output_ports: [(signals)]
    """
    builder = DiagramBuilder()
    for name, samples in signals.items():
        source = builder.AddNamedSystem(name, sample_source(motion.time + delay, samples))
        hold = hold_of(motion, samples.shape[1], delay=delay)
        builder.AddNamedSystem(f"{name}_hold", hold)
        builder.Connect(source.get_output_port(), hold.get_input_port())
        builder.ExportOutput(hold.get_output_port(), name)
    return build(builder, "signal_table")


def start_table(table: System, context: Context) -> None:
    """Set the holds of a `signal_table` to the samples at the context's time."""
    assert isinstance(table, Diagram)
    for hold in table.GetSystems():
        if isinstance(hold, ZeroOrderHold):
            start_hold(hold, table.GetMutableSubsystemContext(hold, context))


def start_hold(hold: ZeroOrderHold, context: Context) -> None:
    """Set a zero-order hold to its input at the context's time."""
    hold.SetVectorState(context, np.array(hold.get_input_port().Eval(context)))


def hold_of(motion: Motion, size: int, *, delay: float = 0.0) -> ZeroOrderHold:
    """Return a zero-order hold of Drake at the samples of `motion`, delayed by `delay` [s].

    The hold itself does not delay: a sample is valid from its own instant on. A log contains the
    values before the update at its instant.
    """
    return ZeroOrderHold(motion.period, size, arrival(delay, motion.period))


def arrival(delay: float, period: float) -> float:
    """Return the time within a period at which samples with a delay arrive, 0 <= t < period [s].

    Blocks with this offset and the same period update at the same instants, to the last bit.
    """
    late = delay % period
    is_on_time = min(late, period - late) < 1e-6 * period
    return 0.0 if is_on_time else late


def sample_source(time: Array, samples: Array) -> TrajectorySource:
    """Return a source of samples (N, size) at `time` [s], linear between them."""
    # Linear: a piecewise constant trajectory may return the segment before a break. A B-spline of
    # order 2 is made in a twentieth of the time of PiecewisePolynomial.FirstOrderHold.
    basis = BsplineBasis(2, [time[0], *time, time[-1]])
    return TrajectorySource(BsplineTrajectory(basis, list(samples[:, :, np.newaxis])))
