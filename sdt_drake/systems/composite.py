"""A few connected systems as one block with named ports."""

from __future__ import annotations

from collections.abc import Mapping

from pydrake.systems.framework import Diagram, DiagramBuilder, InputPort, OutputPort


def composite(
    name: str,
    builder: DiagramBuilder,
    *,
    inputs: Mapping[str, InputPort],
    outputs: Mapping[str, OutputPort],
) -> Diagram:
    """What `builder` holds, as a diagram called `name` with these ports, in this order."""
    for port_name, input_port in inputs.items():
        builder.ExportInput(input_port, port_name)
    for port_name, output_port in outputs.items():
        builder.ExportOutput(output_port, port_name)
    diagram = builder.Build()
    diagram.set_name(name)
    return diagram
