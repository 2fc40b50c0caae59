"""The loops that learning has to do with, as known, as simulated, as uncertain: sampled, linear."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sdt_drake.analysis.linear import linearise
from sdt_drake.io.arrays import Array, Complex
from sdt_drake.io.errors import InputError, within
from sdt_drake.motion.plan import TORQUE_TOLERANCE
from sdt_drake.robot.device import Friction, sliding_friction
from sdt_drake.robot.dynamics import gravity_stiffness, inverse_dynamics
from sdt_drake.robot.motors import as_driven
from sdt_drake.run.design import Design
from sdt_drake.systems.state_space import StateSpace

LEARNED = ("reference", "torque")
"""What can be learned: a change of the reference's positions [rad], joint side, or of the torque
feedforward [N m], motor side; both at the interpolation period."""

POINTS = 300
"""Of frequency."""

_LARGEST_POLE = 1 + 1e-9  # that of the integral which a speed loop has beside the position is 1
_LOWEST = 0.1  # rad/s
_HIGHEST = 0.9  # of the Nyquist frequency, where samples can command no speed


@dataclass(frozen=True, eq=False)
class LoopSet:
    """Responses of loops that go by one name.

    Attributes:
        name: for people.
        devices: how many devices they are of.
        responses: each over `frequencies`, of a device in a pose.
        demand: largest share of each motor's torque that the motion takes of a device [-], shape
            (devices, n).
    """

    name: str
    responses: tuple[Complex, ...]
    demand: Array

    @property
    def devices(self) -> int:
        """How many devices the loops are of."""
        return len(self.demand)

    @property
    def title(self) -> str:
        """The name of the set, with how many devices it is of."""
        return f"{self.name} ({self.devices})" if self.devices > 1 else self.name


def loop_set(name: str, designs: Sequence[Design], of: str) -> LoopSet:
    """The loops of some devices to what is learned, in their poses."""
    with within(f"learning does not converge for {name}"):
        every = [response for design in designs for response in responses(design, of)]
    return LoopSet(name, tuple(every), np.stack([demand(design) for design in designs]))


def demand(design: Design) -> Array:
    """Largest share of the motors' torque that the planned motion takes of what moves [-], (n,).

    Of what the torque-speed envelope leaves to drive with, if there is one. With sliding friction,
    and the disturbance at its worst. Where it is above 1 motors saturate, whatever the reference:
    linear models end there, and with them learning.
    """
    motion, robot = design.wanted, design.robot
    torque = inverse_dynamics(robot, motion.q, motion.v, motion.vd)
    if design.friction is not None:
        torque = torque + sliding_friction(design.friction, motion.v)
    load = design.scenario.disturbance.amplitude * design.loads.load_torque * robot.gear_ratio
    lowest, highest = as_driven(robot, design.scenario.drive).torque_range(motion.v)
    asked, available = np.abs(torque) + np.abs(load), np.where(torque > 0, highest, -lowest)
    nothing = np.where(asked <= TORQUE_TOLERANCE, 0.0, np.inf)
    return np.asarray(np.divide(asked, available, out=nothing, where=available > 0).max(axis=0))


def loops_of(
    design: Design, of: str, *, devices: Mapping[str, Sequence[Design]] | None = None
) -> list[LoopSet]:
    """The loops that a filter has to converge for; first the one that it is made of.

    Args:
        design: of the loop.
        of: what is learned, one of `LEARNED`.
        devices: further designs by the name of the group.

    Raises:
        InputError: for an unstable loop.
    """
    known = known_loop(design)
    sets = [loop_set("the model", [known], of)]
    plant = design.scenario.plant
    is_known = plant.deviation == design.scenario.controller.model and plant.friction.is_none
    if not is_known or design.scenario.disturbance.amplitude > 0:
        sets.append(loop_set("the simulated device", [design], of))
    return sets + [loop_set(name, group, of) for name, group in (devices or {}).items()]


def responses(design: Design, of: str) -> tuple[Complex, ...]:
    """Responses of a device to what is learned, in its poses."""
    omega = frequencies(design)
    return tuple(position_response(design, pose, omega, of=of) for pose in poses(design))


def frequencies(design: Design) -> Array:
    """Frequencies at which loops are known [rad/s]: below the Nyquist frequency, shape
    (POINTS,)."""
    return np.geomspace(_LOWEST, _HIGHEST * np.pi / design.motion.period, POINTS)


def known_loop(design: Design) -> Design:
    """The loop as its engineer knows it: what moves is the controller's model of it."""
    scenario = copy.deepcopy(design.scenario)
    scenario.plant.deviation = scenario.controller.model
    scenario.plant.friction, scenario.controller.friction_compensation = Friction(), False
    scenario.learned = ""
    return design.variant(scenario)


def poses(design: Design) -> list[int]:
    """Samples of the motion at which the inertia of any joint is largest or smallest."""
    d_kk = design.torques.d_kk
    return sorted({*d_kk.argmax(axis=0).tolist(), *d_kk.argmin(axis=0).tolist()})


# --- responses -----------------------------------------------------------------------------------


def position_response(
    design: Design, sample: int, omega: Array, *, of: str = "reference"
) -> Complex:
    """Positions that the encoders see over what is learned, around a sample of the motion at rest.

    Exact at the interpolation period, with its hold, with the samples of drive and position loop
    and with the torque that the controller feeds forward of its own model of the robot. Without
    friction but for its viscous part, limits, velocity torques and increments of encoders.

    Args:
        design: of the loop.
        sample: of the motion.
        omega: [rad/s], shape (m,), up to the Nyquist frequency.
        of: one of LEARNED.

    Returns:
        [rad/rad] or [rad/(N m)], shape (m, n, n): joint of the position, joint of what is learned.

    Raises:
        InputError: if the loop is unstable there: it answers nothing.
    """
    n, period = design.robot.n, design.motion.period
    loop = _sampled_loop(design, sample)
    if np.abs(np.linalg.eigvals(loop.A)).max() > _LARGEST_POLE:
        raise InputError(
            f"unstable loop at {design.motion.time[sample]:.3f} s of the motion, expected gains "
            "that keep it stable, or a better model"
        )
    response = loop.response(omega)
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
    n = design.robot.n
    loop = linearise(design, sample).whole().sampled(design.reference.period)
    from_reference, from_torque = np.hsplit(loop.B, [3 * n])
    return StateSpace(
        A=loop.A,
        B=np.hstack([from_reference + from_torque @ _feedforward(design, sample), from_torque]),
        C=loop.C[:n],
        D=np.zeros((n, 4 * n)),
        period=loop.period,
    )


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
