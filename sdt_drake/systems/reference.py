"""Reference source, zero-order hold, and tables. Sources hold no state; a hold has its sample."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.math import BsplineBasis
from pydrake.systems.primitives import ConstantVectorSource, TrajectorySource, ZeroOrderHold
from pydrake.trajectories import BsplineTrajectory

from sdt_drake.errors import InputError, checked_count, checked_number
from sdt_drake.motion import Motion
from sdt_drake.systems.block import Block

Array = NDArray[np.float64]


def reference_source_block(block: Block, *, motion: Motion, delay: float = 0.0) -> None:
    """The reference of the planner, [q_ref, v_ref, vd_ref] of length 3n, over continuous time.

    Exact at the samples t = i * period; between them linear in all three. It does not hold: only
    the zero-order hold behind it makes the steps that the controller sees. With a delay [s] it
    rests on the first sample for that long.

    .. pydrake_system::

        name: reference_source
        output_ports:
        - reference
    """
    samples = np.hstack([motion.q, motion.v, motion.vd])
    source = block.add(_table(_delayed(motion.time, delay), samples))
    block.outputs["reference"] = source.get_output_port()


def zero_order_hold_block(block: Block, *, size: int, period: float, delay: float = 0.0) -> None:
    """Samples the reference every `period` [s], first at time 0, and holds it.

    Behind a delayed source it samples at the instants at which the samples arrive. It does not
    delay by itself: a sample is in force from its own instant on. (A log sees the values from
    before the update at its instant.)

    .. pydrake_system::

        name: zero_order_hold
        input_ports:
        - reference
        output_ports:
        - reference
    """
    checked_number(period, "period", minimum=0, exclusive=True)
    hold = block.add(_hold(period, checked_count(size, "size"), delay))
    block.inputs["reference"] = hold.get_input_port()
    block.outputs["reference"] = hold.get_output_port()


def table_block(
    block: Block, *, motion: Motion, signals: Mapping[str, Array], delay: float = 0.0
) -> None:
    """Signals along `motion` from tables made beforehand: load torques, feedforward, inertia.

    Each sample is in force from its own instant on, as with the reference, and as late as that with
    a delay [s]. It needs no input, and no Python while the simulation runs; it knows nothing of any
    other motion.

    .. pydrake_system::

        name: table
        output_ports:
        - (signals)

    Args:
        motion: gives the times.
        signals: by name, samples of shape (N + 1, n).
        delay: [s], >= 0.

    Raises:
        InputError: if a signal has not the shape of the motion.
    """
    for signal, samples in signals.items():
        if samples.shape != motion.v.shape:
            raise InputError(f"{signal}: shape {samples.shape}, the motion has {motion.v.shape}")
        source = block.add(_table(_delayed(motion.time, delay), samples), f"{signal}_samples")
        hold = block.add(_hold(motion.period, motion.n, delay), f"{signal}_hold")
        block.connect(source.get_output_port(), hold.get_input_port())
        block.outputs[signal] = hold.get_output_port()


def constant_block(block: Block, *, signal: str, value: ArrayLike) -> None:
    """A signal that never changes.

    .. pydrake_system::

        name: constant
        output_ports:
        - (signal)
    """
    source = block.add(ConstantVectorSource(np.asarray(value, dtype=float)))
    block.outputs[signal] = source.get_output_port()


def _delayed(time: Array, delay: float) -> Array:
    return time + checked_number(delay, "delay", minimum=0)


def _hold(period: float, size: int, delay: float) -> ZeroOrderHold:
    """Updates where the samples of a source with that delay are."""
    late = checked_number(delay, "delay", minimum=0) % period
    exact = min(late, period - late) < 1e-9 * period
    return ZeroOrderHold(period, size, 0.0 if exact else late)


def _table(time: Array, samples: Array) -> TrajectorySource:
    # Linear, although only the samples matter: a piecewise constant trajectory, sampled exactly
    # at its breaks, may return the segment before. As a B-spline of order 2 it is there in a
    # twentieth of the time that PiecewisePolynomial.FirstOrderHold takes.
    knots = np.concatenate([time[:1], time, time[-1:]])
    return TrajectorySource(BsplineTrajectory(BsplineBasis(2, knots), samples[:, :, np.newaxis]))
