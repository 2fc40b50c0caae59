"""Sampled linear loops for learning: of the model, the simulated robot and uncertain devices."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

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
"""Signals that can be learned: a change of the reference's positions [rad], joint side, or of the
torque feedforward [N m], motor side; both at the interpolation period."""

POINTS = 300
"""Number of frequencies in a response."""

_MAX_POLE = 1 + 1e-9  # magnitude; a speed loop has a pole at 1, the integral of its speed
_MIN_OMEGA = 0.1  # rad/s
_MAX_SHARE = 0.9  # share of the Nyquist frequency, at which samples cannot command a speed


@dataclass(frozen=True, eq=False)
class LoopSet:
    """A set of loop responses of one or several devices."""

    name: str
    """Name of the set in reports and messages."""
    responses: tuple[Complex, ...]
    """Response over `frequencies` for each device and pose, shape (m, n, n) each."""
    demand: Array
    """Largest share of each motor's torque that the motion needs [-], shape (devices, n)."""

    @property
    def devices(self) -> int:
        """Number of devices."""
        return len(self.demand)

    @property
    def title(self) -> str:
        """Name of the set, with the number of devices if there are several."""
        return f"{self.name} ({self.devices})" if self.devices > 1 else self.name


def loop_set(name: str, designs: Sequence[Design], of: str) -> LoopSet:
    """Return the responses of some devices to the learned signal `of`, in all poses."""
    with within(f"learning does not converge for {name}"):
        every = [response for design in designs for response in responses(design, of)]
    return LoopSet(name, tuple(every), np.stack([demand(design) for design in designs]))


def demand(design: Design) -> Array:
    """Return the largest share of the motors' torque that the planned motion needs [-], (n,).

    It is the torque of the simulated robot, with sliding friction and the worst disturbance, over
    the torque that the torque-speed envelope allows. Above 1 a motor saturates with any reference,
    and the linear models of learning do not hold.
    """
    motion, robot = design.reference.planned, design.device.simulated
    torque = robot.gear_torque(inverse_dynamics(robot, motion.q, motion.v, motion.vd))
    if design.friction is not None:
        torque = torque + sliding_friction(design.friction, motion.v)
    load = design.scenario.disturbance.amplitude * design.loads.load_torque * robot.gear_ratio
    lowest, highest = as_driven(robot, design.scenario.drive).torque_range(motion.v)
    needed, available = np.abs(torque) + np.abs(load), np.where(torque > 0, highest, -lowest)
    share = np.where(needed <= TORQUE_TOLERANCE, 0.0, np.inf)  # where no torque is available
    return np.asarray(np.divide(needed, available, out=share, where=available > 0).max(axis=0))


def loops_of(
    design: Design, of: str, *, devices: Mapping[str, Sequence[Design]] | None = None
) -> list[LoopSet]:
    """Return the loop sets for which a filter must converge. The first one is the model.

    Args:
        design: design of the loop.
        of: learned signal, one of `LEARNED`.
        devices: further designs by name of the loop set.

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
    """Return the responses of a device to the learned signal `of`, one for each pose."""
    omega = frequencies(design)
    return tuple(position_response(design, pose, omega, of=of) for pose in poses(design))


def frequencies(design: Design) -> Array:
    """Return the frequencies of responses [rad/s], below the Nyquist frequency, (POINTS,)."""
    return np.geomspace(_MIN_OMEGA, _MAX_SHARE * np.pi / design.reference.tracked.period, POINTS)


def known_loop(design: Design) -> Design:
    """Return the design whose simulated robot is the controller's model."""
    changes = {
        "plant.deviation": design.scenario.controller.model,
        "plant.friction": Friction(),
        "controller.friction_compensation": False,
        "learned": "",
    }
    return replace(design, learned=None).variant(design.scenario.changed(changes))


