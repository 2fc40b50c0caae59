"""Checks of controllers, external references and prescribed motion before a loop is made."""

from __future__ import annotations

from typing import cast

from pydrake.systems.framework import DiagramBuilder, System

from sdt_drake.io.arguments import finite
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, checked_type
from sdt_drake.run.controllers import in_errors
from sdt_drake.run.controllers.base import LOOP_SIGNALS
from sdt_drake.run.design import Design
from sdt_drake.systems import SignalTable
from sdt_drake.systems.wiring import systems_in


def checked_controller(design: Design, controller: System) -> System:
    """Return a controller after a check of its ports."""
    checked_type(controller, System, "controller", "calling its class")
    where, n = in_errors(design, type(controller)), design.robot.n
    ports = map(controller.get_output_port, range(controller.num_output_ports()))
    outputs = {port.get_name(): port.size() for port in ports}
    if outputs != {"tau_cmd": n}:
        found = ", ".join(f"{name} of length {size}" for name, size in outputs.items())
        raise InputError(
            f"{where}: outputs: {found or 'none'}, expected tau_cmd of length {n} alone"
        )
    inputs = map(controller.get_input_port, range(controller.num_input_ports()))
    for name in (port.get_name() for port in inputs):
        if name not in LOOP_SIGNALS:
            raise InputError(
                f"{where}: an input '{name}', expected one of {', '.join(LOOP_SIGNALS)}"
            )
        port = int(controller.GetInputPort(name).get_index())
        if name == "tau_limited" and controller.HasDirectFeedthrough(port, 0):
            raise InputError(
                f"{where}: tau_cmd depends on tau_limited at once, and tau_limited on tau_cmd, an "
                "algebraic loop; expected prerequisites_of_calc of tau_cmd without tau_limited"
            )
    return controller


def check_no_tables(design: Design, builder: DiagramBuilder) -> None:
    """Check that no block needs a table along the planned motion."""
    if design.scenario.plant.kind == "axis":
        raise InputError(
            "'external', but the load of the axis plant is computed along the planned motion; "
            "expected plant.kind coupled",
            place="reference",
        )
    for block in builder.GetSystems():
        for table in systems_in(block):
            if isinstance(table, SignalTable):
                raise InputError(
                    f"'external', but {table.get_name()} is computed along the planned motion; "
                    "expected inverse_dynamics online, and a controller without a schedule or a "
                    "learned torque",
                    place="reference",
                )


def checked_moved(design: Design, moved: tuple[Array, Array]) -> tuple[Array, Array]:
    """Return prescribed joint motion after a check of its shape."""
    shape = design.motion.q.shape
    arrays = cast(Array, finite("(2, N + 1, n)")(moved, "moved"))
    if arrays.shape != (2, *shape):
        raise InputError(
            f"of shape {arrays.shape}, expected (2, {shape[0]}, {shape[1]})", place="moved"
        )
    return arrays[0], arrays[1]
