"""Logging: signals at a fixed period. A log has its samples as state of its own."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import LogVectorOutput, VectorLogSink

Array = NDArray[np.float64]

_PREFIX = "log."


def add_logs(builder: DiagramBuilder, signals: Mapping[str, OutputPort], period: float) -> None:
    """Log each signal every `period` [s], under its name.

    A log at an instant sees the values from just before the updates at that instant: continuous
    signals at t, held ones and what follows from them at t-.
    """
    for name, port in signals.items():
        sink = LogVectorOutput(port, builder, publish_period=period)
        sink.set_name(_PREFIX + name)


def read_logs(diagram: Diagram, context: Context) -> tuple[Array, dict[str, Array]]:
    """Times of the first log [s], shape (N,), and each logged signal by name, (its N, size)."""
    sinks = [s for s in diagram.GetSystems() if isinstance(s, VectorLogSink)]
    logs = {sink.get_name().removeprefix(_PREFIX): sink.FindLog(context) for sink in sinks}
    time = next(iter(logs.values())).sample_times()
    return np.array(time), {name: np.array(log.data().T) for name, log in logs.items()}
