"""The simulation of a loop."""

import threading
from collections.abc import Mapping, Sequence
from dataclasses import replace
from traceback import extract_tb
from typing import Any, cast

import numpy as np
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context, Diagram

from sdt_drake.io.arguments import finite_number, instance_of
from sdt_drake.io.arrays import Array
from sdt_drake.io.deprecated import renamed
from sdt_drake.io.errors import InputError
from sdt_drake.io.progress import with_progress
from sdt_drake.motion import Motion
from sdt_drake.run.controllers import in_errors, own_code
from sdt_drake.run.design import Design
from sdt_drake.run.loop import Loop, make_loop
from sdt_drake.run.loop_checks import check_inputs
from sdt_drake.run.motor_torque import arrived, period_torque
from sdt_drake.run.probes import Sampler, chosen_ports
from sdt_drake.run.recorded import recorded
from sdt_drake.run.recording import Recording
from sdt_drake.run.scenario import Scenario
from sdt_drake.run.simulation import BY_DEFAULT, SimulationChoice
from sdt_drake.systems.wiring import systems_in

AXIS_ACCURACY_FACTOR = 20.0
"""Factor by which accuracy is tightened on the axis plant.

Motors there saturate for seconds, and the integration error grows until saturation ends.
"""

MIN_ACCURACY = 1e-12
"""Smallest accuracy that Drake accepts."""

MAX_STEPS = 1_000_000
"""Largest number of integrator steps per period; a loop that needs more would not end."""

PILOT = ("specific_force", "angular_rate", "felt_rate", "felt_attitude")
"""Outputs of the pilot in the loop that a run records as probes."""

N_SLICES = 200
"""Number of parts of a run between which progress is reported; they end at samples."""


def make_simulator(
    diagram: Diagram,
    *,
    period: float,
    accuracy: float,
    realtime_rate: float = 0.0,
    simulation: SimulationChoice = BY_DEFAULT,
    context: Context | None = None,
) -> Simulator:
    """Make a simulator for samples every `period` [s]; it is not initialized.

    By default the integrator is an error-controlled Runge-Kutta method of third order. Its largest
    step is a little above the period: with the period itself, every few samples a second step of
    1e-16 s would follow.
    """
    simulator = Simulator(diagram, context)
    new_integrator(simulator, period, accuracy, realtime_rate, simulation)
    return simulator


def new_integrator(
    simulator: Simulator,
    period: float,
    accuracy: float,
    realtime_rate: float = 0.0,
    simulation: SimulationChoice = BY_DEFAULT,
) -> None:
    """Give a simulator the integrator of `make_simulator`, without a memory of earlier steps."""
    largest = simulation.max_step_size
    config = SimulatorConfig(
        integration_scheme=simulation.integration_scheme,
        max_step_size=1.01 * period if largest is None or largest >= period else largest,
        accuracy=accuracy,
        use_error_control=simulation.use_error_control,
        target_realtime_rate=realtime_rate,
    )
    ApplySimulatorConfig(config, simulator)
    integrator = simulator.get_mutable_integrator()
    integrator.set_requested_minimum_step_size(period / MAX_STEPS)
    integrator.set_throw_on_minimum_step_size_violation(True)


