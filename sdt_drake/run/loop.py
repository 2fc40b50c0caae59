"""The closed loop of a design as a Drake diagram."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, InputPort, System
from pydrake.systems.primitives import PassThrough, VectorLogSink, ZeroOrderHold

from sdt_drake.io.arguments import finite, instance_of, one_of, takes
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.shown import higher
from sdt_drake.run.controllers import start_controller
from sdt_drake.run.design import Design, as_design
from sdt_drake.run.device import (
    equilibrium,
    initial_state,
    make_device,
    make_encoder,
    make_saturation,
    measured_port,
    set_device,
    set_encoder,
)
from sdt_drake.run.feedforward import make_feedforward, start_feedforward
from sdt_drake.run.loop_checks import EXTERNAL, check_no_tables, chosen_controller
from sdt_drake.run.plant import steady
from sdt_drake.run.recorded import add_run_logs, feedthrough, update_times
from sdt_drake.run.scenario import Scenario
from sdt_drake.systems import hold_of, motor_windings, reference_source, robot_drawing
from sdt_drake.systems.motor_windings import set_initial_temperature
from sdt_drake.systems.reference import start_hold
from sdt_drake.systems.wiring import build, nested


@dataclass(frozen=True, eq=False)
class Loop:
    """The closed loop of a design, to simulate, to draw, or to build into your own diagram."""

    design: Design
    """The design of the loop."""
    diagram: Diagram
    """The loop as an ordinary Drake diagram; `make_loop` describes its systems and ports."""
    owner: type
    """Class of the controller, as in error messages; PassThrough for an external one."""
    logs: Mapping[str, VectorLogSink] = field(repr=False)
    """Sinks by the name of the signal."""

    @property
    def controller(self) -> System:
        """The system that commands the torque."""
        return self.diagram.GetSubsystemByName("controller")

    @cached_property
    def updates(self) -> Array:
        """Times of the updates of the controller's inputs within a period; see `update_times`."""
        return update_times(self.design, self.design.drive.reference_delay * self.is_planned)

    @property
    def is_planned(self) -> bool:
        """True if the reference is the planned one, not an input."""
        return "reference" not in self.logs

    @cached_property
    def feedthrough(self) -> dict[str, Array] | None:
        """Gains from held inputs to the command; None if a run must stop at each update."""
        if not self.is_planned or len(self.updates) > 2:  # external or late
            return None
        if self.design.drive.ripple_harmonics:  # the torque jumps to another than the command
            return None
        sampled = self.design.drive.period is not None
        return feedthrough(self.controller, self.owner, sampled=sampled)

    def GetInputPort(self, name: str) -> InputPort:  # noqa: N802  # Drake's name
        """Return an input of the diagram by its name."""
        return self.diagram.GetInputPort(name)

    @takes(q=finite("(n,)"), v=finite("(n,)"))
    def set_steady_state(
        self, context: Context, q: Array | None = None, v: Array | None = None
    ) -> None:
        """Set the state to steady motion, by default along the first sample of the motion.

        The encoders measure the initial angles and speeds, without acceleration. Motors carry the
        load, springs are deflected, and integrals supply the torque that the feedforward lacks. A
        controller without an integral starts at the same state, but with a wrong model it is not
        in equilibrium there.

        Args:
            context: a context of the diagram.
            q: initial angles, joint side [rad], shape (n,); those of the motion by default.
            v: initial speeds, joint side [rad/s], shape (n,); by default those of the motion, or 0
                if q is given.

        Raises:
            InputError: if an array has another shape or is not finite.
        """
        design, start = self.design, initial_state(self.design, q, v)
        at = equilibrium(design, start or steady(design.reference.tracked))
        own = partial(nested, self.diagram, context)
        hold, held = own("zero_order_hold")
        if isinstance(hold, ZeroOrderHold):
            start_hold(hold, held)
        start_feedforward(*own("feedforward"))
        set_device(*own("device"), design, at)
        set_encoder(*own("encoder"), design, at)
        if design.windings is not None:
            set_initial_temperature(*own("windings"), windings=design.windings)
        start_controller(self.owner, *own("controller"), design, at.tau_cmd, start)
        if self.diagram.HasSubsystemNamed("pilot"):  # feels the accelerations that result
            higher("pilot.in_loop:start_pilot")(*own("pilot"), design)


