"""The response of a loop to a step at one of its inputs, at rest or while it moves."""

from dataclasses import asdict, dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import DiagramBuilder, OutputPort, System
from pydrake.systems.primitives import Adder

from sdt_drake.analysis.step import StepMetrics, step_metrics
from sdt_drake.io.arguments import chosen_joints, finite_number, one_of, positive
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.progress import with_progress
from sdt_drake.io.results import Results
from sdt_drake.io.shown import Figure, Shown, Summary, formatted, higher, listed, numbered
from sdt_drake.run.controllers import make_controller, own_code, start_controller
from sdt_drake.run.design import Design, as_design
from sdt_drake.run.device import equilibrium
from sdt_drake.run.loop import Loop, make_loop
from sdt_drake.run.plant import steady
from sdt_drake.run.scenario import Scenario
from sdt_drake.run.simulate import MIN_ACCURACY, make_simulator, stuck
from sdt_drake.systems import signal_table

INPUTS = {"reference": "rad/s", "extra_load_torque": "N m", "tau_cmd": "N m"}
"""Inputs that can step, and the units of a step; see `step`."""

OUTPUTS = {"v": "rad/s", "position_error": "rad", "tau_cmd": "N m", "tau": "N m"}
"""Outputs that have metrics, and their units."""

SAMPLES = 10
"""Samples of a response per period of the reference."""

SHOWN = 1e-3
"""Share of the largest peak of all joints below which the response of a joint is not printed."""

MAX_SIZE = 1e6
"""Largest step [rad/s or N m]: responses to larger ones exceed the range of numbers."""

DURATION = 50.0
"""Duration of a response, over 1 / omega_n of the slowest speed loop [-]."""

ACCURACY_FACTOR = 20.0
"""Factor by which accuracy is tightened: a response is the difference of two runs."""


@dataclass(frozen=True, eq=False, repr=False)
class LoopStep(Shown):
    """The response of a loop to a step: each signal less that of the same run without the step.

    Signals are those just after the updates at their instants, so torques show the step itself.
    """

    design: Design
    """The design of the loop."""
    input: str
    """Name of the input, one of INPUTS."""
    joint: int
    """Number of the joint, 1..n."""
    size: float
    """Size of the step: joint side [rad/s] for the reference, motor side [N m] for torques."""
    at: float
    """Time of the step since the start of the motion [s]."""
    time: Array
    """Time since the step [s], shape (N,)."""
    q: Array
    """Response of the links' positions, joint side [rad], shape (N, n)."""
    v: Array
    """Response of the links' speeds, joint side [rad/s], shape (N, n)."""
    tau_cmd: Array
    """Response of the commanded torque, motor side [N m], shape (N, n)."""
    tau: Array
    """Response of the motors' torque, motor side [N m], shape (N, n)."""
    saturated: NDArray[np.bool_]
    """True where a limit cuts the command of a motor in the run with the step, shape (N, n)."""

    @property
    def position_error(self) -> Array:
        """Response of q - q_ref, joint side [rad], shape (N, n).

        A step of the reference is one of its speed: q_ref grows from then on.
        """
        moved = np.zeros_like(self.q)
        if self.input == "reference":
            moved[:, self.joint - 1] = self.size * self.time
        return self.q - moved

    @cached_property
    def metrics(self) -> dict[str, tuple[StepMetrics, ...]]:
        """Metrics of each of OUTPUTS, one for each joint.

        An ideal loop follows its reference and resists its load. The speed goes to a step of the
        reference, the torque to a step of the load, and everything else returns to 0.
        """
        final = {name: np.zeros(self.v.shape[1]) for name in OUTPUTS}
        follows = {"reference": ("v",), "extra_load_torque": ("tau_cmd", "tau")}
        for name in follows.get(self.input, ()):
            final[name][self.joint - 1] = self.size
        return {
            name: tuple(
                step_metrics(self.time, y, y0=0.0, y_final=float(goal))
                for y, goal in zip(getattr(self, name).T, goals, strict=True)
            )
            for name, goals in final.items()
        }

    def summary(self) -> Summary:
        names = numbered(self.design.device.simulated.joint_names)
        rows = []
        for output, unit in OUTPUTS.items():
            if output == "tau" and np.array_equal(self.tau, self.tau_cmd):
                continue
            least = SHOWN * max(abs(m.peak) for m in self.metrics[output])
            for name, m in zip(names, self.metrics[output], strict=True):
                if abs(m.peak) > least:
                    numbers = (formatted(x, ".4g") for x in asdict(m).values())
                    rows.append([f"{output} [{unit}]", name, *numbers])
        header = ["response", "joint", "rise [s]", "settling [s]", "overshoot [%]"]
        header += ["peak", "after [s]", "steady-state error"]
        return Summary(self.title, header, rows, 2)

    @property
    def title(self) -> str:
        """Loop, input, size and instant of the step, and motors that saturate, in words."""
        robot, scenario = self.design.device.simulated, self.design.scenario.name
        size, joint = f"{self.size:+.4g} {INPUTS[self.input]}", robot.joint(self.joint - 1)
        title = f"of {scenario}: {self.input} {size}, {joint}, at {self.at:.6g} s"
        cut = [robot.joint(k) for k in np.flatnonzero(self.saturated.any(axis=0)).tolist()]
        return f"{title}; limits cut the torque of {listed(cut)}" if cut else title

    def results(self) -> Results:
        """Return the responses as columns, with the metrics of each output by joint."""
        about = {x: getattr(self, x) for x in ("input", "joint", "size", "at")}
        metrics = {name: list(map(asdict, by_joint)) for name, by_joint in self.metrics.items()}
        signals = {name: getattr(self, name) for name in ("time", "q", *OUTPUTS, "saturated")}
        signals["saturated"] = signals["saturated"].astype(int)
        scenario = self.design.scenario.name
        units = {**OUTPUTS, "q": "rad", "saturated": "-", "at": "s", "size": INPUTS[self.input]}
        return Results({"scenario": scenario, **about, "metrics": metrics}, signals, units)

    def plot(self) -> Figure:
        """Return a figure of all responses, a row for each joint."""
        return higher("show.figures.runs:loop_step")(self)


