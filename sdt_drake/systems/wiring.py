"""Parts of diagrams: their names, states and logs."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import (
    Context,
    Diagram,
    DiagramBuilder,
    OutputPort,
    System,
    TriggerType,
)
from pydrake.systems.primitives import LogVectorOutput, Multiplexer, VectorLogSink


def build(builder: DiagramBuilder, name: str) -> Diagram:
    """Build a diagram and name it.

    Diagrams are made by functions: pydrake never frees one of a class derived in Python.
    """
    diagram = builder.Build()
    diagram.set_name(name)
    return diagram


def block_of(
    name: str, system: System, inputs: Mapping[str, int], output: str, inner: str = "law"
) -> Diagram:
    """Make a block of one system, whose input is all the inputs in a row.

    Args:
        name: name of the block.
        system: the system.
        inputs: lengths of the inputs by name.
        output: name of the output.
        inner: name of the system in the block.
    """
    builder, first = DiagramBuilder(), system
    if len(inputs) > 1:
        first = builder.AddNamedSystem("inputs", Multiplexer(list(inputs.values())))
    builder.AddNamedSystem(inner, system)
    if first is not system:
        builder.Connect(first.get_output_port(), system.get_input_port())
    for index, port in enumerate(inputs):
        builder.ExportInput(first.get_input_port(index), port)
    builder.ExportOutput(system.get_output_port(), output)
    return build(builder, name)


def nested(system: System, context: Context, path: str) -> tuple[Any, Context]:
    """Return a nested system with its own context.

    Args:
        system: the outer system.
        context: its context.
        path: names of nested systems, from the outside in, such as "lag" or "device/friction".
    """
    for name in path.split("/"):
        assert isinstance(system, Diagram)
        inner = system.GetSubsystemByName(name)
        context, system = system.GetMutableSubsystemContext(inner, context), inner
    return system, context


def set_state(system: System, context: Context, path: str, state: ArrayLike) -> None:
    """Set the state of a nested system, continuous or discrete.

    Args:
        system: the outer system.
        context: its context.
        path: names of nested systems, as for `nested`.
        state: the state of that system.

    >>> from pydrake.systems.primitives import Integrator
    >>> builder = DiagramBuilder()
    >>> _ = builder.AddNamedSystem("position", Integrator(2))
    >>> diagram = build(builder, "axes")
    >>> context = diagram.CreateDefaultContext()
    >>> set_state(diagram, context, "position", [1, 2])
    >>> context.get_continuous_state_vector().CopyToVector()
    array([1., 2.])
    """
    _, context = nested(system, context, path)
    if context.num_continuous_states():
        context.SetContinuousState(np.asarray(state, dtype=float))
    else:
        context.SetDiscreteState(np.asarray(state, dtype=float))


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
