"""Wiring by name: a signal has one name, and goes to every input of that name."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar, cast

from pydrake.systems.framework import (
    Context,
    Diagram,
    DiagramBuilder,
    InputPort,
    OutputPort,
    System,
)
from pydrake.systems.primitives import LogVectorOutput, VectorLogSink

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError

SystemT = TypeVar("SystemT", bound=System)


class Wired(Diagram):
    """A Diagram of blocks that are connected by the names of their signals: add them, then build.

    Inputs that no signal has are those of the diagram.
    """

    def __init__(self) -> None:
        super().__init__()
        self._builder = DiagramBuilder()
        self._signals: dict[str, OutputPort] = {}
        self._same: dict[str, str] = {}
        self._inputs: list[tuple[str, InputPort]] = []

    def add(self, name: str, block: SystemT, *signals: str, **renamed: str) -> SystemT:
        """Add a block, and return it.

        Args:
            name: of the block.
            block: a system with vector ports.
            signals: those of all its ports, inputs first; by default a port has the name of its
                signal,
            renamed: but for these.
        """
        self._builder.AddNamedSystem(name, block)
        inputs = [block.get_input_port(i) for i in range(block.num_input_ports())]
        outputs = [block.get_output_port(i) for i in range(block.num_output_ports())]
        own = [port.get_name() for port in inputs] + [port.get_name() for port in outputs]
        names = iter(signals or [renamed.get(port, port) for port in own])
        self._inputs += [(next(names), port) for port in inputs]
        self._signals |= {next(names): port for port in outputs}
        return block

    def same(self, name: str, other: str) -> None:
        """Another name of a signal, where no block stands between the two."""
        self._same[name] = other

    def _name(self, name: str) -> str:
        while name in self._same:
            name = self._same[name]
        return name

    def log(self, signals: Sequence[str], period: float) -> dict[str, VectorLogSink]:
        """Log each signal every `period` [s]: sinks by its names, one for each port.

        A log at an instant sees the values from before the updates at that instant: continuous
        signals at t, held ones and what follows from them at t-.
        """
        of_ports: dict[str, VectorLogSink] = {}  # each costs time at every instant of the log
        for name, own in ((name, self._name(name)) for name in signals):
            if own not in of_ports:
                port = self._signals[own]
                of_ports[own] = LogVectorOutput(port, self._builder, publish_period=period)
                of_ports[own].set_name(f"log.{name}")
        return {name: of_ports[self._name(name)] for name in signals}

    def build(self, *outputs: str) -> None:
        """Connect everything, once; the signals that are outputs of the diagram.

        Raises:
            InputError: for an input that its signal does not fit in length.
        """
        exported = set[str]()
        for name, port in ((self._name(name), port) for name, port in self._inputs):
            if name in self._signals:
                _check_length(port, self._signals[name])
                self._builder.Connect(self._signals[name], port)
            elif name in exported:
                self._builder.ConnectInput(name, port)
            else:
                self._builder.ExportInput(port, name)
                exported.add(name)
        for name in outputs:
            self._builder.ExportOutput(self._signals[self._name(name)], name)
        self._builder.BuildInto(self)

    def set_state(self, context: Context, block: System, state: Array) -> None:
        """Set all of the state, continuous or discrete, of a block within, however deep; `context`
        is that of this diagram."""
        own = self.GetMutableSubsystemContext(block, context)
        if own.num_continuous_states():
            own.SetContinuousState(state)
        else:
            own.SetDiscreteState(state)


def _check_length(port: InputPort, signal: OutputPort) -> None:
    if port.size() != signal.size():
        block = cast(System, port.get_system()).get_name()
        raise InputError(
            f"{block}: input '{port.get_name()}' of length {port.size()}, expected {signal.size()}"
        )
