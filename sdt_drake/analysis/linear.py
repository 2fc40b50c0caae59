"""Linear analysis of the loops: Drake's linearisation of process and feedback, closed in numpy.

Process and feedback are linearised apart, so that a sampled speed loop can be closed exactly: the
process then has the zero-order-hold map of its period.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.analysis import DiscreteTimeApproximation
from pydrake.systems.framework import Context, Diagram, System
from pydrake.systems.primitives import AffineSystem, FirstOrderTaylorApproximation, LinearSystem

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, checked_type, needing
from sdt_drake.io.shown import Shown, Summary
from sdt_drake.run.controllers import Controller, controller_class
from sdt_drake.run.design import Design
from sdt_drake.run.device_diagram import make_process
from sdt_drake.run.loop import blocks_of

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, eq=False)
class StateSpace:
    """x' = A x + B u (or, sampled, x of the next period), y = C x + D u.

    Attributes:
        period: sampling period [s]; 0: continuous.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    period: float = 0.0

    @classmethod
    def of(cls, system: AffineSystem) -> StateSpace:
        """The linear part of a linear or affine system of Drake's, its offsets left out."""
        return StateSpace(system.A(), system.B(), system.C(), system.D(), system.time_period())

    def response(self, omega: Array) -> NDArray[np.complex128]:
        """Frequency response at `omega` [rad/s], shape (len(omega), outputs, inputs)."""
        s = np.exp(1j * omega * self.period) if self.period else 1j * omega
        resolvent = s[:, None, None] * np.eye(len(self.A)) - self.A
        moving: NDArray[np.complex128] = self.C @ np.linalg.solve(resolvent, self.B + 0j)
        return moving + self.D

    def sampled(self, period: float) -> StateSpace:
        """The system behind zero-order holds, at their samples."""
        continuous = LinearSystem(self.A, self.B, self.C, self.D)
        return StateSpace.of(DiscreteTimeApproximation(continuous, period))

    def between(self) -> StateSpace:
        """The system without the states that no input reaches or no output shows."""
        n = len(self.A)
        leads = np.linalg.matrix_power((self.A != 0) | np.eye(n, dtype=bool), n)  # column to row
        x = (leads @ (self.B != 0).any(axis=1)) & ((self.C != 0).any(axis=0) @ leads)
        return StateSpace(self.A[np.ix_(x, x)], self.B[x], self.C[:, x], self.D, self.period)

    def modes(self) -> NDArray[np.complex128]:
        """Eigenvalues [1/s]; of a sampled system, the continuous ones that they stand for."""
        eigenvalues = np.linalg.eigvals(self.A).astype(complex)
        if not self.period:
            return eigenvalues
        with np.errstate(divide="ignore"):
            return np.log(eigenvalues) / self.period

    def step(self, duration: float, samples: int) -> tuple[Array, Array]:
        """Outputs after a step of the one input: time [s] (N + 1,) and y (N + 1, outputs).

        N is `samples`; of a sampled system less, if it has fewer periods, or up to twice as many.
        """
        system = self if self.period else self.sampled(duration / samples)
        every = max(1, round(duration / system.period) // samples)
        count = round(duration / system.period / every)
        n = len(system.A)
        one_period = np.block([[system.A, system.B], [np.zeros((1, n)), np.ones((1, 1))]])
        onwards = np.linalg.matrix_power(one_period, every)
        x_u = np.append(np.zeros(n), 1.0)[:, None]
        while x_u.shape[1] <= count:  # twice as many samples each time
            x_u = np.hstack([x_u, onwards @ x_u])
            onwards = onwards @ onwards
        y = np.hstack([system.C, system.D]) @ x_u[:, : count + 1]
        return np.arange(count + 1, dtype=float) * every * system.period, y.T


@dataclass(frozen=True, eq=False)
class LinearLoop:
    """A loop of n joints, linear around a sample of its motion at rest.

    Attributes:
        process: from tau_cmd (n) to [measured (2n), state (2n)].
        feedback: from [reference (3n), measured (2n)] to tau_fb (n); of the same period.
        n: number of joints.
    """

    process: StateSpace
    feedback: StateSpace
    n: int

    def loop_gain(self, omega: Array) -> NDArray[np.complex128]:
        """-(tau_fb / tau_cmd) of each joint, all others closed; shape (len(omega), n)."""
        n = self.n
        H = -self.feedback.response(omega)[:, :, 3 * n :] @ self.process.response(omega)[:, : 2 * n]
        gain = np.empty((len(omega), n), dtype=complex)
        for k in range(n):
            o = [j for j in range(n) if j != k]
            others = np.eye(n - 1) + H[:, o][:, :, o]
            through = H[:, [k]][:, :, o] @ np.linalg.solve(others, H[:, o][:, :, [k]])
            gain[:, k] = H[:, k, k] - through[:, 0, 0]
        return gain

    def tracking(self, omega: Array) -> NDArray[np.complex128]:
        """v / v_ref of each joint's link, all loops closed, no feedforward: (len(omega), n).

        q_ref and vd_ref are the integral and the derivative of v_ref.
        """
        n, s = self.n, 1j * omega[:, None]
        v = self.whole().response(omega)[:, n : 2 * n]
        q_ref, v_ref, vd_ref = (np.einsum("ikk->ik", v[:, :, k : k + n]) for k in (0, n, 2 * n))
        return q_ref / s + v_ref + s * vd_ref

    def whole(self) -> StateSpace:
        """The closed loop from [reference (3n), tau_ff (n)] to [state (2n), tau_cmd (n)].

        tau_ff is added to the feedback, motor side [N m]. The states are those of the process,
        then those of the feedback.
        """
        p, f, n = self.process, self.feedback, self.n
        by_reference, by_measured = np.hsplit(f.B, [3 * n])
        at_once, from_measured = np.hsplit(f.D, [3 * n])
        measured, state = p.C[: 2 * n], p.C[2 * n :]  # tau reaches neither at once: D is 0 there
        fed_back = from_measured @ measured
        return StateSpace(
            A=np.block([[p.A + p.B @ fed_back, p.B @ f.C], [by_measured @ measured, f.A]]),
            B=np.block([[p.B @ at_once, p.B], [by_reference, np.zeros((len(f.A), n))]]),
            C=np.block([[state, np.zeros((2 * n, len(f.A)))], [fed_back, f.C]]),
            D=np.block([[np.zeros((2 * n, 4 * n))], [at_once, np.eye(n)]]),
            period=p.period,
        )

    def closed(self, k: int) -> StateSpace:
        """The closed loop from v_ref of joint k to v of its link; q_ref is the integral of v_ref.

        vd_ref is 0: a step has none. Of the states only those that come between: on decoupled axes
        those of joint k.
        """
        loop, n = self.whole(), self.n
        q_ref, v_ref = loop.B[:, [k]], loop.B[:, [n + k]]
        rest = float(loop.period > 0)  # what keeps q_ref: x+ = x, or x' = 0
        A = np.block([[loop.A, q_ref], [np.zeros((1, len(loop.A))), np.full((1, 1), rest)]])
        B = np.vstack([v_ref, np.full((1, 1), loop.period or 1.0)])
        C = np.append(loop.C[[n + k]], [[0.0]], axis=1)
        return StateSpace(A, B, C, np.zeros((1, 1)), loop.period).between()


@dataclass(frozen=True, eq=False, repr=False)
class LinearModel(Shown, StateSpace):
    """A closed loop in state space, with names; speeds, angles and their references joint side,
    torques motor side.

    Attributes:
        states, inputs, outputs: names, `name_k` for joint k.
    """

    states: tuple[str, ...] = ()
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()

    def summary(self) -> Summary:
        kind = f"sampled every {1000 * self.period:.6g} ms" if self.period else "continuous"
        rows = []
        for part in ("states", "inputs", "outputs"):
            names = getattr(self, part)
            stems = dict.fromkeys(f"{name.rpartition('_')[0]}_k" for name in names)
            rows.append((part, f"{len(names)}", ", ".join(stems)))
        return Summary(kind, ("", "number", "names"), rows)

    def to_control(self) -> control.StateSpace:
        """The model as a StateSpace of python-control, with the same names.

        Raises:
            InputError: where that is not installed.
        """
        with needing("to_control needs python-control", "sdt_drake[exchange]"):
            import control
        names = {name: list(getattr(self, name)) for name in ("states", "inputs", "outputs")}
        return control.ss(self.A, self.B, self.C, self.D, self.period, **names)


def linear(design: Design, sample: int = 0) -> LinearModel:
    """The closed loop of a design around a sample of its motion, at rest there, with names.

    Inputs are q_ref, v_ref, vd_ref and tau_ff, a torque that is added to the feedback's; outputs
    q, v and tau_cmd. What counts and what does not, `linearise` says.

    Raises:
        InputError: for a sample that the motion does not have, or a controller that cannot be
            linearised.
    """
    checked_type(design, Design, "design", "sdt_drake.design")
    last = len(design.motion.v) - 1
    if not (isinstance(sample, int | np.integer) and 0 <= sample <= last):
        raise InputError(f"sample: {sample!r}, expected a whole number from 0 to {last}")
    loop = linearise(design, sample).whole()
    n, kind = design.robot.n, design.scenario.controller.kind
    process, feedback = make_process(design), controller_class(kind).linear(design, sample)
    states = [*_of_joints(n, "q", "v"), *_state_names(process)[2 * n :]]
    late = len(loop.A) - len(states) - len(_state_names(feedback))  # positions one period before
    states += [f"q_before_{k + 1}" for k in range(late)] + _state_names(feedback)
    inputs = _of_joints(n, "q_ref", "v_ref", "vd_ref", "tau_ff")
    outputs = _of_joints(n, "q", "v", "tau_cmd")
    named = (tuple(states), tuple(inputs), tuple(outputs))
    return LinearModel(loop.A, loop.B, loop.C, loop.D, loop.period, *named)


def _of_joints(n: int, *names: str) -> list[str]:
    return [f"{name}_{k + 1}" for name in names for k in range(n)]


def _state_names(system: System) -> list[str]:
    """Of the continuous state, or else the discrete one, by the names of the blocks."""
    names = []
    for block in blocks_of(system):  # in the order of their states
        context = block.CreateDefaultContext()
        size = context.num_continuous_states() or context.num_total_states()
        names += _of_joints(size, block.get_name())
    return names


def linearise(design: Design, sample: int = 0) -> LinearLoop:
    """The loop of a design, linear around a sample of its motion, at rest there.

    What is not sampled in the loop counts as continuous; of the sampling, that of the drive's
    speed loop is exact, and that of a controller of the whole state; with encoders of a resolution
    speeds are differences of positions, as in the loop. Samples of the position loop of a cascade
    are taken for continuous, and increments for small.
    """
    return close(design, linear_process(design, sample), linear_feedback(design, sample))


def close(design: Design, process: StateSpace, feedback: StateSpace) -> LinearLoop:
    """The loop of a process and a feedback; the process at the feedback's samples if that is
    sampled."""
    if feedback.period:
        process = sampled_process(design, process, feedback.period)
    return LinearLoop(process, feedback, design.robot.n)


def sampled_process(design: Design, process: StateSpace, period: float) -> StateSpace:
    """A process at samples of a drive; speeds that its encoders measure in steps are differences of
    its measured positions."""
    process, n = process.sampled(period), design.robot.n
    if design.drive.encoder_resolution is None:
        return process
    positions = process.C[:n]
    C = np.hstack([process.C, np.zeros((4 * n, n))])
    C[n : 2 * n] = np.hstack([positions, -np.eye(n)]) / period
    return StateSpace(
        A=np.block([[process.A, np.zeros((len(process.A), n))], [positions, np.zeros((n, n))]]),
        B=np.vstack([process.B, np.zeros((n, n))]),
        C=C,
        D=process.D,
        period=period,
    )


def linear_process(design: Design, sample: int = 0) -> StateSpace:
    """The process from tau_cmd (n) to [measured (2n), state (2n)], linear and continuous."""
    diagram, n = make_process(design), design.robot.n
    at = np.concatenate([design.motion.q[sample], np.zeros(n)])
    context = diagram.CreateDefaultContext()
    diagram.get_input_port().FixValue(context, np.zeros(n))
    state = context.get_continuous_state_vector().CopyToVector()
    context.SetContinuousState(np.concatenate([at, state[2 * n :]]))
    _hold_still(diagram, context, first=2 * n)
    parts = [_taylor(diagram, context, "tau_cmd", name) for name in ("measured", "state")]
    C, D = np.vstack([part.C for part in parts]), np.vstack([part.D for part in parts])
    return replace(parts[0], C=C, D=D)


def linear_feedback(design: Design, sample: int = 0) -> StateSpace:
    """The feedback from [reference (3n), measured (2n)] to tau_fb (n), linear, of the period that
    it is sampled with.

    Encoders are ideal and never late.

    Raises:
        InputError: for a controller that cannot be linearised.
    """
    controller = controller_class(design.scenario.controller.kind).linear(design, sample)
    parts = feedback_parts(design, sample, controller)
    reference = parts.pop("reference")
    feedback = replace(
        reference,
        B=np.hstack([reference.B, np.sum([part.B for part in parts.values()], axis=0)]),
        D=np.hstack([reference.D, np.sum([part.D for part in parts.values()], axis=0)]),
    )
    is_sampled = isinstance(controller, Controller) and controller.is_sampled
    if is_sampled and not feedback.period:
        return feedback.sampled(design.motion.period)  # its state is, with the reference
    return feedback


def feedback_parts(design: Design, sample: int, controller: System) -> dict[str, StateSpace]:
    """The feedback from each input of a controller, by its name, to tau_fb (n): all parts have the
    same state.

    `controller` is the feedback of the design's, as `Controller.linear` makes it.
    """
    at = np.concatenate([design.motion.q[sample], np.zeros(design.robot.n)])
    context = controller.CreateDefaultContext()
    reference = np.append(at, np.zeros(design.robot.n))
    resting = {"reference": reference, "state": at, "sampled_state": at}
    ports = [controller.get_input_port(i) for i in range(controller.num_input_ports())]
    for port in ports:
        port.FixValue(context, resting[port.get_name()])
    return {p.get_name(): _taylor(controller, context, p.get_name(), "tau_cmd") for p in ports}


def _hold_still(diagram: Diagram, context: Context, first: int) -> None:
    """Give motors, springs and torque loops what the plant needs to stay where it is.

    Away from equilibrium a linearisation would have the change of M(q) times an acceleration in
    it. The plant's state, the first in the diagram, stays; all others and the torque enter the
    derivatives linearly, so one step of Newton's method is exact.
    """
    taylor = _taylor(diagram, context, "tau_cmd", "state")
    state = context.get_continuous_state_vector().CopyToVector()
    acting = np.hstack([taylor.A[:, first:], taylor.B])
    moving = diagram.EvalTimeDerivatives(context).CopyToVector()
    change = np.linalg.lstsq(acting, -moving, rcond=None)[0]
    others = len(state) - first
    context.SetContinuousState(state + np.concatenate([np.zeros(first), change[:others]]))
    diagram.get_input_port().FixValue(context, change[others:])  # it was 0


def _taylor(system: System, context: Context, input_name: str, output_name: str) -> StateSpace:
    taylor = FirstOrderTaylorApproximation(
        system,
        context,
        input_port_index=system.GetInputPort(input_name).get_index(),
        output_port_index=system.GetOutputPort(output_name).get_index(),
    )
    return StateSpace.of(taylor)
