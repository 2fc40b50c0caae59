"""Wiring by name: an output is connected to every input of the same name."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from pydrake.systems.framework import (
    Diagram,
    DiagramBuilder,
    InputPort,
    OutputPort,
    System,
    TriggerType,
)
from pydrake.systems.primitives import LogVectorOutput, VectorLogSink

from sdt_drake.io.errors import InputError

Aliases = Mapping[tuple[str, str], str]
"""Names of signals by (system, port), for ports of another name than their signal."""


def connect_by_name(
    builder: DiagramBuilder, aliases: Aliases | None = None
) -> dict[str, OutputPort]:
    """Connect every free input to the output of its name; export inputs without one.

    Args:
        builder: builder with all systems, each named.
        aliases: names of signals that differ from the name of their port, by (system, port).

    Returns:
        Outputs by the names of their signals.

    Raises:
        InputError: if two outputs have one name, or an input another length than its signal.

    >>> from pydrake.systems.primitives import Adder, Gain
    >>> builder = DiagramBuilder()
    >>> double = builder.AddNamedSystem("double", Gain(2.0, 1))
    >>> total = builder.AddNamedSystem("total", Adder(2, 1))
    >>> aliases = {("double", "u0"): "x", ("total", "u0"): "x", ("total", "u1"): "y0"}
    >>> signals = connect_by_name(builder, aliases)
    >>> list(signals), builder.Build().num_input_ports()
    (['y0', 'sum'], 1)
    """
    aliases = aliases or {}
    owners: dict[str, str] = {}
    outputs: dict[str, OutputPort] = {}
    for system in builder.GetSystems():
        block = system.get_name()
        for output in map(system.get_output_port, range(system.num_output_ports())):
            name = aliases.get((block, output.get_name()), output.get_name())
            if name in outputs:
                raise InputError(
                    f"signal '{name}': output of {owners[name]} and of {block}, expected only one"
                )
            outputs[name], owners[name] = output, block
    exported = set[str]()
    for system in builder.GetSystems():
        block = system.get_name()
        for port in map(system.get_input_port, range(system.num_input_ports())):
            name = aliases.get((block, port.get_name()), port.get_name())
            if builder.IsConnectedOrExported(port):
                continue
            if name in outputs:
                _check_length(block, port, outputs[name])
                builder.Connect(outputs[name], port)
            elif name in exported:
                builder.ConnectInput(name, port)
            else:
                builder.ExportInput(port, name)
                exported.add(name)
    return outputs


def add_logs(
    builder: DiagramBuilder, signals: Mapping[str, OutputPort], period: float | None
) -> dict[str, VectorLogSink]:
    """Add logs and return their sinks by the names of the signals, one sink for each port.

    A log contains the values before the updates at its instant: continuous signals at t, held
    signals and their consequences at t-.

    Args:
        builder: builder of the diagram.
        signals: outputs by name.
        period: period of the log [s]; None logs at the integrator's steps.
    """
    sinks: dict[OutputPort, VectorLogSink] = {}  # one per port, as each sink costs time
    for name, port in signals.items():
        if port not in sinks:
            when = TriggerType.kPerStep if period is None else TriggerType.kPeriodic
            sinks[port] = LogVectorOutput(port, builder, {when}, period or 0.0)
            sinks[port].set_name(f"log.{name}")
    return {name: sinks[port] for name, port in signals.items()}


def systems_in(system: System) -> Iterator[System]:
    """Yield a system and, if it is a diagram, all nested systems."""
    yield system
    if isinstance(system, Diagram):
        for inner in system.GetSystems():
            yield from systems_in(inner)


def blocks_of(system: System) -> list[System]:
    """Return the innermost systems of a system, without logs."""
    inner = [s for s in systems_in(system) if not isinstance(s, Diagram)]
    return [s for s in inner if not s.get_name().startswith("log.")]


def _check_length(block: str, port: InputPort, signal: OutputPort) -> None:
    """Raise InputError if an input and its signal differ in length."""
    if port.size() != signal.size():
        raise InputError(
            f"{block}: input '{port.get_name()}' has length {port.size()}, expected {signal.size()}"
        )
