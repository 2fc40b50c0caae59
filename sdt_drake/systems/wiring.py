"""Wiring by name: a signal has one name, and goes to every input of that name."""

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
"""Names of signals, by the names of a system and of its port."""


def connect_by_name(
    builder: DiagramBuilder, aliases: Aliases | None = None
) -> dict[str, OutputPort]:
    """Connect every free input to the output of its name; one without becomes that of the diagram.

    Args:
        builder: with all systems, each named.
        aliases: signals of the ports, inputs or outputs, whose own name is another.

    Returns:
        The outputs by the names of their signals.

    Raises:
        InputError: for two outputs of one name, or an input that its signal does not fit in length.
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
                    f"signal '{name}': an output of {owners[name]} and of {block}, expected one"
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
    """Log each signal every `period` [s], or at the ends of the integrator's steps if it is None:
    sinks by the names of signals, one for each port.

    A log at an instant sees the values from before the updates at that instant: continuous
    signals at t, held ones and what follows from them at t-.
    """
    sinks: dict[OutputPort, VectorLogSink] = {}  # each costs time at every instant of the log
    for name, port in signals.items():
        if port not in sinks:
            when = TriggerType.kPerStep if period is None else TriggerType.kPeriodic
            sinks[port] = LogVectorOutput(port, builder, {when}, period or 0.0)
            sinks[port].set_name(f"log.{name}")
    return {name: sinks[port] for name, port in signals.items()}


def systems_in(system: System) -> Iterator[System]:
    """The system itself and, if it is a diagram, all systems in it, however deep."""
    yield system
    if isinstance(system, Diagram):
        for inner in system.GetSystems():
            yield from systems_in(inner)


def blocks_of(system: System) -> list[System]:
    """The systems that a loop or another system consists of in the end, without logs."""
    inner = [s for s in systems_in(system) if not isinstance(s, Diagram)]
    return [s for s in inner if not s.get_name().startswith("log.")]


def _check_length(block: str, port: InputPort, signal: OutputPort) -> None:
    if port.size() != signal.size():
        raise InputError(
            f"{block}: input '{port.get_name()}' of length {port.size()}, expected {signal.size()}"
        )
