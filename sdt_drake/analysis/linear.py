"""Linear models of the loops: process and feedback linearised by Drake and closed in numpy.

Process and feedback are linearised separately, so that each sampled part is closed exactly with its
own period. A slower part is closed around the zero-order-hold map of the faster parts.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context, System
from pydrake.systems.primitives import FirstOrderTaylorApproximation

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.motion import Motion
from sdt_drake.run.design import Design, as_design
from sdt_drake.run.device import equilibrium, make_device, measured_port, set_device, viscous_only
from sdt_drake.run.scenario import Scenario
from sdt_drake.systems.state_space import LinearModel, StateSpace
from sdt_drake.systems.wiring import blocks_of


@dataclass(frozen=True, eq=False)
class LinearLoop:
    """A loop of n joints, linear around a sample of its motion, and cut once per joint.

    Loops with one period, or without any, are cut at the torque command of the feedback. A feedback
    that also measures positions with a slower period is cut at these samples; its faster loop stays
    closed.
    """

    opened: StateSpace
    """Open loop from [cut (n), reference (3n), tau_ff (n)] to [measured (2n), state (2n), tau_fb
    (n)]."""
    at_positions: bool
    """True if the loop is cut at the sampled positions."""
    n: int
    """Number of joints."""

    def loop_gain(self, omega: Array) -> NDArray[np.complex128]:
        """Return the loop gain at the cut of each joint, all others closed [-], (len(omega), n)."""
        n = self.n
        H = -self.opened.response(omega)[:, self._back, :n]
        gain = np.empty((len(omega), n), dtype=complex)
        for k in range(n):
            o = [j for j in range(n) if j != k]
            others = np.eye(n - 1) + H[:, o][:, :, o]
            through = H[:, [k]][:, :, o] @ np.linalg.solve(others, H[:, o][:, :, [k]])
            gain[:, k] = H[:, k, k] - through[:, 0, 0]
        return gain

    def tracking(self, omega: Array) -> NDArray[np.complex128]:
        """Return v / v_ref of each joint's link, all loops closed [-], shape (len(omega), n).

        There is no feedforward; q_ref and vd_ref are the integral and the derivative of v_ref.
        """
        n, s = self.n, 1j * omega[:, None]
        v = self.whole().response(omega)[:, 3 * n : 4 * n]
        q_ref, v_ref, vd_ref = (np.einsum("ikk->ik", v[:, :, k : k + n]) for k in (0, n, 2 * n))
        return q_ref / s + v_ref + s * vd_ref

    def whole(self) -> StateSpace:
        """Return the closed loop of all joints.

        Inputs are [reference (3n), tau_ff (n)], outputs [measured (2n), state (2n), tau_fb (n)].
        tau_ff is added to the feedback torque [N m], motor side. States of the process come before
        those of the feedback.
        """
        return self.opened.close_loop(self._back, slice(0, self.n))

    @property
    def _back(self) -> slice:
        """Outputs that are fed back to the cut."""
        return slice(self.n) if self.at_positions else slice(4 * self.n, None)

    def closed(self, *joints: int) -> StateSpace:
        """Return the closed loop from v_ref of joints to v of their links, minimal.

        q_ref is the integral of v_ref, and vd_ref is 0. States that are not between inputs and
        outputs are removed: on decoupled axes, those of the other joints.

        Args:
            joints: joints, counted from 0; all by default.
        """
        loop, n, k = self.whole(), self.n, np.array(joints or range(self.n))
        m, one = len(k), np.eye(len(k))
        rest = float(loop.period > 0)  # integrators of q_ref: x+ = x, or x' = 0
        A = np.block([[loop.A, loop.B[:, k]], [np.zeros((m, len(loop.A))), rest * one]])
        B = np.vstack([loop.B[:, n + k], (loop.period or 1.0) * one])
        C = np.hstack([loop.C[3 * n + k], 0 * one])
        states = (*loop.states, *(f"q_ref_{i + 1}" for i in k))
        return StateSpace(A, B, C, 0 * one, loop.period, states).structurally_minimal()


def linear(design: Design | Scenario, sample: int = 0, *, at_rest: bool = False) -> LinearModel:
    """Return the closed loop of a design as a linear model with named states, inputs and outputs.

    The loop is linearised at the angles and speeds of a sample of the motion. Inputs are q_ref,
    v_ref, vd_ref (joint side) and tau_ff, a torque added to the feedback (motor side); outputs are
    q, v and tau_cmd. `linearise` lists the effects that the model includes.

        >>> import sdt_drake as sdt
        >>> model = sdt.linear(sdt.load("package://sdt/scenarios/axis_pi.yaml"))
        >>> model.A.shape, model.inputs[4:8], model.period
        ((12, 12), ('v_ref_1', 'v_ref_2', 'v_ref_3', 'v_ref_4'), 0.0)

    Args:
        design: the design, or a scenario.
        sample: index of the sample of the motion.
        at_rest: whether to linearise at the angles of the sample without its speeds.

    Raises:
        InputError: the motion has no such sample, or the controller cannot be linearised.
    """
    design = as_design(design)
    last = len(design.reference.tracked.v) - 1
    is_whole = isinstance(sample, int | np.integer) and not isinstance(sample, bool)
    if not (is_whole and 0 <= sample <= last):
        raise InputError(f"{sample!r}, expected a whole number from 0 to {last}", place="sample")
    loop = linearise(design, sample, at_rest=at_rest).whole()
    n = design.device.simulated.n
    torque = np.hstack([np.zeros((n, 3 * n)), np.eye(n)])  # tau_ff is added to the feedback
    loop = replace(
        loop,
        C=loop.C[2 * n :],
        D=np.vstack([loop.D[2 * n : 4 * n], loop.D[4 * n :] + torque]),
    ).structurally_minimal()
    inputs = _of_joints(n, "q_ref", "v_ref", "vd_ref", "tau_ff")
    outputs = _of_joints(n, "q", "v", "tau_cmd")
    return LinearModel(
        loop.A, loop.B, loop.C, loop.D, loop.period, loop.states, tuple(inputs), tuple(outputs)
    )


def _of_joints(n: int, *names: str) -> list[str]:
    """Return the names with the number of each joint, "q_1" to "q_n" for "q"."""
    return [f"{name}_{k + 1}" for name in names for k in range(n)]


def _state_names(system: System) -> list[str]:
    """Return names of the states, after the blocks that own them."""
    names = []
    for block in blocks_of(system):  # in the order of their states
        context = block.CreateDefaultContext()
        size = context.num_continuous_states() or context.num_total_states()
        names += _of_joints(size, block.get_name())
    return names


def linearise(design: Design, sample: int = 0, *, at_rest: bool = False) -> LinearLoop:
    """Return the loop of a design, linear around a sample of its motion.

    The loop is in steady motion at the angles and speeds of the sample, without acceleration; with
    `at_rest` without speeds. So the plant's model has the centrifugal stiffness and the Coriolis
    torques of these speeds. Angles are taken as constant, although joints turn on.

    Each sampled part has its own period: the speed loop of the drive, the position loop of a
    cascade, a controller of the whole state. The model is exact at the samples of the slowest part.
    With encoders of finite resolution, speeds are differences of positions, as in the loop; the
    increments themselves are left out. So is the delay of the reference: positions are sampled when
    it arrives.
    """
    at = operating_point(design, sample, at_rest=at_rest)
    return close(design, linear_process(design, at), linear_feedback(design, sample, at))


def operating_point(design: Design, sample: int, *, at_rest: bool = False) -> Motion:
    """Return a sample of the motion without its acceleration, and at rest without its speed."""
    motion = design.reference.tracked
    still, v = np.zeros((1, motion.n)), motion.v[[sample]]
    return Motion(motion.period, motion.q[[sample]], still if at_rest else v, still)


def close(design: Design, process: StateSpace, feedback: StateSpace) -> LinearLoop:
    """Return the loop of a process and a feedback, each sampled as in the design."""
    n, period = design.device.simulated.n, design.reference.held.period
    is_late = design.drive.encoder_resolution is not None  # speeds are then differences
    by_state, by_samples = (
        bool(feedback.B[:, ports].any() or feedback.D[:, ports].any())
        for ports in (slice(3 * n, 5 * n), slice(5 * n, None))
    )
    # The torque depends on the slow samples alone, and changes only at these.
    is_slow = by_samples and not by_state and not len(feedback.structurally_minimal().A)
    step = period if is_slow else feedback.period or design.drive.period or 0.0
    if step:
        process = process.sampled(step)
        if is_late:
            process = process.by_differences(_of_joints(n, "q_before"))
        feedback = feedback if feedback.period else feedback.sampled(step)
    torque, samples, measured = slice(n), slice(n, 3 * n), slice(2 * n)
    series = _in_series(process, feedback)
    if is_slow or not by_samples:
        return LinearLoop(series.close_loop(measured, samples), False, n)
    slow = series.close_loop(slice(4 * n, None), torque).sampled(period)
    if is_late:
        slow = slow.by_differences(_of_joints(n, "q_sampled_before"))
    return LinearLoop(slow.close_loop(slice(n, 2 * n), slice(n, 2 * n)), True, n)


def _in_series(process: StateSpace, feedback: StateSpace) -> StateSpace:
    """Return process and feedback in series, the loop still open.

    Inputs are [torque (n), samples (2n), reference (3n), tau_ff (n)], outputs [measured (2n),
    state (2n), tau_fb (n)].
    """
    n, x = process.B.shape[1], len(feedback.A)
    by_reference, by_state, by_samples = np.hsplit(feedback.B, [3 * n, 5 * n])
    D_reference, D_state, D_samples = np.hsplit(feedback.D, [3 * n, 5 * n])
    measured, torque = process.C[: 2 * n], process.B  # no direct feedthrough: D is 0
    none, no_torque, at_once = np.zeros((len(torque), 5 * n)), np.zeros((x, n)), np.zeros((n, n))
    return StateSpace(
        A=np.block([[process.A, np.zeros((len(torque), x))], [by_state @ measured, feedback.A]]),
        B=np.block([[torque, none, torque], [no_torque, by_samples, by_reference, no_torque]]),
        C=np.block([[process.C, np.zeros((4 * n, x))], [D_state @ measured, feedback.C]]),
        D=np.block([[np.zeros((4 * n, 7 * n))], [at_once, D_samples, D_reference, at_once]]),
        period=process.period,
        states=process.states + feedback.states,
    )


def linear_process(design: Design, start: Motion) -> StateSpace:
    """Return the continuous linear process from tau (n) to [measured (2n), state (2n)].

    The links have angles and speeds of `start`, the motors the torque that keeps the speeds. Motors
    do not saturate, and friction is viscous.
    """
    design = viscous_only(design)
    diagram, n = make_device(design), design.device.simulated.n
    at = equilibrium(design, start, of_links=True)
    context = diagram.CreateDefaultContext()
    set_device(diagram, context, design, at)
    diagram.GetInputPort("tau_limited").FixValue(context, at.tau_cmd)
    diagram.GetInputPort("extra_load_torque").FixValue(context, np.zeros(n))
    parts = [_taylor(diagram, context, "tau_limited", x) for x in (measured_port(design), "state")]
    C, D = np.vstack([part.C for part in parts]), np.vstack([part.D for part in parts])
    states = (*_of_joints(n, "q", "v"), *parts[0].states[2 * n :])  # the plant's are the first
    return replace(parts[0], C=C, D=D, states=states)


def linear_feedback(design: Design, sample: int, start: Motion) -> StateSpace:
    """Return the linear feedback, with the period of its own states.

    Inputs are [reference (3n), measured (2n), sampled_state (2n)], the output is tau_fb (n).
    Encoders are ideal and without delay. `start` is the operating point of the sample.

    Raises:
        InputError: the controller cannot be linearised.
    """
    n = design.device.simulated.n
    controller = design.scenario.controller.linear(design, sample)
    at = np.concatenate([start.q[0], start.v[0]])
    steady = {"reference": np.append(at, np.zeros(n)), "measured": at, "sampled_state": at}
    context = controller.CreateDefaultContext()
    ports = [controller.get_input_port(i) for i in range(controller.num_input_ports())]
    for port in ports:
        port.FixValue(context, steady[port.get_name()])
    output = controller.get_output_port().get_name()  # tau_fb, or tau_cmd of your own
    parts = {p.get_name(): _taylor(controller, context, p.get_name(), output) for p in ports}
    one = parts["reference"]  # all have the same states
    B, D = (
        [
            getattr(parts[name], by) if name in parts else np.zeros((len(getattr(one, by)), len(x)))
            for name, x in steady.items()
        ]
        for by in ("B", "D")
    )
    return replace(one, B=np.hstack(B), D=np.hstack(D))


def _taylor(system: System, context: Context, input_name: str, output_name: str) -> StateSpace:
    """Return Drake's linearisation of a system from one named port to another."""
    if context.num_discrete_state_groups() > 1:
        return _by_updates(system, context, input_name, output_name)
    taylor = FirstOrderTaylorApproximation(
        system,
        context,
        input_port_index=system.GetInputPort(input_name).get_index(),
        output_port_index=system.GetOutputPort(output_name).get_index(),
    )
    return StateSpace.of(taylor, tuple(_state_names(system)))


