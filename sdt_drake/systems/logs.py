"""Logging: signals at a fixed period. A log has its samples as state of its own."""

from __future__ import annotations

from collections.abc import Sequence

from pydrake.systems.primitives import LogVectorOutput, VectorLogSink

from sdt_drake.systems.wiring import Wiring


def add_logs(wiring: Wiring, signals: Sequence[str], period: float) -> dict[str, VectorLogSink]:
    """Log each signal every `period` [s]: sinks by its names, one for each port.

    A log at an instant sees the values from before the updates at that instant: continuous
    signals at t, held ones and what follows from them at t-.
    """
    sinks: dict[str, VectorLogSink] = {}
    for name in signals:
        same = next((s for s in sinks if wiring[s] is wiring[name]), None)
        if same is None:
            sinks[name] = LogVectorOutput(wiring[name], wiring.builder, publish_period=period)
            sinks[name].set_name(f"log.{name}")
        else:
            sinks[name] = sinks[same]
    return sinks
