"""The closed loop of a design as a Drake diagram."""

from __future__ import annotations

from typing import cast

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, System
from pydrake.systems.primitives import PassThrough

from sdt_drake.io.arguments import a, finite, takes
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, checked_choice
from sdt_drake.motion import Motion
from sdt_drake.run.controllers import make_controller, predicts_updates
from sdt_drake.run.controllers.base import Controller, table_of
from sdt_drake.run.design import Design, as_design
from sdt_drake.run.device_diagram import add_device, add_loads, add_moved, equilibrium
from sdt_drake.run.loop_checks import check_no_tables, checked_controller, checked_moved
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
    arrival,
    connect_by_name,
    hold_of,
)
from sdt_drake.systems.wiring import Aliases, add_logs

EXTERNAL = "external"
"""Option for a reference or controller outside the loop: the loop has an input for it."""


class Loop(Diagram):
    """The closed loop of a design, to simulate, to draw, or to build into your own diagram.

    The plant "axis" is the paper's simulation model with all axes in one diagram (Figures 3, 5 and
    6). Each motor turns a constant inertia against the load torque of the reference, and the
    alleviating torque widens its limits. The disturbance is the difference between the true load
    and the load that is fed forward.

    The plant "coupled" is the MultibodyPlant under the same controllers. Coupling torques act
    physically, so limits are not widened and no load torque is added. Disturbance and friction act
    as generalised forces.

    Input: `extra_load_torque`, a further load of the motors, motor side [N m]; 0 if it is not
    connected. Outputs: `reference`, `state`, `measured` (the signal that the encoders measure),
    `tau_cmd` and `tau`, as `sdt_drake.systems` describes them. The loop logs the signals of a
    `Recording`.

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
        widened: whether the alleviating torque widens the motors' limits; by default on the axis
            plant.
        limited: whether the motors have limits. Without limits, peak and saturation in a
            `Recording` have no meaning.
        loaded: whether the load torque of the reference acts on the axis plant.
        moved: prescribed joint motion: q [rad] and v [rad/s] at the samples of the motion, joint
            side, shape (N + 1, n) each. The motors then have no effect; the log shows what the
            controller would command. None by default.

    Raises:
        InputError: if the ports of a controller fit no signals of the loop, a controller makes an
            algebraic loop, or a loop with an external reference needs tables along the motion.

    Attributes:
        design: the design of the loop.
        controller: the system that commands the torque.
        widened: whether the alleviating torque widens the motors' limits.
        delay: delay of the reference [s]; 0 if it is external.
        updates: times of the updates of the controller's inputs within a period, from 0 to the
            period [s]. The period is that of the drives, or of the reference for continuous drives.
        predicts_updates: whether the command just after each update follows from the log. Otherwise
            a run stops at each update.
        logs: sinks by the name of the signal.

    Examples:
        >>> from sdt_drake.run.design import make_design
        >>> from sdt_drake.run.scenario import load_scenario
        >>> loop = Loop(make_design(load_scenario("axis_pi", {"motion": "leans"})))
        >>> [loop.get_output_port(i).get_name() for i in range(loop.num_output_ports())]
        ['reference', 'state', 'measured', 'tau_cmd', 'tau']
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
            check_no_tables(design, builder)
        add("dynamic_saturation", _limits(design, widened, limited))
        if moved is None:
            self._device = add_device(builder, design)
            self._friction, loads = add_loads(builder, design, loaded)
        else:
            self._device = add_moved(builder, design, *checked_moved(design, moved))
            self._friction, loads = None, {}
        self.delay = 0.0 if reference == EXTERNAL else drive.reference_delay
        self._encoders = _add_encoders(builder, design, controller, self.delay)
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
        self.updates = _update_times(design, self.delay)
        is_planned = reference != EXTERNAL
        is_on_time = len(self.updates) == 2
        self.predicts_updates = is_planned and is_on_time and predicts_updates(controller)
        for name in ("reference", *states, "tau_cmd", "tau"):
            builder.ExportOutput(signals[name], name)
        builder.BuildInto(self)
        self.set_name(f"{design.scenario.plant.kind}_loop")

    @takes(q=finite("(n,)"), v=finite("(n,)"))
    def rest(self, context: Context, q: Array | None = None, v: Array | None = None) -> None:
        """Set the state to steady motion, by default along the first sample of the motion.

        The encoders measure the initial angles and speeds, without acceleration. Motors carry the
        load, springs are wound, and integrals supply the torque that the feedforward lacks. A
        controller without an integral starts at the same state, but with a wrong model it is not
        in equilibrium there.

        Args:
            context: a context of this diagram.
            q: initial angles, joint side [rad], shape (n,); those of the motion by default.
            v: initial speeds, joint side [rad/s], shape (n,); by default those of the motion, or 0
                if q is given.

        Raises:
            InputError: if an array has another shape or is not finite.
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
        """Return the given initial state as a motion of one sample; None if nothing is given."""
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
        """Return the logged signals by name, each of shape (samples, size).

        Torques are those just before each update of the drives, or of the reference for continuous
        drives; the first are those just after the update. "torques" has them side by side at the
        ends of the integrator's steps, at the times "step_time". An update at which a run stopped
        has two rows there.

        Args:
            context: a context of this diagram.
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
        at[0] = np.searchsorted(times, 0.0, "right") - 1
        torques = np.hsplit(signals["torques"][at], 4)[:3]
        return signals | dict(zip(_TORQUES, torques, strict=True))


make_loop = Loop  # the name beside `make_process` and `make_step_loop`


def _made(design: Design, controller: System | str | None) -> System:
    """Return the system that commands the torque; a pass-through for an external controller."""
    if isinstance(controller, str) and controller == EXTERNAL:
        return PassThrough(design.robot.n)
    own = make_controller(design) if controller is None else controller
    return checked_controller(design, cast(System, own))  # refuses a text


def _add_input(builder: DiagramBuilder, name: str, block: PassThrough) -> None:
    """Add an input of the diagram, and the signal of the same name."""
    builder.AddNamedSystem(name, block)
    builder.ExportInput(block.get_input_port(), name)


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
"""Names of the signals at ports that are named differently, in every loop."""


def _update_times(design: Design, delay: float) -> Array:
    """Return the times of updates within a period of the drives [s]; see `Loop.updates`."""
    period = design.drive.period or design.reference.period
    late = arrival(delay, period)
    return np.array([0.0, period] if late == 0 else [0.0, late, period])


NO_LIMIT = 1e9
"""Factor on the torque limit of motors that are not limited."""


def _limits(design: Design, widened: bool, limited: bool) -> DynamicSaturation:
    robot, envelope = design.robot, design.envelope if limited else None
    return DynamicSaturation(
        motor_torque_limit=(1.0 if limited else NO_LIMIT) * robot.motor_torque_limit,
        gear_ratio=robot.gear_ratio,
        n1=None if envelope is None else envelope.n1,
        n0=None if envelope is None else envelope.n0,
        widened=widened,
    )


def _add_load_torque(
    builder: DiagramBuilder, design: Design, controller: System, widened: bool
) -> SignalTable | None:
    """Add load torque and alleviating torque of the reference if needed; return their table.

    They are computed before the run, or online by a block; the result is None then.
    """
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


def _add_encoders(
    builder: DiagramBuilder, design: Design, controller: System, delay: float
) -> list[Encoder]:
    """Add the encoders of sampled drives, and an encoder that samples when the reference arrives.

    The latter is added if the controller has an input for it.
    """
    drive, robot = design.drive, design.robot
    timing = {} if drive.period is None else {"encoder": (drive.period, 0.0)}
    if controller.HasInputPort("sampled_state"):
        period = design.reference.period
        timing["position_encoder"] = period, arrival(delay, period)
    encoders = []
    for name, (period, offset) in timing.items():
        encoder = Encoder(
            n=robot.n,
            period=period,
            resolution=drive.encoder_resolution,
            gear_ratio=robot.gear_ratio,
            offset=offset,
        )
        builder.AddNamedSystem(name, encoder)
        encoders.append(encoder)
    return encoders
