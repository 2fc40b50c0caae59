"""What a change of the reference, or of the torque, does to the positions: sampled, linear."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sdt_drake.analysis.linear import (
    StateSpace,
    feedback_parts,
    linear_process,
    sampled_process,
)
from sdt_drake.arrays import Array
from sdt_drake.controllers import CONTROLLERS
from sdt_drake.design import Design
from sdt_drake.dynamics import gravity_stiffness

Complex = NDArray[np.complex128]

LEARNED = ("reference", "torque")
"""What can be learned: a change of the reference's positions [rad], joint side, or of the torque
feedforward [N m], motor side; both at the interpolation period."""


def position_response(
    design: Design, sample: int, omega: Array, *, of: str = "reference"
) -> Complex:
    """Positions that the encoders see over what is learned, around a sample of the motion at rest.

    Exact at the interpolation period, with its hold, with the samples of drive and position loop
    and with the torque that the controller feeds forward of its own model of the robot. Without
    friction, limits, velocity torques and increments of encoders.

    Args:
        design: of the loop.
        sample: of the motion.
        omega: [rad/s], shape (m,), up to the Nyquist frequency.
        of: one of LEARNED.

    Returns:
        [rad/rad] or [rad/(N m)], shape (m, n, n): joint of the position, joint of what is learned.
    """
    n, period = design.robot.n, design.motion.period
    response = _sampled_loop(design, sample).response(omega)
    # What is late by a part of a period is taken for late altogether.
    response = response * np.exp(-1j * omega * design.drive.reference_delay)[:, None, None]
    if of == "torque":
        return response[:, :, 3 * n :]
    # u at the samples makes the reference of `Motion.from_positions`.
    z = np.exp(1j * omega * period)[:, None, None]
    q_ref, v_ref = (z + 2 + 1 / z) / 4, (z - 1 / z) / (2 * period)
    vd_ref = (z - 1) / period * v_ref
    if design.scenario.held_speed == "mean":
        v_ref = (z - 1) / period * q_ref
    by_q, by_v, by_vd = (response[:, :, i * n : (i + 1) * n] for i in range(3))
    return by_q * q_ref + by_v * v_ref + by_vd * vd_ref


def _sampled_loop(design: Design, sample: int) -> StateSpace:
    """From [q_ref, v_ref, vd_ref (3n), added torque (n)], held, to the positions that the encoders
    see (n), at the interpolation period."""
    n, period = design.robot.n, design.motion.period
    controller = CONTROLLERS[design.scenario.controller.kind].linear(design, sample)
    parts = feedback_parts(design, sample, controller)
    own, process = parts["reference"], linear_process(design, sample)
    step = own.period
    if step:
        process = sampled_process(design, process, step)

    def part(name: str) -> tuple[Array, Array]:
        """B and D of an input; 0 where there is none."""
        if name in parts:
            return parts[name].B, parts[name].D
        return np.zeros((len(own.A), 2 * n)), np.zeros((n, 2 * n))

    (b_seen, d_seen), (b_held, d_held) = part("state"), part("sampled_state")
    A, B, seen = process.A, process.B, process.C[: 2 * n]
    held = StateSpace(  # from what is held for a period: reference, sampled state, torque
        A=np.block([[A + B @ d_seen @ seen, B @ own.C], [b_seen @ seen, own.A]]),
        B=np.block([[B @ own.D, B @ d_held, B], [own.B, b_held, 0 * own.B[:, :n]]]),
        C=np.hstack([seen, np.zeros((2 * n, len(own.A)))]),
        D=np.zeros((2 * n, 6 * n)),
        period=step,
    )
    held = _every(held, round(period / step)) if step else held.sampled(period)
    from_reference, from_state, from_torque = np.hsplit(held.B, [3 * n, 5 * n])
    return StateSpace(
        A=held.A + from_state @ held.C,
        B=np.hstack([from_reference + from_torque @ _feedforward(design, sample), from_torque]),
        C=held.C[:n],
        D=np.zeros((n, 4 * n)),
        period=period,
    )


def _every(system: StateSpace, count: int) -> StateSpace:
    """A sampled system at every `count`-th sample, its inputs held in between."""
    A, B = np.eye(len(system.A)), np.zeros_like(system.B)
    for _ in range(count):
        A, B = system.A @ A, system.A @ B + system.B
    return StateSpace(A, B, system.C, system.D, count * system.period)


def _feedforward(design: Design, sample: int) -> Array:
    """Torque that is fed forward over [q_ref, v_ref, vd_ref], motor side, shape (n, 3n).

    At rest nothing depends on the speed. Of Algorithm 1 it is the load that no other motor takes
    off: its branches have no derivative. Friction that is compensated has none either.
    """
    choice, n, model = design.scenario.controller, design.robot.n, design.model
    kind, q = choice.feedforward_in_use, design.motion.q[sample]
    if kind == "none":
        return np.zeros((n, 3 * n))
    context = model.plant.CreateDefaultContext()
    model.plant.SetPositions(context, q)
    inertia = model.plant.CalcMassMatrix(context)  # with the rotors'
    if kind == "ctc":
        inertia = inertia - np.diag(inertia.diagonal())
    torque = np.hstack([gravity_stiffness(model, q), np.zeros((n, n)), inertia])
    gain = np.ones(n) if choice.feedforward_gain is None else np.array(choice.feedforward_gain)
    return (gain / model.gear_ratio)[:, None] * torque