@takes(meshcat=instance_of(Meshcat, "pydrake.geometry.StartMeshcat"), pilot=instance_of(bool))
def make_loop(
    design: Design | Scenario,
    *,
    reference: str = "planned",
    controller: System | str | None = None,
    meshcat: Meshcat | None = None,
    pilot: bool = False,
) -> Loop:
    """Make the closed loop of a design (Figures 3, 5 and 6).

    Eight systems are in every loop: `reference_source`, `zero_order_hold`, `feedforward`,
    `controller`, `dynamic_saturation`, `device`, `encoder` and `extra_load_torque`. On the axis
    plant the alleviating torque widens the motors' limits; the disturbance is the difference
    between the true load and the load that is fed forward.

    Input: `extra_load_torque`, a further load of the motors, motor side [N m]; 0 if it is not
    connected. Outputs: `reference`, `state`, `measured` (the signal that the encoders measure),
    `tau_cmd` and `tau`, as `sdt_drake.systems` describes them; with `plant.windings` also
    `winding_temperature`. The loop logs the signals of a `Recording`.

    With `reference="external"` the loop has no planned reference and no hold. Its input `reference`
    takes [q_ref, v_ref, vd_ref] of length 3 n, joint side [rad, rad/s, rad/s²]. The scenario's
    motion still determines the tuning and the duration of a run. Its `drive.reference_delay` does
    not act: the reference is in force as it comes, and should change at the samples of the motion,
    where position loops sample. With `controller="external"` the input `tau_cmd` takes the torque,
    motor side [N m].

    Args:
        design: a design, or a scenario, which is resolved here.
        reference: "planned", or "external" for an input.
        controller: your own system instead of the scenario's controller, with ports as in
            `sdt_drake.run.controllers.Controller`; or "external" for an input.
        meshcat: a Meshcat that shows the run; none by default.
        pilot: True for a block `pilot` at the head of the coupled plant, also if the scenario
            names no `pilot.model`. The loop then has its outputs, too.

    Raises:
        InputError: if the ports of a controller fit no signals of the loop, a controller makes an
            algebraic loop, or a loop with an external reference needs tables along the motion.

    Examples:
        >>> from sdt_drake.run.design import make_design
        >>> from sdt_drake.run.scenario import load_scenario
        >>> loop = make_loop(make_design(load_scenario("axis_pi", {"motion": "leans"})))
        >>> [system.get_name() for system in loop.diagram.GetSystems()][:4]
        ['reference_source', 'zero_order_hold', 'feedforward', 'controller']
    """
    design = as_design(design)
    one_of(reference, "reference", ("planned", EXTERNAL))
    motion, n, is_planned = design.reference.held, design.device.simulated.n, reference != EXTERNAL
    delay = design.drive.reference_delay * is_planned
    owner, law = chosen_controller(design, controller)
    adds = law.HasOutputPort("tau_fb")  # else it commands the whole torque
    feeds = ("load_torque",) * (design.needs_load_torque or law.HasInputPort("load_torque"))
    feeds += ("alleviating_torque",) * design.widens_limits

    builder = DiagramBuilder()
    add, connect = builder.AddNamedSystem, builder.Connect
    planned, sampled = (
        reference_source(motion=motion, delay=delay),
        hold_of(motion, 3 * n, delay=delay),
    )
    source = add("reference_source", planned if is_planned else PassThrough(3 * n))
    hold = add("zero_order_hold", sampled if is_planned else PassThrough(3 * n))
    feedforward = add("feedforward", make_feedforward(design, adds=adds, feeds=feeds))
    law = add("controller", law)
    saturation = add("dynamic_saturation", make_saturation(design))
    pilot = pilot or bool(design.scenario.pilot.model)
    if pilot and (design.scenario.plant.kind == "axis" or design.assumptions.prescribed_motion):
        raise InputError("needs plant.kind coupled, which moves the head", place="pilot")
    device = add("device", make_device(design, of_bodies=pilot))
    at_reference = law.HasInputPort("sampled_state")
    encoder = add("encoder", make_encoder(design, at_reference=at_reference, delay=delay))
    extra = add("extra_load_torque", PassThrough(np.zeros(n)))

    # A block that is ideal is a PassThrough: its only ports are its first.
    held, tau_cmd = hold.get_output_port(), feedforward.get_output_port(0)
    tau_limited, state = saturation.get_output_port(), device.GetOutputPort("state")
    measurable = device.GetOutputPort(measured_port(design))

    connect(source.get_output_port(), hold.get_input_port())
    if feedforward.HasInputPort("reference"):  # its inverse dynamics is online
        connect(held, feedforward.GetInputPort("reference"))

    if law.HasInputPort("reference"):
        connect(held, law.GetInputPort("reference"))
    for name in ("measured", "state"):  # its name up to 0.4
        if law.HasInputPort(name):
            connect(encoder.get_output_port(0), law.GetInputPort(name))
    if at_reference:
        connect(encoder.GetOutputPort("sampled_state"), law.GetInputPort("sampled_state"))
    if law.HasInputPort("load_torque"):
        connect(feedforward.GetOutputPort("load_torque"), law.GetInputPort("load_torque"))
    if law.HasInputPort("tau_cmd"):  # anti-windup
        connect(tau_cmd, law.GetInputPort("tau_cmd"))
    if law.HasInputPort("tau_limited"):
        connect(tau_limited, law.GetInputPort("tau_limited"))
    connect(law.get_output_port(), feedforward.get_input_port(0))

    connect(tau_cmd, saturation.GetInputPort("tau_cmd"))
    if design.widens_limits:
        alleviating = feedforward.GetOutputPort("alleviating_torque")
        connect(alleviating, saturation.GetInputPort("alleviating_torque"))
    if saturation.HasInputPort("motor_state"):  # a torque-speed envelope
        connect(device.GetOutputPort("motor_state"), saturation.GetInputPort("motor_state"))

    connect(tau_limited, device.GetInputPort("tau_limited"))
    connect(extra.get_output_port(), device.GetInputPort("extra_load_torque"))
    if device.HasInputPort("load_torque"):
        connect(feedforward.GetOutputPort("load_torque"), device.GetInputPort("load_torque"))
    connect(measurable, encoder.get_input_port())
    if meshcat is not None:
        drawing = robot_drawing(
            robot=design.device.simulated, meshcat=meshcat, period=design.reference.tracked.period
        )
        connect(state, add("drawing", drawing).get_input_port())

    if not is_planned:
        check_no_tables(design, law, feedforward)
        builder.ExportInput(source.get_input_port(), "reference")
    if owner is PassThrough:
        builder.ExportInput(law.get_input_port(), "tau_cmd")
    builder.ExportInput(extra.get_input_port(), "extra_load_torque")
    signals = {
        "reference": held,
        "state": state,
        "measured": measurable,
        "tau_cmd": tau_cmd,
        "tau_limited": tau_limited,
        "tau": device.GetOutputPort("tau"),
        "motor_state": device.GetOutputPort("motor_state"),
    }
    exported = ["reference", "state", "measured", "tau_cmd", "tau"]
    if design.windings is not None:
        windings = add("windings", motor_windings(windings=design.windings))
        connect(signals["tau"], windings.get_input_port())
        signals["winding_temperature"] = windings.get_output_port()
        exported.append("winding_temperature")
    if pilot:
        felt = higher("pilot.in_loop:add_pilot")(builder, design, device)
        signals |= felt
        exported += felt
    logs = add_run_logs(builder, design, signals, is_planned=is_planned)
    for name in exported:
        builder.ExportOutput(signals[name], name)
    diagram = build(builder, f"{design.scenario.plant.kind}_loop")
    return Loop(design, diagram, owner, logs)
