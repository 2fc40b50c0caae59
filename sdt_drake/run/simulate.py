"""Running a loop, and what it recorded."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, replace
from pathlib import Path
from traceback import extract_tb
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import ConfigDict, SkipValidation, WithJsonSchema
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context, Diagram

from sdt_drake.io.arguments import a, a_path, takes
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, checked_number
from sdt_drake.io.fields import setting
from sdt_drake.io.progress import with_progress
from sdt_drake.io.shown import Shown, Summary, face, joint_count, of_joints
from sdt_drake.io.tables import check_columns, check_limits, data_frame, read_table, write_table
from sdt_drake.motion import LearnedReference, Motion
from sdt_drake.run.controllers import in_errors, own_code
from sdt_drake.run.design import Design, as_design
from sdt_drake.run.loop import Loop, make_loop
from sdt_drake.run.motor_torque import arrived, period_torque
from sdt_drake.run.scenario import Scenario
from sdt_drake.systems.wiring import systems_in

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

_HARDER = 20.0
"""How much harder the integrator tries on the axis plant: its motors saturate for seconds, and what
it misses where they do so grows until they no longer do."""

_FINEST = 1e-12  # that Drake takes
_MOST_STEPS = 1_000_000  # of the integrator in a period; a loop that needs more does not end

_SLICES = 200  # of a run, to tell how far it is; between samples, where steps end anyway

# What goes into a CSV file, in this order.
RECORDED_COLUMNS = (
    "v_ref", "v", "tau_cmd", "tau", "load_torque", "speed_error", "q_ref", "q", "tau_limited",
    "tau_peak", "tau_rms", "tau_mean", "saturated", "beyond_stop",
)  # fmt: skip


Column = Annotated[Array, SkipValidation, WithJsonSchema({"type": "number"})]
"""Numbers of a recording, for the reference of its fields."""


@dataclass(frozen=True, eq=False, repr=False)
class Recording(Shown):
    """What happened in a run, at the interpolation period; arrays of shape (N + 1, n), the time
    (N + 1,).

    Continuous signals are those at `time`; torques are those just before the update at `time`, so
    at the end of the period that ends there. The first row is just after its update. What motors
    give within the periods is in `tau_peak`, `tau_rms`, `tau_mean` and `saturated`. Where a
    controller has its proportional gain on the error, the held reference makes torques fall within
    each period, by K_PS r times what the speed gains in it: `tau_mean` tells what moves the links,
    `tau` at the ends does not.

    At the default accuracy, peaks are good to 3e-3 of the motor's torque and means to 1.5e-3. So is
    the RMS of a period, but for one in which the torque changes its sign: 6e-3. A period in which a
    motor begins or ceases to saturate has its share to a third of one of the integrator's steps;
    over a run these errors cancel.
    """

    __pydantic_config__ = ConfigDict(use_attribute_docstrings=True, arbitrary_types_allowed=True)

    time: Column = setting(unit="s")
    """Since the start."""
    q_ref: Column = setting(unit="rad", side="joint")
    """Positions of the planned motion; also where the controller gets another reference, as
    flights have taught it."""
    v_ref: Column = setting(unit="rad/s", side="joint")
    """Speeds of the planned motion, likewise."""
    q: Column = setting(unit="rad", side="joint")
    """Position of the plant."""
    v: Column = setting(unit="rad/s", side="joint")
    """Speed of the plant."""
    tau_cmd: Column = setting(unit="N m", side="motor")
    """Torque that the controller asks for."""
    tau_limited: Column = setting(unit="N m", side="motor")
    """The same after saturation."""
    tau: Column = setting(unit="N m", side="motor")
    """Torque that the motors give: the same with an ideal drive."""
    load_torque: Column = setting(unit="N m", side="motor")
    """tau_LD of Algorithm 1."""
    tau_peak: Column = setting(unit="N m", side="motor")
    """Largest torque that the motors give in the period that ends at `time`."""
    tau_rms: Column = setting(unit="N m", side="motor")
    """RMS torque of that period."""
    tau_mean: Column = setting(unit="N m", side="motor")
    """Mean torque of that period: its time integral is the motors' impulse."""
    saturated: Column = setting(unit="-", side="motor")
    """Share of that period in which a motor gives less than is asked."""
    beyond_stop: Column = setting(unit="rad", side="joint")
    """How far the coupled plant's joints are beyond their stops, which do not act in the
    simulation; 0 within them, and on the axis plant."""
    q_measured: Column | None = setting(None, unit="rad", side="joint")
    """Position of what the encoders are on, not of the links where joints are elastic; not in
    files."""
    v_measured: Column | None = setting(None, unit="rad/s", side="joint")
    """Speed of the same; not in files."""

    @property
    def speed_error(self) -> Array:
        """v - v_ref, joint side [rad/s]."""
        return self.v - self.v_ref

    @property
    def position_error(self) -> Array:
        """q - q_ref, joint side [rad]."""
        return self.q - self.q_ref

    def summary(self) -> Summary:
        columns = {
            "speed error [rad/s]": (".4f", np.abs(self.speed_error).max(axis=0)),
            "position error [deg]": (".3f", np.degrees(np.abs(self.position_error).max(axis=0))),
            "motor torque [N m]": (".1f", self.tau_peak.max(axis=0)),
            "saturated [%]": (".2f", 100 * self.saturated[1:].mean(axis=0)),
        }
        step, end = self.time[1] - self.time[0], self.time[-1]
        title = f"of {joint_count(self.q.shape[1])}: {end:.9g} s in steps of {1000 * step:.6g} ms"
        return of_joints(title, columns)

    def plot(self, design: Design | Scenario | None = None, joint: int | None = None) -> Figure:
        """A scope: speed and its reference, errors, torque; with a design, names and limits.

        Args:
            design: of the run, or its scenario.
            joint: 1..n, to show that one alone.

        Raises:
            InputError: if there is no such joint, or the design has other joints.
        """
        design = None if design is None else as_design(design)
        title = "Recording" if design is None else design.scenario.summary().title
        return face().plots.scope(title, self, design, joint)

    def to_pandas(self) -> pd.DataFrame:
        """A table of RECORDED_COLUMNS for each joint, its index the time.

        Raises:
            InputError: where pandas is not installed.
        """
        return data_frame(self.time, self._columns)

    @property
    def _columns(self) -> dict[str, Array]:
        return {name: getattr(self, name) for name in RECORDED_COLUMNS}

    @takes(path=a_path)
    def save(self, path: str | Path) -> None:
        """Write time and, for each joint, RECORDED_COLUMNS, exactly: as .csv, .mat or .parquet.

        Raises:
            InputError: if the file cannot be written, or needs a package that is not installed.
        """
        write_table(path, self.time, self._columns)

    @staticmethod
    @takes(path=a_path)
    def load(path: str | Path) -> Recording:
        """Read what `save` writes; further columns are ignored.

        Raises:
            InputError: naming the file and the line or the column: something missing, gaps in
                time, numbers that are not finite, or beyond what `check_limits` lets pass.
        """
        time, columns = read_table(path)
        check_limits(path, time, columns)
        names = [x.name for x in fields(Recording) if x.name != "time" and x.default is MISSING]
        told = ", ".join(f"{name}_k" for name in names)
        again = "an older one has to be simulated again"
        expected = f"a recording as `simulate` writes it ({again}): time and for joint k {told}"
        check_columns(path, columns, names, expected)
        return Recording(time=time, **{name: columns[name] for name in names})

    to_csv, from_csv = save, load  # as they are called of a motion


