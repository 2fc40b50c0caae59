"""Wiring by name: a signal has one name, and goes to every input of that name."""

from __future__ import annotations

from pydrake.systems.framework import Diagram, DiagramBuilder, InputPort, OutputPort, System

from sdt_drake.errors import InputError


class Wiring:
    """A DiagramBuilder whose blocks are connected by the names of the signals.

    Attributes:
        builder: Drake's, for whatever else there is to add.
    """

    def __init__(self) -> None:
        self.builder = DiagramBuilder()
        self._signals: dict[str, OutputPort] = {}
        self._same: dict[str, str] = {}
        self._inputs: list[tuple[str, InputPort]] = []

    def add(self, name: str, block: System, **signals: str) -> None:
        """Add a block. Its ports have the names of their signals, but for those in `signals`."""
        self.builder.AddNamedSystem(name, block)
        for port in map(block.get_input_port, range(block.num_input_ports())):
            self._inputs.append((signals.get(port.get_name(), port.get_name()), port))
        for port in map(block.get_output_port, range(block.num_output_ports())):
            self._signals[signals.get(port.get_name(), port.get_name())] = port

    def same(self, name: str, other: str) -> None:
        """Another name of a signal, where no block stands between the two."""
        self._same[name] = other

    def __getitem__(self, name: str) -> OutputPort:
        """The port of a signal.

        Raises:
            InputError: if no block gives it.
        """
        if self._name(name) not in self._signals:
            raise InputError(f"no block has an output '{name}', expected one")
        return self._signals[self._name(name)]

    def _name(self, name: str) -> str:
        while name in self._same:
            name = self._same[name]
        return name

    def build_into(
        self, diagram: Diagram, inputs: tuple[str, ...], outputs: tuple[str, ...]
    ) -> None:
        """Connect everything. The diagram has those of `inputs` that a block needs, and `outputs`.

        Raises:
            InputError: for an input that no signal fits, by name or by length.
        """
        fed = set[str]()
        for name, port in ((self._name(name), port) for name, port in self._inputs):
            block = port.get_system().get_name()
            if name in self._signals:
                signal = self._signals[name]
                if port.size() != signal.size():
                    raise InputError(
                        f"{block}: input '{port.get_name()}' of length {port.size()}, expected "
                        f"{signal.size()}"
                    )
                self.builder.Connect(signal, port)
            elif name in fed:
                self.builder.ConnectInput(name, port)
            elif name in inputs:
                self.builder.ExportInput(port, name)
                fed.add(name)
            else:
                raise InputError(
                    f"{block}: an input '{name}', expected one of "
                    f"{', '.join(sorted({*self._signals, *inputs}))}"
                )
        for name in outputs:
            self.builder.ExportOutput(self[name], name)
        self.builder.BuildInto(diagram)
