"""The closed loops."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import Any, cast

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.systems.framework import Context, Diagram, System
from pydrake.systems.primitives import ConstantVectorSource, VectorLogSink, ZeroOrderHold

from sdt_drake.io.arguments import a, finite, takes
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, checked_type
from sdt_drake.run.controllers import in_errors, make_controller
from sdt_drake.run.controllers.base import LOOP_SIGNALS, add_table
from sdt_drake.run.design import Design, as_design
from sdt_drake.run.device_diagram import add_device, add_loads, add_moved, at_rest
from sdt_drake.run.scenario import Scenario
from sdt_drake.systems import (
    AxisProcess,
    DynamicSaturation,
    Encoder,
    LoadTorque,
    PiSpeedController,
    ReferenceSource,
    RobotDrawing,
    Wired,
    hold_of,
)
from sdt_drake.systems.gains import SpeedGains


class Loop(Wired):
    """A closed loop of a design, to simulate, to draw, or to build into a diagram of one's own.

    On the plant "axis", the paper's simulation models, all axes in one diagram (Figures 3, 5 and
    6): each motor turns its own constant inertia against the load torque of the reference, with its
    limits widened by the alleviating torque. The disturbance makes the true load differ from what
    is fed forward.

    On the plant "coupled", the MultibodyPlant under the same controllers: all joints at once,
    coupled by their dynamics. The coupling torques act physically, so the motors' limits are not
    widened and nothing loads the motors but the plant; the disturbance and friction act as
    generalised forces.

    Inputs: `extra_load_torque`, what the motors turn against beside all else, motor side [N m]; 0
    where nothing is connected. Outputs: `reference`, `state`, `measured` (what the encoders are
    on), `tau_cmd`, `tau`, as `sdt_drake.systems` says. It logs what a `Recording` holds.

    Args:
        design: a resolved scenario, or one that is resolved here.
        controller: a system of one's own instead of the scenario's controller, see
            `sdt_drake.run.controllers.Controller` for its ports.
        meshcat: to watch the run in.
        widened: whether the alleviating torque widens the motors' limits; as the plant has it by
            default.
        moved: q [rad] and v [rad/s] at the samples of the motion, joint side, shape (N + 1, n):
            what the joints do instead of what the motors make them do. So it is no loop, but shows
            what the controller asks for then. None by default.

    Raises:
        InputError: for a controller with ports that no signals of the loop fit, or with an
            algebraic loop.

    Attributes:
        design: what it was made from.
        controller: the system that commands the torque.
        logs: sinks by the name of the signal.
    """

    @takes(meshcat=a(Meshcat, "pydrake.geometry.StartMeshcat"), widened=a(bool, "True or False"))
    def __init__(
        self,
        design: Design | Scenario,
        *,
        controller: System | None = None,
        meshcat: Meshcat | None = None,
        widened: bool | None = None,
        moved: tuple[Array, Array] | None = None,
    ) -> None:
        super().__init__()
        design = as_design(design)
        robot, drive, motion = design.robot, design.drive, design.reference
        self.design = design
        widened = design.scenario.plant.kind == "axis" if widened is None else widened
        self.controller = _checked_controller(
            design, make_controller(design) if controller is None else controller
        )

        source = ReferenceSource(motion=motion, delay=drive.reference_delay)
        self.add("reference_source", source, "planned")
        hold = hold_of(motion, 3 * robot.n, delay=drive.reference_delay)
        self.add("zero_order_hold", hold, "planned", "reference")
        _add_load_torque(self, design, self.controller, widened)
        self.add("controller", self.controller, state="drive_state")
        limits = DynamicSaturation(
            motor_torque_limit=robot.motor_torque_limit,
            gear_ratio=robot.gear_ratio,
            n1=None if design.envelope is None else design.envelope.n1,
            n0=None if design.envelope is None else design.envelope.n0,
            widened=widened,
        )
        self.add("dynamic_saturation", limits, tau="tau_limited", state="motor_state")
        if moved is None:
            add_device(self, design)
            add_loads(self, design)
        else:
            add_moved(self, design, *_checked_moved(design, moved))
        _add_encoders(self, design, self.controller)
        if meshcat is not None:
            drawing = RobotDrawing(robot=robot, meshcat=meshcat, period=motion.period)
            self.add("drawing", drawing)

        torques, states = ("tau_cmd", "tau_limited", "tau"), ("state", "measured")
        self.logs = self.log(states, motion.period)
        self.logs |= self.log(torques, drive.period or motion.period)
        self.build("reference", *states, "tau_cmd", "tau")
        self.set_name(f"{design.scenario.plant.kind}_loop")

    def rest(self, context: Context) -> None:
        """Start on the reference, in the equilibrium of what has gone on like that for long.

        What the encoders see is on the first sample of the reference, and has moved at its speed,
        not accelerated: motors carry the load, springs are wound, and integrals give what the
        feedforward does not. A controller without an integral has no equilibrium there with a wrong
        model; it starts on the reference all the same.

        Args:
            context: of this diagram.
        """
        start = at_rest(self.design)
        for hold in blocks_of(self):  # of the reference and of tables; encoders have their own
            if isinstance(hold, ZeroOrderHold):
                seen = hold.get_input_port().Eval(self.GetSubsystemContext(hold, context))
                self.set_state(context, hold, cast(Array, seen))
        for block, (kind, state) in product(self.GetSystems(), start.items()):
            if isinstance(block, kind):
                own = self.GetMutableSubsystemContext(block, context)
                cast(Any, block).rest(own, *state)

    def recorded(self, context: Context) -> dict[str, Array]:
        """Logged signals by name, each of shape (samples, size); context: of this diagram."""
        return {
            name: np.array(sink.GetLog(self.GetSubsystemContext(sink, context)).data().T)
            for name, sink in self.logs.items()
        }


make_loop = Loop  # as it is called beside `make_process` and `make_step_loop`


def make_step_loop(*, gains: SpeedGains, i_eff: float, structure: str) -> Diagram:
    """Make one linear speed loop without load or limit (Figures 4 and 5): a step of its reference.

    From time 0 on 1 rad/s is asked of the motor. Output: `state`.

    Args:
        gains: of one controller, motor side; arrays of length 1.
        i_eff: inertia, motor side [kg m²].
        structure: "pi" or "p_in_feedback".
    """
    loop = Wired()
    step_reference = ConstantVectorSource(np.array([0.0, 1.0, 0.0]))  # q_ref, v_ref, vd_ref
    loop.add("step_reference", step_reference, "reference")
    pi = PiSpeedController(gains=gains, gear_ratio=[1.0], structure=structure)
    loop.add("pi_speed_controller", pi)
    loop.add("no_load", ConstantVectorSource(np.zeros(1)), "load_torque")
    process = AxisProcess(i_eff=[i_eff], gear_ratio=[1.0])
    loop.add("axis_process", process, tau="tau_fb")
    loop.build("state")
    loop.set_name("step_loop")
    return loop


def _checked_controller(design: Design, controller: System) -> System:
    checked_type(controller, System, "controller", "calling its class")
    where, n = in_errors(design, type(controller)), design.robot.n
    ports = map(controller.get_output_port, range(controller.num_output_ports()))
    outputs = {port.get_name(): port.size() for port in ports}
    if outputs != {"tau_cmd": n}:
        told = ", ".join(f"{name} of length {size}" for name, size in outputs.items())
        raise InputError(
            f"{where}: outputs: {told or 'none'}, expected tau_cmd of length {n} alone"
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
                f"{where}: tau_cmd depends on tau_limited at once, and that on tau_cmd: an "
                "algebraic loop; expected prerequisites_of_calc of tau_cmd without tau_limited"
            )
    return controller


def _checked_moved(design: Design, moved: tuple[Array, Array]) -> tuple[Array, Array]:
    shape = design.motion.q.shape
    arrays = cast(Array, finite("(2, N + 1, n)")(moved, "moved"))
    if arrays.shape != (2, *shape):
        raise InputError(f"moved: of shape {arrays.shape}, expected (2, {shape[0]}, {shape[1]})")
    return arrays[0], arrays[1]


def systems_in(system: System) -> Iterator[System]:
    """The system itself and, if it is a diagram, all systems in it, however deep."""
    yield system
    if isinstance(system, Diagram):
        for inner in system.GetSystems():
            yield from systems_in(inner)


def blocks_of(system: System) -> list[System]:
    """The systems that a loop or another system consists of in the end, without logs."""
    return [s for s in systems_in(system) if not isinstance(s, Diagram | VectorLogSink)]


def _add_load_torque(diagram: Wired, design: Design, controller: System, widened: bool) -> None:
    """Load torque and alleviating torque of the reference, where the loop needs them: a table, or
    on line."""
    scenario = design.scenario
    is_load = scenario.plant.kind == "axis" or scenario.disturbance.amplitude > 0
    names = ["load_torque"] if is_load or controller.HasInputPort("load_torque") else []
    names += ["alleviating_torque"] * widened
    if names and scenario.inverse_dynamics == "table":
        signals = {name: getattr(design.loads, name) for name in names}
        add_table(diagram, "load_torque", design, **signals)
    elif names:
        block = LoadTorque(robot=design.loaded_robot, algorithm=scenario.algorithm)
        diagram.add("load_torque", block)


def _add_encoders(diagram: Wired, design: Design, controller: System) -> None:
    """Of the drives, if they sample, and at the instants of the reference, for who needs that."""
    drive, robot = design.drive, design.robot

    def add(name: str, period: float, signal: str) -> None:
        own = {"resolution": drive.encoder_resolution, "gear_ratio": robot.gear_ratio}
        encoder = Encoder(n=robot.n, period=period, **own)
        diagram.add(name, encoder, state="measured", measured=signal)

    if drive.period is None:
        diagram.same("drive_state", "measured")
    else:
        add("encoder", drive.period, "drive_state")
    if controller.HasInputPort("sampled_state"):
        add("position_encoder", design.reference.period, "sampled_state")
