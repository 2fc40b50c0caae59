"""Reference source, zero-order hold, and tables. Sources hold no state; a hold has its sample."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.systems.primitives import ConstantVectorSource, TrajectorySource, ZeroOrderHold
from pydrake.trajectories import PiecewisePolynomial

from sdt_drake.dynamics import Loads
from sdt_drake.errors import InputError, checked_count, checked_number
from sdt_drake.motion import Motion
from sdt_drake.systems.block import Block

Array = NDArray[np.float64]


def reference_source_block(block: Block, *, motion: Motion) -> None:
    """The reference of the planner, [q_ref, v_ref, vd_ref] of length 3n, over continuous time.

    Exact at the samples t = i * period; between them linear in all three. It does not hold: only
    the zero-order hold behind it makes the steps that the controller sees.

    .. pydrake_system::

        name: reference_source
        output_ports:
        - reference
    """
    source = block.add(_table(motion.time, np.hstack([motion.q, motion.v, motion.vd])))
    block.outputs["reference"] = source.get_output_port()


def zero_order_hold_block(block: Block, *, size: int, period: float) -> None:
    """Samples the reference every `period` [s], first at time 0, and holds it.

    It does not delay: a sample is in force from its own instant on. (A log sees the values from
    before the update at its instant.)

    .. pydrake_system::

        name: zero_order_hold
        input_ports:
        - reference
        output_ports:
        - reference
    """
    checked_number(period, "period", minimum=0, exclusive=True)
    hold = block.add(ZeroOrderHold(period, checked_count(size, "size")))
    block.inputs["reference"] = hold.get_input_port()
    block.outputs["reference"] = hold.get_output_port()


def load_torque_table_block(block: Block, *, motion: Motion, loads: Loads) -> None:
    """The torques that `LoadTorque` gives along `motion`, from a table made beforehand.

    Each sample is in force from its own instant on, as with the reference. It needs no input, and
    no Python while the simulation runs; it knows nothing of any other motion.

    .. pydrake_system::

        name: load_torque_table
        output_ports:
        - load_torque
        - alleviating_torque

    Raises:
        InputError: if the loads are not those of the motion.
    """
    for signal, samples in loads._asdict().items():
        if samples.shape != motion.v.shape:
            raise InputError(f"{signal}: shape {samples.shape}, the motion has {motion.v.shape}")
        source = block.add(_table(motion.time, samples), f"{signal}_samples")
        hold = block.add(ZeroOrderHold(motion.period, motion.n), f"{signal}_hold")
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


def _table(time: Array, samples: Array) -> TrajectorySource:
    # Linear, although only the samples matter: a piecewise constant trajectory, sampled exactly
    # at its breaks, may return the segment before.
    return TrajectorySource(PiecewisePolynomial.FirstOrderHold(time, samples.T))
