"""Probes: outputs of any block in a loop, recorded beside the signals of a run."""

from collections.abc import Mapping, Sequence
from typing import cast

import numpy as np
from pydrake.systems.framework import Context, Diagram, OutputPort, PortDataType, System

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, Problem, suggestion
from sdt_drake.systems import UNITS


def output_ports(diagram: Diagram, prefix: str = "") -> dict[str, OutputPort]:
    """Return the vector outputs of all systems in a diagram, without logs, by their paths.

    A path has the names of nested systems and of the port, "device.friction.friction".
    """
    found = {}
    for system in diagram.GetSystems():
        if (name := system.get_name()).startswith("log."):
            continue
        for port in map(system.get_output_port, range(system.num_output_ports())):
            if port.get_data_type() == PortDataType.kVectorValued and port.size():
                found[f"{prefix}{name}.{port.get_name()}"] = port
        if isinstance(system, Diagram):
            found |= output_ports(system, f"{prefix}{name}.")
    return found


def chosen_ports(diagram: Diagram, probes: Sequence[str]) -> dict[str, OutputPort]:
    """Return the ports that probes name, by the names that were given.

    A probe is a path, or its end. Of several paths with this end the outermost one is meant.

    Raises:
        InputError: one problem for each probe that names no port, or several; with the nearest.
    """
    ports, chosen, problems = output_ports(diagram), {}, []
    for i, name in enumerate(probes):
        fitting = [path for path in ports if f".{path}".endswith(f".{name}")]
        depth = min((path.count(".") for path in fitting), default=0)
        outermost = [path for path in fitting if path.count(".") == depth]
        if len(outermost) == 1:
            chosen[name] = ports[outermost[0]]
            continue
        ends = {path.split(".", k)[-1]: path for path in ports for k in range(path.count(".") + 1)}
        near = suggestion(name, ends, "expected a port that sdt-drake diagram can list")
        several = f"one of several: {', '.join(outermost[:3])}, expected a longer path"
        text = several if outermost else f"no port of the loop, {near}"
        problems.append(Problem(f"'{name}': {text}", place=f"probes[{i + 1}]"))
    if problems:
        raise InputError(*problems)
    return chosen


def unit_of(name: str) -> str:
    """Return the unit of a probe by the name of its port, as in `UNITS`; "" if it has none."""
    return UNITS.get(name.rpartition(".")[2], "")


class Sampler:
    """A monitor of a simulator that samples outputs just before the updates at each sample.

    The first sample is just after its update.
    """

    def __init__(self, ports: Mapping[str, OutputPort], period: float, root: Context) -> None:
        """Prepare to sample ports by name, every `period` [s]; `root` is the outermost context."""
        self._period, self._rows = period, list[list[Array]]()
        self._ports = {
            name: (port, cast(System, port.get_system()).GetMyContextFromRoot(root))
            for name, port in ports.items()
        }

    def __call__(self, root: Context) -> None:
        """Sample the outputs if a sample is due at the end of a step."""
        if root.get_time() == 0:
            self._rows.clear()
        if root.get_time() >= (len(self._rows) - 1e-6) * self._period:
            self._rows.append([np.array(port.Eval(own)) for port, own in self._ports.values()])

    def samples(self) -> dict[str, Array]:
        """Return the samples by name, each of shape (N + 1, size)."""
        columns = zip(*self._rows, strict=True)
        return dict(zip(self._ports, map(np.array, columns), strict=True))
