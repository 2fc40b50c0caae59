"""The logs of a run, and the command just after each update of its inputs."""

from collections.abc import Mapping

import numpy as np
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort, System
from pydrake.systems.primitives import VectorLogSink

from sdt_drake.io.arrays import Array, Index
from sdt_drake.run.controllers import SHIPPED
from sdt_drake.run.design import Design
from sdt_drake.systems import add_meter, arrival
from sdt_drake.systems.wiring import add_logs

_TORQUES = ("tau_cmd", "tau_limited", "tau")


def add_run_logs(
    builder: DiagramBuilder, design: Design, signals: Mapping[str, OutputPort], *, is_planned: bool
) -> dict[str, VectorLogSink]:
    """Add the logs of a `Recording`; return their sinks by the name of the signal.

    States are logged at the interpolation period, torques at the integrator's steps.
    """
    torques = {name: signals[name] for name in _TORQUES}
    if design.drive.is_ideal_torque:  # tau is equal, but a block later in each derivative
        torques["tau"] = signals["tau_limited"]
    limit = design.device.simulated.motor_torque_limit
    each_step = {"torques": add_meter(builder, motor_torque_limit=limit, **torques)}
    if design.envelope is not None:
        each_step["motor_state"] = signals["motor_state"]
    if not is_planned:
        each_step["reference"] = signals["reference"]
    kept = ("state", "measured", "winding_temperature")
    states = {name: signals[name] for name in kept if name in signals}
    sampled = add_logs(builder, states, design.reference.held.period)
    return sampled | add_logs(builder, each_step, None)


def recorded(
    diagram: Diagram, sinks: Mapping[str, VectorLogSink], context: Context, period: float
) -> dict[str, Array]:
    """Return the logged signals by name, each of shape (samples, size).

    Torques are those just before each update of the drives, or of the reference for continuous
    drives; the first are those just after the update. "torques" has them side by side at the ends
    of the integrator's steps, at the times "step_time". An update at which a run stopped has two
    rows there.

    Args:
        diagram: the diagram of the loop.
        sinks: the sinks of `add_run_logs`.
        context: the context of the diagram after the run.
        period: period of `update_times` [s].
    """
    logs = {
        name: sink.GetLog(diagram.GetSubsystemContext(sink, context))
        for name, sink in sinks.items()
    }
    signals = {name: np.array(log.data().T) for name, log in logs.items()}
    times = signals["step_time"] = np.array(logs["torques"].sample_times())
    count = round(times[-1] / period) + 1
    at = np.searchsorted(times, (np.arange(count) - 1e-6) * period)
    at[0] = np.searchsorted(times, 0.0, "right") - 1
    torques = np.hsplit(signals["torques"][at], 4)[:3]
    return signals | dict(zip(_TORQUES, torques, strict=True))


# --- the command just after updates ------------------------------------------------------------


def update_times(design: Design, delay: float) -> Array:
    """Return the times of updates of the controller's inputs within a period, from 0 to it [s].

    The period is that of the drives, or of the reference for continuous drives.

    Args:
        design: the design of the loop.
        delay: delay of the reference [s].
    """
    period = design.drive.period or design.reference.held.period
    late = arrival(delay, period)
    return np.array([0.0, period] if late == 0 else [0.0, late, period])


HELD = ("reference", "sampled_state")
"""Inputs of a controller that change at samples of the reference alone."""


def feedthrough(controller: System, owner: type, *, sampled: bool) -> dict[str, Array] | None:
    """Return D of each held input of a controller, by name; None if there is no such D.

    The command just after an update is the one before + D (u after - u before), if the command is
    linear in the held inputs u, and nothing else in the controller changes at updates. In sampled
    drives all inputs are held, and the result is empty. A loop without D stops at each update, to
    evaluate the command.

    Args:
        controller: the system that commands the torque.
        owner: its class.
        sampled: True for sampled drives.
    """
    if owner not in SHIPPED.values():  # your own may have any law
        return None
    if sampled or not controller.HasInputPort("measured"):
        return {}
    context = controller.CreateDefaultContext()
    if context.num_discrete_state_groups():
        return None
    ports = [controller.get_input_port(i) for i in range(controller.num_input_ports())]

    def command(inputs: Mapping[str, Array]) -> Array:
        for port in ports:
            port.FixValue(context, inputs.get(port.get_name(), np.zeros(port.size())))
        return np.array(controller.get_output_port().Eval(context))

    rest = command({})
    held = {port.get_name(): port.size() for port in ports if port.get_name() in HELD}
    D = {
        name: np.array([command({name: unit}) - rest for unit in np.eye(size)]).T
        for name, size in held.items()
    }
    generator = np.random.default_rng(0)
    inputs = {port.get_name(): generator.normal(size=port.size()) for port in ports}
    without = {name: np.zeros(size) for name, size in held.items()}
    change = command(inputs) - command(inputs | without)
    expected = sum(D[name] @ inputs[name] for name in held)
    return D if np.allclose(change, expected, rtol=1e-9) else None


def after_updates(
    design: Design, D: Mapping[str, Array], tau_cmd: Array, measured: Array, held: Index
) -> Array:
    """Return the command just after each update, motor side [N m], shape (M, n).

    Args:
        design: the design of the loop that was run.
        D: the `feedthrough` of its controller.
        tau_cmd: command just before each of M + 1 updates [N m], shape (M + 1, n).
        measured: q and v measured at the samples of the reference, joint side [rad, rad/s], shape
            (N + 1, 2 n); M = N if D is not empty.
        held: sample of the reference in force after each update, shape (M,).
    """
    if not D:
        return tau_cmd[1:]  # held until the next update
    before = np.maximum(np.arange(len(held)) - 1, 0)
    reference = design.reference.held
    values = {
        "reference": np.hstack([reference.q, reference.v, reference.vd])[held],
        "sampled_state": measured[:-1],
    }
    jump = (
        np.zeros_like(tau_cmd[1:])
        if design.tuning.feedforward.along is None
        else design.tuning.feedforward.along[held]
    )
    for name, gain in D.items():
        jump = jump + values[name] @ gain.T
    return tau_cmd[:-1] + jump - jump[before]