def make_simulator(
    diagram: Diagram, *, period: float, accuracy: float, realtime_rate: float = 0.0
) -> Simulator:
    """A simulator, not initialized, that meets samples every `period` [s] and integrates between.

    Error-controlled Runge-Kutta of third order. Its largest step is a little above the period: a
    largest step of just the period makes every few samples take a second step of 1e-16 s.
    """
    simulator = Simulator(diagram)
    config = SimulatorConfig(
        integration_scheme="runge_kutta3",
        max_step_size=1.01 * period,
        accuracy=accuracy,
        use_error_control=True,
        target_realtime_rate=realtime_rate,
    )
    ApplySimulatorConfig(config, simulator)
    integrator = simulator.get_mutable_integrator()
    integrator.set_requested_minimum_step_size(period / _MOST_STEPS)
    integrator.set_throw_on_minimum_step_size_violation(True)
    return simulator


@takes(diagram=a(Diagram, "sdt_drake.loop"))
def simulate(
    design: Design | Scenario,
    diagram: Diagram | None = None,
    *,
    realtime_rate: float = 0.0,
    q: Array | None = None,
    v: Array | None = None,
) -> Recording:
    """Run a loop for the time of its motion, starting on the reference, at the scenario's accuracy.

    Args:
        design: a resolved scenario, or one that is resolved here.
        diagram: its loop, or a diagram that has it within, however deep; built here by default.
        realtime_rate: how fast to go, 1 in real time, to watch a loop with a Meshcat; 0: as fast
            as it can.
        q, v: angles [rad] and speeds [rad/s] of another start, joint side, shape (n,); see
            `Loop.rest`.

    Raises:
        InputError: for a diagram without the design's loop, or one in which nothing is connected to
            its external reference or controller; if the integrator makes no headway, with the time.
    """
    design = as_design(design)
    checked_number(realtime_rate, "realtime_rate", minimum=0)
    diagram = make_loop(design) if diagram is None else diagram
    loop = _loop_in(design, diagram)
    period, accuracy = design.reference.period, design.scenario.accuracy
    if design.scenario.plant.kind == "axis":
        accuracy = max(accuracy / _HARDER, _FINEST)
    simulator = make_simulator(
        diagram, period=period, accuracy=accuracy, realtime_rate=realtime_rate
    )
    context = simulator.get_mutable_context()
    own = loop.GetMyMutableContextFromRoot(context)
    with own_code(design, type(loop.controller)):
        _check_inputs(loop, own)
        loop.rest(own, q, v)
        try:
            simulator.Initialize()
            _look(loop, own)  # at a NaN Drake's integrator may try for ever
            _run(simulator, loop)
        except RuntimeError as error:
            if error.__traceback__ and extract_tb(error.__traceback__)[-1].filename != __file__:
                raise  # of Python code in the loop
            _look(loop, own)
            reason = " ".join(str(error).split())
            raise InputError(
                f"scenario '{design.scenario.name}': the simulation is stuck at "
                f"{context.get_time():.6g} s ({reason})"
            ) from None
        signals = loop.recorded(own)
        tau_cmd = signals["tau_cmd"]
        _check_command(loop, tau_cmd, loop.updates[-1] * np.arange(len(tau_cmd)))
        return _recording(loop, signals)


