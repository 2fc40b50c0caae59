"""The closed loops."""

from __future__ import annotations

from typing import cast

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, System
from pydrake.systems.primitives import PassThrough

from sdt_drake.io.arguments import a, finite, takes
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, checked_choice, checked_type
from sdt_drake.motion import Motion
from sdt_drake.run.controllers import in_errors, make_controller, tells_updates
from sdt_drake.run.controllers.base import LOOP_SIGNALS, Controller, table_of
from sdt_drake.run.design import Design, as_design
from sdt_drake.run.device_diagram import add_device, add_loads, add_moved, equilibrium
from sdt_drake.run.plant import steady
from sdt_drake.run.scenario import Scenario
from sdt_drake.systems import (
    DynamicSaturation,
    Encoder,
    LoadTorque,
    ReferenceSource,
    RobotDrawing,
    SignalTable,
    add_meter,
    connect_by_name,
    hold_of,
)
from sdt_drake.systems.wiring import Aliases, add_logs, systems_in

EXTERNAL = "external"
"""What comes from outside: an input of the loop."""


class Loop(Diagram):
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

    With `reference="external"` planner and hold are left out: the input `reference` takes
    [q_ref, v_ref, vd_ref] of length 3 n, joint side [rad, rad/s, rad/s²], which is in force as it
    comes. The scenario's motion still says around what the loop is tuned, and how long a run
    takes. With `controller="external"` the input `tau_cmd` takes the torque, motor side [N m].

    Args:
        design: a resolved scenario, or one that is resolved here.
        reference: "planned", or "external": an input.
        controller: a system of one's own instead of the scenario's controller, see
            `sdt_drake.run.controllers.Controller` for its ports; or "external": an input.
        meshcat: to watch the run in.
        widened: whether the alleviating torque widens the motors' limits; as the plant has it by
            default.
        limited: whether the motors have limits. Without, the use of the motors in a `Recording`
            means nothing.
        loaded: whether the load torque of the reference loads the motors of the axis plant.
        moved: q [rad] and v [rad/s] at the samples of the motion, joint side, shape (N + 1, n):
            what the joints do instead of what the motors make them do. So it is no loop, but shows
            what the controller asks for then. None by default.

    Raises:
        InputError: for a controller with ports that no signals of the loop fit, or with an
            algebraic loop; for an external reference of a loop that needs tables along the motion.

    Attributes:
        design: what it was made from.
        controller: the system that commands the torque.
        widened: whether the alleviating torque widens the motors' limits.
        updates: times within a period of the drives, or of the reference where they are
            continuous, at which what the controller gets is updated, from 0 to the period [s].
        is_told: whether the controller tells its command just after each update from what is
            logged just before; else a run has to stop there.
        logs: sinks by the name of the signal.
    """

    @takes(
        meshcat=a(Meshcat, "pydrake.geometry.StartMeshcat"),
        widened=a(bool, "True or False"),
        limited=a(bool, "True or False"),
        loaded=a(bool, "True or False"),
    )
    def __init__(
        self,
        design: Design | Scenario,
        *,
        reference: str = "planned",
        controller: System | str | None = None,
        meshcat: Meshcat | None = None,
        widened: bool | None = None,
        limited: bool = True,
        loaded: bool = True,
        moved: tuple[Array, Array] | None = None,
    ) -> None:
        super().__init__()
        design = as_design(design)
        robot, drive, motion = design.robot, design.drive, design.reference
        if widened is None:
            widened = design.scenario.plant.kind == "axis"
        self.design, self.widened, self._loaded = design, widened, loaded
        checked_choice(reference, ("planned", EXTERNAL), "reference")
        builder = DiagramBuilder()
        add = builder.AddNamedSystem

        self._hold = None
        if reference == EXTERNAL:
            _add_input(builder, "reference", PassThrough(3 * robot.n))
        else:
            add("reference_source", ReferenceSource(motion=motion, delay=drive.reference_delay))
            self._hold = hold_of(motion, 3 * robot.n, delay=drive.reference_delay)
            add("zero_order_hold", self._hold)
        self.controller = controller = _made(design, controller)
        self._table = _add_load_torque(builder, design, controller, widened)
        if isinstance(controller, PassThrough):
            _add_input(builder, "tau_cmd", controller)
        else:
            add("controller", controller)
        if reference == EXTERNAL:
            _check_no_tables(design, builder)
        add("dynamic_saturation", _limits(design, widened, limited))
        if moved is None:
            self._device = add_device(builder, design)
            self._friction, loads = add_loads(builder, design, loaded)
        else:
            self._device = add_moved(builder, design, *_checked_moved(design, moved))
            self._friction, loads = None, {}
        self._encoders = _add_encoders(builder, design, controller)
        if meshcat is not None:
            add("drawing", RobotDrawing(robot=robot, meshcat=meshcat, period=motion.period))

        measured = self._device.measured
        aliases = {
            ("controller", "state"): measured if drive.period is None else "drive_state",
            ("dynamic_saturation", "state"): self._device.motor_state,
            ("encoder", "state"): measured,
            ("position_encoder", "state"): measured,
        }
        aliases |= {**_SIGNALS, **self._device.aliases, **loads}
        signals = connect_by_name(builder, aliases)
        signals |= {"measured": signals[measured], "tau": signals[self._device.tau]}
        torques = {name: signals[name] for name in _TORQUES}
        limit = robot.motor_torque_limit
        each_step = {"torques": add_meter(builder, motor_torque_limit=limit, **torques)}
        if design.envelope is not None:
            each_step["motor_state"] = signals[self._device.motor_state]
        if reference == EXTERNAL:
            each_step["reference"] = signals["reference"]
        states = ("state", "measured")
        self.logs = add_logs(builder, {x: signals[x] for x in states}, motion.period)
        self.logs |= add_logs(builder, each_step, None)
        self.updates = _update_times(design)
        is_planned = reference != EXTERNAL
        self.is_told = is_planned and len(self.updates) == 2 and tells_updates(controller)
        for name in ("reference", *states, "tau_cmd", "tau"):
            builder.ExportOutput(signals[name], name)
        builder.BuildInto(self)
        self.set_name(f"{design.scenario.plant.kind}_loop")

    @takes(q=finite("(n,)"), v=finite("(n,)"))
    def rest(self, context: Context, q: Array | None = None, v: Array | None = None) -> None:
        """Start in a steady state, by default on the reference.

        What the encoders see is at the angles of the start and moves at its speed, not accelerated:
        motors carry the load, springs are wound, and integrals give what the feedforward does not.
        A controller without an integral has no equilibrium there with a wrong model; it starts on
        the reference all the same.

        Args:
            context: of this diagram.
            q: angles of the start, joint side [rad], shape (n,); by default those of the first
                sample of the motion.
            v: speeds of the start, joint side [rad/s], shape (n,); likewise, 0 where q is given.

        Raises:
            InputError: for arrays that are none of the joints.
        """
        start = self._start(q, v)
        at = equilibrium(self.design, start or steady(self.design.motion), self._loaded)
        device, motion = self._device, self.design.reference

        def own(block: System) -> Context:
            return self.GetMutableSubsystemContext(block, context)

        if device.plant is not None:
            device.plant.rest(own(device.plant), at.q, at.v)
        if device.elastic_joints is not None:
            device.elastic_joints.rest(own(device.elastic_joints), at.q_motor, at.v)
        if self._friction is not None:
            self._friction.rest(own(self._friction), at.v)
        if device.torque_loop is not None:
            device.torque_loop.rest(own(device.torque_loop), at.tau)
        for encoder in self._encoders:
            encoder.rest(own(encoder), at.q_seen, at.v)
        if isinstance(self.controller, Controller):
            given = () if start is None else (start,)
            self.controller.rest(own(self.controller), at.tau_cmd, *given)
        if self._hold is not None:
            first = np.concatenate([motion.q[0], motion.v[0], motion.vd[0]])
            self._hold.SetVectorState(own(self._hold), first)
        if self._table is not None:
            self._table.rest(own(self._table))

    def _start(self, q: Array | None, v: Array | None) -> Motion | None:
        """The sample at which a run starts, where it is given."""
        if q is None and v is None:
            return None
        n, first = self.design.robot.n, self.design.motion
        q = first.q[0] if q is None else q
        v = np.zeros(n) if v is None else v
        for name, values in (("q", q), ("v", v)):
            if values.shape != (n,):
                raise InputError(f"of shape {values.shape}, expected ({n},)", place=name)
        return Motion(first.period, q[None], v[None], np.zeros((1, n)))

    def recorded(self, context: Context) -> dict[str, Array]:
        """Logged signals by name, each of shape (samples, size); context: of this diagram.

        Torques are those just before each update of the drives, or of the reference where they are
        continuous; at the ends of the integrator's steps they are in "torques", side by side, at
        the times of "step_time". There an update at which a run has stopped has two rows.
        """
        logs = {
            name: sink.GetLog(self.GetSubsystemContext(sink, context))
            for name, sink in self.logs.items()
        }
        signals = {name: np.array(log.data().T) for name, log in logs.items()}
        times = signals["step_time"] = np.array(logs["torques"].sample_times())
        period = self.updates[-1]
        count = round(times[-1] / period) + 1
        at = np.searchsorted(times, (np.arange(count) - 1e-6) * period)
        torques = np.hsplit(signals["torques"][at], 4)[:3]
        return signals | dict(zip(_TORQUES, torques, strict=True))


make_loop = Loop  # as it is called beside `make_process` and `make_step_loop`


def _made(design: Design, controller: System | str | None) -> System:
    """The system that commands the torque: of an external controller the input passed through."""
    if isinstance(controller, str) and controller == EXTERNAL:
        return PassThrough(design.robot.n)
    own = make_controller(design) if controller is None else controller
    return _checked_controller(design, cast(System, own))  # which refuses a text


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


def _add_input(builder: DiagramBuilder, name: str, block: PassThrough) -> None:
    """Add an input of the diagram as the signal of that name."""
    builder.AddNamedSystem(name, block)
    builder.ExportInput(block.get_input_port(), name)


def _check_no_tables(design: Design, builder: DiagramBuilder) -> None:
    """Refuse what is only known along the planned motion."""
    if design.scenario.plant.kind == "axis":
        raise InputError(
            "'external', but the axis plant has its load from the planned motion; expected "
            "plant.kind coupled",
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


def _checked_moved(design: Design, moved: tuple[Array, Array]) -> tuple[Array, Array]:
    shape = design.motion.q.shape
    arrays = cast(Array, finite("(2, N + 1, n)")(moved, "moved"))
    if arrays.shape != (2, *shape):
        raise InputError(
            f"of shape {arrays.shape}, expected (2, {shape[0]}, {shape[1]})", place="moved"
        )
    return arrays[0], arrays[1]


_TORQUES = ("tau_cmd", "tau_limited", "tau")

_SIGNALS: Aliases = {
    ("reference_source", "reference"): "planned",
    ("reference", "y"): "reference",
    ("tau_cmd", "y"): "tau_cmd",
    ("zero_order_hold", "u"): "planned",
    ("zero_order_hold", "y"): "reference",
    ("dynamic_saturation", "tau"): "tau_limited",
    ("encoder", "measured"): "drive_state",
    ("position_encoder", "measured"): "sampled_state",
}
"""Signals of ports that are called otherwise, the same in every loop."""


def _update_times(design: Design) -> Array:
    drive = design.drive
    period = drive.period or design.reference.period
    late = drive.reference_delay % period  # the reference arrives within
    on_time = min(late, period - late) < 1e-6 * period
    return np.array([0.0, period] if on_time else [0.0, late, period])


_NO_LIMIT = 1e9  # times the motors' torque


def _limits(design: Design, widened: bool, limited: bool) -> DynamicSaturation:
    robot, envelope = design.robot, design.envelope if limited else None
    return DynamicSaturation(
        motor_torque_limit=(1.0 if limited else _NO_LIMIT) * robot.motor_torque_limit,
        gear_ratio=robot.gear_ratio,
        n1=None if envelope is None else envelope.n1,
        n0=None if envelope is None else envelope.n0,
        widened=widened,
    )


def _add_load_torque(
    builder: DiagramBuilder, design: Design, controller: System, widened: bool
) -> SignalTable | None:
    """Add load torque and alleviating torque of the reference, where the loop needs them: a table,
    or on line. Returns the table."""
    scenario = design.scenario
    is_load = scenario.plant.kind == "axis" or scenario.disturbance.amplitude > 0
    names = ["load_torque"] if is_load or controller.HasInputPort("load_torque") else []
    names += ["alleviating_torque"] * widened
    if names and scenario.inverse_dynamics == "table":
        table = table_of(design, **{name: getattr(design.loads, name) for name in names})
        builder.AddNamedSystem("load_torque", table)
        return table
    if names:
        block = LoadTorque(robot=design.loaded_robot, algorithm=scenario.algorithm)
        builder.AddNamedSystem("load_torque", block)
    return None


def _add_encoders(builder: DiagramBuilder, design: Design, controller: System) -> list[Encoder]:
    """Add encoders: of the drives, if they sample, and at the instants of the reference, if the
    controller needs that."""
    drive, robot = design.drive, design.robot
    periods = {} if drive.period is None else {"encoder": drive.period}
    if controller.HasInputPort("sampled_state"):
        periods["position_encoder"] = design.reference.period
    encoders = []
    for name, period in periods.items():
        encoder = Encoder(
            n=robot.n,
            period=period,
            resolution=drive.encoder_resolution,
            gear_ratio=robot.gear_ratio,
        )
        builder.AddNamedSystem(name, encoder)
        encoders.append(encoder)
    return encoders