def simulate(
    design: Loop | Design | Scenario,
    diagram: Diagram | Loop | None = None,
    *,
    realtime_rate: float = 0.0,
    q: Array | None = None,
    v: Array | None = None,
    probes: Sequence[str] = (),
) -> Recording:
    """Simulate a loop for the duration of its motion, from a steady start on the reference.

    Args:
        design: a loop, or a design or scenario, whose loop is made here.
        diagram: a diagram that contains the diagram of the loop at any depth; by default that
            diagram itself. A loop of the design, as up to 0.4, works until 0.7 and warns.
        realtime_rate: simulated time per real time, 1 to watch in a Meshcat; 0 for full speed.
        q: initial angles, joint side [rad], shape (n,); see `Loop.set_steady_state`.
        v: initial speeds, joint side [rad/s], shape (n,); see `Loop.set_steady_state`.
        probes: outputs of blocks of the diagram to record in `Recording.probes`, beside those of
            the scenario, whose field `probes` describes them.

    Raises:
        InputError: if the diagram lacks the loop, an external reference or controller is not
            connected, a probe names no port, a command is not finite, or the integrator is stuck,
            with the time.

    Examples:
        >>> import numpy as np
        >>> from sdt_drake.motion import Motion
        >>> from sdt_drake.run.design import make_design
        >>> from sdt_drake.run.scenario import load_scenario
        >>> motion = Motion.from_speeds(0.005, np.zeros(4), np.zeros((21, 4)))
        >>> recording = simulate(make_design(load_scenario("axis_pi"), motion=motion))
        >>> recording.q.shape, float(abs(recording.position_error).max())
        ((21, 4), 0.0)
    """
    loop, diagram = _loop_and_diagram(design, diagram)
    design = loop.design
    finite_number(realtime_rate, "realtime_rate", minimum=0)
    period, accuracy = design.reference.held.period, design.scenario.accuracy
    if design.scenario.plant.kind == "axis":
        accuracy = max(accuracy / AXIS_ACCURACY_FACTOR, MIN_ACCURACY)
    simulator = make_simulator(
        diagram,
        period=period,
        accuracy=accuracy,
        realtime_rate=realtime_rate,
        simulation=design.scenario.simulation,
    )
    context, own = simulator.get_mutable_context(), _own_context(loop, simulator)
    sampler = _sampler(loop, probes, simulator)
    with own_code(design, loop.owner):
        check_inputs(loop.diagram, own)
        loop.set_steady_state(own, q, v)
        try:
            simulator.Initialize()
            _look(loop, own)  # Drake's integrator may never end at a NaN
            _run(simulator, loop)
        except RuntimeError as error:
            if error.__traceback__ and extract_tb(error.__traceback__)[-1].filename != __file__:
                raise  # an error of Python code in the loop
            _look(loop, own)
            raise stuck(design, context, error) from None
        signals = recorded(loop.diagram, loop.logs, own, loop.updates[-1])
        tau_cmd = signals["tau_cmd"]
        _check_command(loop, tau_cmd, loop.updates[-1] * np.arange(len(tau_cmd)))
        return replace(_recording(loop, signals), probes=sampler.samples() if sampler else {})


def _sampler(loop: Loop, probes: Sequence[str], simulator: Simulator) -> Sampler | None:
    """Return the sampler of probes that now watches a simulator; None without probes."""
    scenario = loop.design.scenario
    names = scenario.probes
    if loop.diagram.HasSubsystemNamed("pilot"):
        names = (*names, *(f"pilot.{name}" for name in PILOT))
    ports = chosen_ports(loop.diagram, names)
    if probes != ():
        outer = cast(Diagram, simulator.get_system())
        ports |= chosen_ports(outer, scenario.changed({"probes": probes}).probes)
    if not ports:
        return None
    period, root = loop.design.reference.held.period, simulator.get_mutable_context()
    simulator.set_monitor(sampler := Sampler(ports, period, root))
    return sampler


def stuck(design: Design, context: Context, why: object) -> InputError:
    """Return the error of a simulation that does not go on, with its time."""
    where, time = f"scenario '{design.scenario.name}'", context.get_time()
    reason = " ".join(str(why).split())
    return InputError(f"{where}: the simulation is stuck at {time:.6g} s ({reason})")


def _own_context(loop: Loop, simulator: Simulator) -> Context:
    """Return the context of a loop in a simulator."""
    root = simulator.get_mutable_context()
    if simulator.get_system() is loop.diagram:
        return root  # pydrake never frees a context that was asked for itself
    return loop.diagram.GetMyMutableContextFromRoot(root)


def _look(loop: Loop, own: Context) -> None:
    """Check that reference and command of the loop are finite now; `own` is the loop's context."""
    if "reference" in loop.logs:
        reference = np.array(loop.diagram.GetOutputPort("reference").Eval(own))
        if not np.isfinite(reference).all():
            text = f"{reference} at {own.get_time():.6g} s, expected finite numbers"
            raise InputError(text, place="reference")
    tau_cmd = np.array(loop.diagram.GetOutputPort("tau_cmd").Eval(own))
    _check_command(loop, tau_cmd[None], [own.get_time()])