def _check_inputs(loop: Loop, own: Context) -> None:
    """Refuse a loop with an external reference or controller that nothing is connected to."""
    for port in map(loop.get_input_port, range(loop.num_input_ports())):
        if not port.HasValue(own) and port.get_name() != "extra_load_torque":
            raise InputError(
                f"external, but nothing is connected, expected {port.size()} numbers",
                place=port.get_name(),
            )


def _look(loop: Loop, own: Context) -> None:
    """Check what the controller gets from outside and asks for now; own: context of the loop."""
    if "reference" in loop.logs:
        reference = np.array(loop.GetOutputPort("reference").Eval(own))
        if not np.isfinite(reference).all():
            text = f"{reference} at {own.get_time():.6g} s, expected finite numbers"
            raise InputError(text, place="reference")
    tau_cmd = np.array(loop.GetOutputPort("tau_cmd").Eval(own))
    _check_command(loop, tau_cmd[None], [own.get_time()])


def _check_command(loop: Loop, tau_cmd: Array, time: Array | Sequence[float]) -> None:
    """Refuse commands, shape (N, n), that are not finite, whatever becomes of them in the loop."""
    for i, k in np.argwhere(~np.isfinite(tau_cmd)):
        raise InputError(
            f"{in_errors(loop.design, type(loop.controller))}: tau_cmd of joint {k + 1} is "
            f"{tau_cmd[i, k]} at {time[i]:.6g} s, expected finite numbers"
        )


def _run(simulator: Simulator, loop: Loop) -> None:
    """Advance over the motion; stop at each update where the log does not tell what follows it."""
    # Only the main thread hears Ctrl-C; in others, listening for it would take the interpreter's
    # lock at every step, and let no two runs go at the same time.
    hears = threading.current_thread() is threading.main_thread()
    samples, period = len(loop.design.motion.v) - 1, loop.design.reference.period
    if loop.is_told:
        for end in with_progress(np.unique(np.linspace(0, samples, _SLICES + 1, dtype=int))[1:]):
            simulator.AdvanceTo(end * period, interruptible=hears)
        return
    own = loop.GetMyContextFromRoot(simulator.get_context())
    step = loop.updates[-1]
    for i in with_progress(range(round(samples * period / step))):
        for end in loop.updates[1:]:
            simulator.AdvancePendingEvents()  # and so the torque just after the update is logged
            _look(loop, own)
            until = (i + 1) * step if end == step else i * step + end
            simulator.AdvanceTo(until, interruptible=hears)
            _look(loop, own)
    simulator.AdvancePendingEvents()  # a reference from outside has its last sample only now


def _loop_in(design: Design, diagram: Diagram) -> Loop:
    loops = [system for system in systems_in(diagram) if isinstance(system, Loop)]
    if len(loops) != 1 or loops[0].design is not design:
        raise InputError(
            f"diagram: {diagram.get_name()!r}, expected the loop of the design or a diagram that "
            "has it as a subsystem"
        )
    return loops[0]


def _recording(loop: Loop, signals: Mapping[str, Array]) -> Recording:
    design = loop.design
    if "reference" in signals:  # what came from outside in place of the planned motion
        period, time = design.motion.period, signals["step_time"]
        after = np.searchsorted(time, (np.arange(len(design.wanted.v)) + 1e-6) * period) - 1
        fed = Motion(period, *np.hsplit(signals["reference"][after], 3))
        design = replace(design, wanted=fed, learned=LearnedReference(fed))
    motion, load = design.wanted, design.loads.load_torque
    q, v = np.hsplit(signals["state"], 2)
    q_seen, v_seen = np.hsplit(signals["measured"], 2)
    samples = (len(signals["tau"]) - 1) // (len(q) - 1)
    torques = {name: signals[name][::samples] for name in ("tau_cmd", "tau_limited", "tau")}
    return Recording(
        time=motion.time,
        q_ref=motion.q,
        v_ref=motion.v,
        q=q,
        v=v,
        load_torque=load[arrived(design, motion.time)],  # as a hold has it just before each update
        beyond_stop=_beyond_stop(design, q),
        q_measured=q_seen,
        v_measured=v_seen,
        **torques,
        **period_torque(loop, signals),
    )


def _beyond_stop(design: Design, q: Array) -> Array:
    robot = design.robot
    if design.scenario.plant.kind == "axis":
        return np.zeros_like(q)
    beyond = np.maximum(robot.position_lower - q, q - robot.position_upper)
    return np.asarray(np.maximum(0.0, beyond))