def step(
    design: Design | Scenario | Loop,
    *,
    input: str = "reference",
    joint: int = 1,
    size: float | None = None,
    at: float = 0.0,
    duration: float | None = None,
) -> LoopStep:
    """Simulate a loop with and without a step at one of its inputs, and return the difference.

    Inputs:

    - `reference`: the controller gets a speed reference that is higher by `size` from `at` on, and
      its integral as position. Torques along the planned motion (feedforward, load of the axis
      plant) do not change.
    - `extra_load_torque`: a further load of the motor.
    - `tau_cmd`: a torque that is added to the command of the controller, before the saturation.

    Args:
        design: a design, a scenario, which is resolved here, or the loop of a scenario's own
            controller, which stands for its design; its other arguments are not taken over.
        input: one of `reference`, `extra_load_torque`, `tau_cmd`.
        joint: number of the joint, 1..n.
        size: size of the step, not 0: joint side [rad/s] for the reference, motor side [N m] for
            torques. By default a tenth of the motor's torque limit, or the speed error at which
            K_PS commands that torque.
        at: time of the step, a sample of the motion [s].
        duration: time after the step, rounded to whole periods [s]. By default 50 / omega_n of the
            slowest speed loop, or the rest of the motion.

    Raises:
        InputError: if an argument is wrong, or the simulation fails.

    Examples:
        >>> from sdt_drake.run.scenario import load_scenario
        >>> scenario = load_scenario("coupled_pi", {"motion": "leans"})
        >>> response = step(scenario, input="extra_load_torque", joint=1, size=10.0)
        >>> print(f"{response.metrics['v'][0].peak:.6f} rad/s")
        -0.000417 rad/s
    """
    design = _as_design(design)
    one_of(input, "input", tuple(INPUTS))
    (k,) = chosen_joints(0 if joint is None else joint, design.device.simulated.n)
    if size is None:
        size = 0.1 * float(design.device.simulated.motor_torque_limit[k])
        if input == "reference":
            size /= float(design.tuning.gains.kp[k] * design.device.simulated.gear_ratio[k])
    size = finite_number(size, "size")
    if not 0 < abs(size) <= MAX_SIZE:
        raise InputError(
            f"{size:g}, expected a number that is not 0, up to {MAX_SIZE:g}", place="size"
        )
    # Its feedforward stays that of the planned motion, also if the reference steps.
    design = replace(design, scenario=replace(design.scenario, inverse_dynamics="table"))
    first, count = _samples(design, at, duration)
    with_step, without = (_run(design, input, k, x, first, count) for x in (size, 0.0))
    n = design.device.simulated.n
    q, v, tau_cmd, tau = np.split(with_step[:, : 4 * n] - without[:, : 4 * n], 4, axis=1)
    limited = with_step[:, 4 * n :]
    return LoopStep(
        design=design,
        input=input,
        joint=joint,
        size=size,
        at=first * design.reference.held.period,
        time=design.reference.held.period / SAMPLES * np.arange(len(v), dtype=float),
        q=q,
        v=v,
        tau_cmd=tau_cmd,
        tau=tau,
        saturated=limited != with_step[:, 2 * n : 3 * n],
    )


def _as_design(design: Design | Scenario | Loop) -> Design:
    """Return a design, that of a scenario, or that of a loop of its own controller."""
    if not isinstance(design, Loop):
        return as_design(design)
    own = type(design.design.scenario.controller)
    if design.owner is not own or not design.is_planned:
        raise InputError(
            "a loop with a reference or a controller from outside, expected one with those of its "
            "scenario (your own controller: register_controller)",
            place="design",
        )
    return design.design