def _by_updates(system: System, context: Context, input_name: str, output_name: str) -> StateSpace:
    """Return a linear system of several sampled blocks, which Drake does not linearise.

    Each column is the update, or the output, of a unit state or input less that of zeros.
    """
    port, output = system.GetInputPort(input_name), system.GetOutputPort(output_name)
    fixed, groups = port.Eval(context), range(context.num_discrete_state_groups())
    sizes = [context.get_discrete_state(i).size() for i in groups]
    n, m = sum(sizes), port.size()

    def respond(x_u: Array) -> Array:
        for i, x in enumerate(np.split(x_u, np.cumsum(sizes))[:-1]):
            context.SetDiscreteState(i, x)
        port.FixValue(context, x_u[n:])
        after = system.EvalUniquePeriodicDiscreteUpdate(context)
        states = [after.get_vector(i).value() for i in groups]
        return np.concatenate([*states, output.Eval(context)])

    zero = respond(np.zeros(n + m))
    M = np.array([respond(unit) - zero for unit in np.eye(n + m)]).T
    port.FixValue(context, fixed)
    timing = system.GetUniquePeriodicDiscreteUpdateAttribute()
    assert timing is not None
    parts = M[:n, :n], M[:n, n:], M[n:, :n], M[n:, n:]
    return StateSpace(*parts, timing.period_sec(), tuple(_state_names(system)))