def _check_command(loop: Loop, tau_cmd: Array, time: Array | Sequence[float]) -> None:
    """Check that commands, shape (N, n), are finite, even if limits would cut them."""
    for i, k in np.argwhere(~np.isfinite(tau_cmd)):
        raise InputError(
            f"{in_errors(loop.design, loop.owner)}: tau_cmd of joint {k + 1} is "
            f"{tau_cmd[i, k]} at {time[i]:.6g} s, expected finite numbers"
        )


def _run(simulator: Simulator, loop: Loop) -> None:
    """Advance over the motion, with a stop at each update if the command after it is unknown."""
    # Only the main thread receives Ctrl-C. In other threads, checking for it would take the
    # interpreter's lock at every step, so that runs could not go in parallel.
    interruptible = threading.current_thread() is threading.main_thread()
    samples, period = len(loop.design.reference.tracked.v) - 1, loop.design.reference.held.period
    simulator.AdvancePendingEvents()  # the first row of the log is that after the first update
    if loop.feedthrough is not None:
        for end in with_progress(np.unique(np.linspace(0, samples, N_SLICES + 1, dtype=int))[1:]):
            simulator.AdvanceTo(end * period, interruptible=interruptible)
        return
    own, step = _own_context(loop, simulator), loop.updates[-1]
    for i in with_progress(range(round(samples * period / step))):
        for end in loop.updates[1:]:
            simulator.AdvancePendingEvents()  # so that the torque just after the update is logged
            _look(loop, own)
            until = (i + 1) * step if end == step else i * step + end
            simulator.AdvanceTo(until, interruptible=interruptible)
    simulator.AdvancePendingEvents()  # an external reference has its last sample only now


def _loop_and_diagram(
    design: Loop | Design | Scenario, diagram: Diagram | Loop | None
) -> tuple[Loop, Diagram]:
    """Return the loop to simulate, and the diagram to simulate it in."""
    if isinstance(diagram, Loop):
        loop = diagram
        if design not in (loop, loop.design, loop.design.scenario):
            name = loop.diagram.get_name()
            raise InputError(f"{name!r}, expected the loop of the design", place="diagram")
        renamed("simulate(design, loop)", "simulate(loop)", stacklevel=4)
        return loop, loop.diagram
    if diagram is not None:
        instance_of(Diagram, "DiagramBuilder.Build")(diagram, "diagram")
    loop = design if isinstance(design, Loop) else make_loop(design)
    if diagram is None:
        return loop, loop.diagram
    if not any(system is loop.diagram for system in systems_in(diagram)):
        raise InputError(
            f"{diagram.get_name()!r}, expected a diagram that contains that of the loop",
            place="diagram",
        )
    return loop, diagram


def _recording(loop: Loop, signals: Mapping[str, Array]) -> Recording:
    """Return the recording of a run from the logged signals."""
    design = loop.design
    motion, loads = design.reference.planned, design.loads
    held = arrived(design, motion.time)
    if "reference" in signals:  # an external reference takes the place of the planned motion
        period, time, index = motion.period, signals["step_time"], np.arange(len(motion.v))
        after = np.searchsorted(time, (index + 1e-6) * period) - 1
        motion = Motion(period, *np.hsplit(signals["reference"][after], 3))
        loads, held = design.loads_along(motion), np.maximum(index - 1, 0)
    q, v = np.hsplit(signals["state"], 2)
    q_seen, v_seen = np.hsplit(signals["measured"], 2)
    samples = (len(signals["tau"]) - 1) // (len(q) - 1)
    torques: dict[str, Any] = {
        name: signals[name][::samples] for name in ("tau_cmd", "tau_limited", "tau")
    }
    return Recording(
        time=motion.time,
        q_ref=motion.q,
        v_ref=motion.v,
        q=q,
        v=v,
        load_torque=loads.load_torque[held],  # held just before each update
        beyond_stop=_beyond_stop(design, q),
        q_measured=q_seen,
        v_measured=v_seen,
        winding_temperature=signals.get("winding_temperature"),
        **(torques | period_torque(loop, signals)),
    )


def _beyond_stop(design: Design, q: Array) -> Array:
    """Return the angle by which joints exceed their stops [rad]; 0 on the axis plant."""
    robot = design.device.simulated
    if design.scenario.plant.kind == "axis":
        return np.zeros_like(q)
    beyond = np.maximum(robot.position_lower - q, q - robot.position_upper)
    return np.asarray(np.maximum(0.0, beyond))