def _samples(design: Design, at: float, duration: float | None) -> tuple[int, int]:
    """Return the sample of the step, and the number of periods after it."""
    period, end = design.reference.tracked.period, len(design.reference.tracked.v) - 1
    at = finite_number(at, "at", minimum=0)
    first = round(at / period)
    if abs(first * period - at) > 1e-6 * period or first >= end:
        raise InputError(
            f"{at:.9g} s, expected a multiple of {period:g} s before the end of the motion, "
            f"{end * period:.9g} s",
            place="at",
        )
    left = end - first
    if duration is None:
        return first, min(left, int(np.ceil(DURATION / design.tuning.omega_n.min() / period)))
    periods = positive(duration, "duration") / period
    if periods > left * (1 + 1e-9):
        text = f"{duration:.9g} s, but the motion ends {left * period:.9g} s after the step"
        raise InputError(text, place="duration")
    return first, max(1, round(periods))


# --- the two runs ------------------------------------------------------------------------------


def _run(design: Design, input: str, k: int, size: float, first: int, count: int) -> Array:
    """Run a loop with a step of joint k at a sample, and return the signals after it.

    Returns:
        Rows [q, v, tau_cmd, tau, tau_limited] just after the updates at the samples of the
        response, shape (SAMPLES count + 1, 5 n).
    """
    reference, n = design.reference.held, design.device.simulated.n
    period = reference.period
    added = np.zeros((len(reference.v), 3 * n if input == "reference" else n))
    added[first:, n + k if input == "reference" else k] = size
    if input == "reference":
        added[first:, k] = size * period * np.arange(len(added) - first)
    owner, inner = make_controller(design)
    is_load = input == "extra_load_torque"
    stepped = None if is_load else _with_step(design, inner, input, added)
    loop = make_loop(design, controller=stepped)
    builder, diagram = DiagramBuilder(), loop.diagram
    builder.AddNamedSystem("loop", diagram)
    if is_load:
        load = signal_table(motion=reference, signals={"step": added})
        builder.AddNamedSystem("step", load)
        builder.Connect(load.get_output_port(), loop.GetInputPort("extra_load_torque"))
    accuracy = max(design.scenario.accuracy / ACCURACY_FACTOR, MIN_ACCURACY)
    chosen = design.scenario.simulation
    simulator = make_simulator(builder.Build(), period=period, accuracy=accuracy, simulation=chosen)
    context = simulator.get_mutable_context()
    own = diagram.GetMyMutableContextFromRoot(context)
    saturation = diagram.GetSubsystemByName("dynamic_saturation")
    ports = [*map(diagram.GetOutputPort, ("state", "tau_cmd", "tau")), saturation.get_output_port()]
    contexts = [own] * 3 + [diagram.GetSubsystemContext(saturation, own)]
    rows, instants = [], [(i, 0) for i in range(first)]
    instants += [(first + i // SAMPLES, i % SAMPLES) for i in range(SAMPLES * count + 1)]
    with own_code(design, owner):
        loop.set_steady_state(own)
        if not is_load:  # the controller is inside the system that adds the step
            tau_cmd = equilibrium(design, steady(design.reference.tracked)).tau_cmd
            inside = inner.GetMyMutableContextFromRoot(context)
            start_controller(owner, inner, inside, design, tau_cmd, None)
        for sample, part in with_progress(instants):
            try:
                simulator.AdvanceTo(sample * period + part * (period / SAMPLES))
                simulator.AdvancePendingEvents()  # so that the row is just after the updates
                evaluated = map(OutputPort.Eval, ports, contexts)
                row = np.concatenate([*evaluated])
            except RuntimeError as error:
                raise stuck(design, context, error) from None
            if not np.isfinite(row).all():
                raise stuck(design, context, "signals are not finite")
            rows.append(row)
    return np.array(rows[first:])


def _with_step(design: Design, controller: System, input: str, added: Array) -> System:
    """Return a controller with a step at its reference or at its command."""
    delay = design.drive.reference_delay if input == "reference" else 0.0
    builder = DiagramBuilder()
    builder.AddNamedSystem("controller", controller)
    table = signal_table(motion=design.reference.held, signals={"step": added}, delay=delay)
    step_port = builder.AddNamedSystem("step", table).get_output_port()
    total = builder.AddNamedSystem("sum", Adder(2, added.shape[1]))
    builder.Connect(step_port, total.get_input_port(1))
    output = controller.get_output_port()
    for port in map(controller.get_input_port, range(controller.num_input_ports())):
        if port.get_name() == input == "reference":
            builder.ExportInput(total.get_input_port(0), input)
            builder.Connect(total.get_output_port(), port)
        else:
            builder.ExportInput(port, port.get_name())
    if input == "reference":
        builder.ExportOutput(output, output.get_name())
    else:
        builder.Connect(output, total.get_input_port(0))
        builder.ExportOutput(total.get_output_port(), output.get_name())
    return builder.Build()
