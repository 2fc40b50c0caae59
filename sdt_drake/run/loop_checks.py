"""Checks of controllers and external references, before a loop is made and before it runs."""

from typing import cast

from pydrake.systems.framework import Context, Diagram, System
from pydrake.systems.primitives import PassThrough

from sdt_drake.io.arguments import instance_of
from sdt_drake.io.deprecated import renamed
from sdt_drake.io.errors import InputError
from sdt_drake.run.controllers import in_errors, make_controller
from sdt_drake.run.controllers.base import LOOP_SIGNALS
from sdt_drake.run.design import Design
from sdt_drake.systems.wiring import systems_in

EXTERNAL = "external"
"""Option for a reference or controller outside the loop: the loop has an input for it."""


def chosen_controller(design: Design, controller: System | str | None) -> tuple[type, System]:
    """Return class and system of a loop's controller; a pass-through for an external one."""
    if isinstance(controller, str) and controller == EXTERNAL:
        return PassThrough, PassThrough(design.device.simulated.n)
    if controller is None:
        owner, law = make_controller(design)
    else:
        owner, law = type(controller), cast(System, controller)  # a text is refused
    return owner, checked_controller(design, owner, law)


def checked_controller(design: Design, owner: type, controller: System) -> System:
    """Return a controller after a check of its ports; `owner` is its class."""
    instance_of(System, "calling its class")(controller, "controller")
    where, n = in_errors(design, owner), design.device.simulated.n
    ports = map(controller.get_output_port, range(controller.num_output_ports()))
    outputs = {port.get_name(): port.size() for port in ports}
    if outputs not in ({"tau_cmd": n}, {"tau_fb": n}):
        found = ", ".join(f"{name} of length {size}" for name, size in outputs.items())
        raise InputError(
            f"{where}: outputs: {found or 'none'}, expected tau_cmd of length {n} alone"
        )
    sizes = {"reference": 3 * n, "state": 2 * n, "measured": 2 * n, "sampled_state": 2 * n}
    inputs = map(controller.get_input_port, range(controller.num_input_ports()))
    for name, size in [(port.get_name(), port.size()) for port in inputs]:
        if name == "state":
            renamed(f"{where}: its input 'state'", "'measured'")
        elif name not in LOOP_SIGNALS:
            raise InputError(
                f"{where}: an input '{name}', expected one of {', '.join(LOOP_SIGNALS)}"
            )
        if size != sizes.get(name, n):
            raise InputError(
                f"{where}: input '{name}' has length {size}, expected {sizes.get(name, n)}"
            )
        port = int(controller.GetInputPort(name).get_index())
        if name in ("tau_cmd", "tau_limited") and controller.HasDirectFeedthrough(port, 0):
            raise InputError(
                f"{where}: its torque depends on {name} at once, and {name} on it, an "
                f"algebraic loop; expected prerequisites_of_calc of its output without {name}"
            )
    return controller


def check_no_tables(design: Design, *blocks: System) -> None:
    """Check that no block needs a table along the planned motion."""
    if design.scenario.plant.kind == "axis":
        raise InputError(
            "'external', but the load of the axis plant is computed along the planned motion; "
            "expected plant.kind coupled",
            place="reference",
        )
    for block in blocks:
        for table in systems_in(block):
            if table.get_name().endswith("_table"):
                raise InputError(
                    f"'external', but {table.get_name()} is computed along the planned motion; "
                    "expected inverse_dynamics online, and a controller without a schedule or a "
                    "learned torque",
                    place="reference",
                )


def check_inputs(diagram: Diagram, own: Context) -> None:
    """Check that an external reference or controller is connected to a loop with this context."""
    for port in map(diagram.get_input_port, range(diagram.num_input_ports())):
        if not port.HasValue(own) and port.get_name() != "extra_load_torque":
            raise InputError(
                f"external, but nothing is connected, expected {port.size()} numbers",
                place=port.get_name(),
            )
