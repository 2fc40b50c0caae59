"""Reference source and zero-order hold. Sources hold no state; a hold has its sample."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import TrajectorySource, ZeroOrderHold
from pydrake.trajectories import PiecewisePolynomial

from sdt_drake.motion import Motion
from sdt_drake.systems.composite import composite

Array = NDArray[np.float64]


def make_reference_source(motion: Motion) -> Diagram:
    """The reference of the planner, as signals of continuous time.

    Exact at the samples t = i * period; between them linear in q_ref, v_ref and vd_ref alike. It
    does not hold: only the zero-order hold behind it makes the steps that the controller sees.

    .. pydrake_system::

        name: reference_source
        output_ports:
        - q_ref
        - v_ref
        - vd_ref
    """
    builder = DiagramBuilder()
    outputs = {
        name: builder.AddNamedSystem(name, _table(motion.time, samples)).get_output_port()
        for name, samples in (("q_ref", motion.q), ("v_ref", motion.v), ("vd_ref", motion.vd))
    }
    return composite("reference_source", builder, inputs={}, outputs=outputs)


def make_zero_order_hold(period: float, sizes: Mapping[str, int]) -> Diagram:
    """Samples each signal every `period` [s], first at time 0, and holds it.

    All holds update at the same instants. It does not delay: a sample is in force from its own
    instant on. (A log sees the values from before the update at its instant.)

    .. pydrake_system::

        name: zero_order_hold
        input_ports:
        - (each name in sizes)
        output_ports:
        - (each name in sizes)

    Args:
        period: > 0 [s].
        sizes: names of the signals and their lengths.
    """
    builder = DiagramBuilder()
    holds = {
        name: builder.AddNamedSystem(name, ZeroOrderHold(period, size))
        for name, size in sizes.items()
    }
    return composite(
        "zero_order_hold",
        builder,
        inputs={name: hold.get_input_port() for name, hold in holds.items()},
        outputs={name: hold.get_output_port() for name, hold in holds.items()},
    )


def make_held_table(name: str, motion: Motion, signals: Mapping[str, Array]) -> Diagram:
    """Signals computed beforehand along a motion, shape (N + 1, n) each, sampled and held.

    .. pydrake_system::

        name: (name)
        output_ports:
        - (each name in signals)
    """
    builder = DiagramBuilder()
    outputs = {}
    for signal, samples in signals.items():
        source = builder.AddNamedSystem(f"{signal}_table", _table(motion.time, samples))
        hold = builder.AddNamedSystem(signal, ZeroOrderHold(motion.period, samples.shape[1]))
        builder.Connect(source.get_output_port(), hold.get_input_port())
        outputs[signal] = hold.get_output_port()
    return composite(name, builder, inputs={}, outputs=outputs)


def _table(time: Array, samples: Array) -> TrajectorySource:
    # Linear, although only the samples matter: a piecewise constant trajectory, sampled exactly
    # at its breaks, may return the segment before.
    return TrajectorySource(PiecewisePolynomial.FirstOrderHold(time, samples.T))