def poses(design: Design) -> list[int]:
    """Return the samples of the motion at which a joint's inertia is largest or smallest."""
    d_kk = design.torques.d_kk
    return sorted({*d_kk.argmax(axis=0).tolist(), *d_kk.argmin(axis=0).tolist()})


# --- responses -----------------------------------------------------------------------------------


def position_response(
    design: Design, sample: int, omega: Array, *, of: str = "reference"
) -> Complex:
    """Return the response of encoder positions to the learned signal, at rest in one pose.

    It is exact at the interpolation period: with its hold, the samples of drive and position loop,
    and the feedforward of the controller's model. It includes viscous friction only, and neither
    limits nor velocity torques nor encoder increments.

    Args:
        design: design of the loop.
        sample: sample of the motion, which gives the pose.
        omega: frequencies up to the Nyquist frequency [rad/s], shape (m,).
        of: learned signal, one of `LEARNED`.

    Returns:
        Response [rad/rad] or [rad/(N m)], shape (m, n, n): joint of the position, joint of the
        learned signal.

    Raises:
        InputError: if the loop is unstable in this pose.
    """
    n, period = design.device.simulated.n, design.reference.tracked.period
    loop = _sampled_loop(design, sample)
    if np.abs(np.linalg.eigvals(loop.A)).max() > _MAX_POLE:
        raise InputError(
            f"unstable loop at {design.reference.tracked.time[sample]:.3f} s of the motion, "
            "expected a stable one; use other gains or a better model"
        )
    response = loop.response(omega)
    # A delay of a part of a period acts on the whole response (approximation).
    response = response * np.exp(-1j * omega * design.drive.reference_delay)[:, None, None]
    if of == "torque":
        return response[:, :, 3 * n :]
    # Samples of u change the reference as `Motion.from_positions` does.
    z = np.exp(1j * omega * period)[:, None, None]
    q_ref, v_ref = (z + 2 + 1 / z) / 4, (z - 1 / z) / (2 * period)
    vd_ref = (z - 1) / period * v_ref
    if design.scenario.held_speed == "mean":
        v_ref = (z - 1) / period * q_ref
    by_q, by_v, by_vd = (response[:, :, i * n : (i + 1) * n] for i in range(3))
    return by_q * q_ref + by_v * v_ref + by_vd * vd_ref


def _sampled_loop(design: Design, sample: int) -> StateSpace:
    """Return the loop at the interpolation period, with held inputs.

    Inputs are q_ref, v_ref, vd_ref and an additional torque (4n), outputs encoder positions (n).
    """
    n = design.device.simulated.n
    loop = linearise(design, sample, at_rest=True).whole().sampled(design.reference.held.period)
    from_reference, from_torque = np.hsplit(loop.B, [3 * n])
    return StateSpace(
        A=loop.A,
        B=np.hstack([from_reference + from_torque @ _feedforward(design, sample), from_torque]),
        C=loop.C[:n],
        D=np.zeros((n, 4 * n)),
        period=loop.period,
    )


def _feedforward(design: Design, sample: int) -> Array:
    """Return the derivative of the fed-forward torque by [q_ref, v_ref, vd_ref], shape (n, 3n).

    Motor side. At rest it does not depend on the speed. Algorithm 1 contributes the load of other
    joints. Its branches and compensated friction have no derivative.
    """
    choice, n, model = design.scenario.controller, design.device.simulated.n, design.device.model
    kind, q = choice.feedforward_in_use, design.reference.tracked.q[sample]
    if kind == "none":
        return np.zeros((n, 3 * n))
    context = model.plant.CreateDefaultContext()
    model.plant.SetPositions(context, q)
    inertia = model.mass_matrix(context)
    if kind == "ctc":
        inertia = inertia - np.diag(inertia.diagonal())
    torque = np.hstack([gravity_stiffness(model, q), np.zeros((n, n)), inertia])
    gain = np.ones(n) if choice.feedforward_gain is None else np.array(choice.feedforward_gain)
    return (gain / model.gear_ratio)[:, None] * torque
