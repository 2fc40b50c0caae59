"""The identified robot as its files hold it: links, rotors, damping, and friction of a scenario."""

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import nnls

from sdt_drake.io.arrays import Array
from sdt_drake.machine.identify.base_parameters import motor_parameters
from sdt_drake.machine.identify.consistency import Consistent
from sdt_drake.machine.identify.equations import Equations
from sdt_drake.machine.identify.estimation import Estimate
from sdt_drake.machine.identify.friction import PEAKS, Term, scenario_terms
from sdt_drake.robot.device import PRESLIDING_DAMPING_TIME, Friction, FrictionParameters
from sdt_drake.robot.robot import Robot, edited
from sdt_drake.robot.sdf import DRAKE, links_by_name, set_inertia

Fits = dict[float | None, tuple[Array, float]]
"""Nearest friction of a joint and its residual, by Stribeck speed [rad/s]; None: no peak."""

_MAX_RATIO = 0.5  # residual with a Stribeck peak over that without, for it to be used
_MIN_LEFT = 0.01  # residual of a joint's friction, for a Stribeck speed of its own
_MIN_VISIBLE = 0.1  # share of a peak's height that recorded speeds reach, for it to be used
_PLACES = 200  # speeds at which friction laws are compared
_MAX_STICKING = 5e3  # natural frequency of a sticking joint [rad/s], far above every loop
_SAME_DAMPING = 0.9  # viscous friction over the damping of the file, for that to stay


@dataclass(frozen=True, eq=False)
class PlantFriction:
    """The friction of a scenario (`plant.friction`) that is closest to the identified laws.

    Apart from an offset, it is the same in both directions and always brakes.
    """

    friction: Friction
    """Friction in addition to `damping`, joint side."""
    damping: Array
    """Damping of the written robot [N m s/rad], shape (n,). It is that of the file, or 0 where the
    recorded viscous friction is clearly less."""
    std: Array
    """Standard deviations of Coulomb [N m] and viscous friction [N m s/rad], shape (2, n). They
    contain noise, the differences of equally good laws, and the spread between recordings."""
    between: Array
    """Spread between recordings over the value [-], shape (2, n); 0 for one recording."""
    undecided: Array
    """Share of the variance that comes from equally good laws [-], shape (n,)."""
    left: Array
    """RMS difference from the symmetric part of the identified law at the recorded speeds, over
    the RMS of that part [-], shape (n,)."""


def plant_friction(
    robot: Robot, eq: Equations, estimate: Estimate, friction: Array, consistent: Consistent
) -> PlantFriction:
    """Return the damping and the friction of a scenario that are closest to the identified laws.

    Args:
        robot: The robot of the file.
        eq: The equations of the recordings.
        estimate: The least-squares fit with its friction laws.
        friction: Parameters of these laws for the consistent links, shape (f,).
        consistent: The consistent links.
    """
    r = len(estimate.beta)
    covariance = estimate.covariance[r:, r:]
    moves, speed = eq.moves, eq.speed
    speeds = [_speeds(speed[moves[:, k], k]) for k in range(robot.n)]
    parts = [estimate.friction_of(k) for k in range(robot.n)]
    odd, even = (
        [_half(law.terms, v, sign) for law, v in zip(estimate.laws, speeds, strict=True)]
        for sign in (-1, 1)
    )
    wanted = [law @ friction[part] for law, part in zip(odd, parts, strict=True)]
    best, peaks = _best_peaks(eq, speeds, wanted)
    x = np.array([[*found_, 0.0][:3] for found_, _ in best])
    is_moved = moves.any(axis=0)
    # Damping acts at joints, friction at the gears of motors that may turn with two of them.
    stays = (x[:, 0] > _SAME_DAMPING * robot.damping) & (not robot.is_coupled)
    damping = np.where(is_moved, stays * np.minimum(x[:, 0], robot.damping), robot.damping)
    x[:, 0] -= is_moved * damping
    given: dict[str, Any] = {"coulomb": x[:, 1], "viscous": x[:, 0]}
    if any(peaks):
        given["breakaway"] = x[:, 1] + x[:, 2]
        own = [peak or Friction.stribeck_speed for peak in peaks]
        given |= {"stribeck_speed": own[0]} if len({*own}) == 1 else {"stribeck_speeds": own}
    given["offset"] = [np.mean(law @ friction[part]) for law, part in zip(even, parts, strict=True)]
    softest = _softest(with_identified(robot, consistent, damping), eq, x[:, 1])
    scenario = Friction(**given, presliding=max(Friction().presliding, softest))
    std, undecided, days = [], [], []
    for k, (v, law, part, (values, _)) in enumerate(zip(speeds, odd, parts, best, strict=True)):
        basis = _basis(v, peaks[k])[:, : len(values)]
        nearest = np.linalg.pinv(basis)
        J = nearest @ law
        noise = np.maximum(np.diagonal(J @ covariance[part, part] @ J.T), 0.0)[:2]
        apart = [
            nearest @ (_half(rival.terms, v, -1) @ own - law @ estimate.friction[part])
            for rival, own in estimate.rivals[k]
        ]
        other = sum(x[:2] ** 2 for x in apart) / (1 + len(apart))
        std.append(np.sqrt(noise + other))
        days.append((estimate.days[:, r:][:, part] @ J.T)[:, :2])
        undecided.append(np.max(other / np.maximum(noise + other, 1e-300)))
    left = np.array([left for _, left in best])
    between = _between(np.array(days).swapaxes(0, 1), x[:, :2])
    wide = np.hypot(std, between * x[:, :2])
    return PlantFriction(
        scenario, damping, wide[:, ::-1].T, between[:, ::-1].T, np.array(undecided), left
    )


def scenario_torque(eq: Equations, friction: FrictionParameters) -> Array:
    """Return the friction of a scenario in every row of equations [N m], shape (M, n).

    Its terms are among those of the equations.
    """
    values = np.stack(
        [friction.viscous, friction.coulomb, friction.offset, friction.breakaway - friction.coulomb]
    )
    speeds = friction.stribeck_speed.tolist()
    at = [[of_joint.index(term) for term in scenario_terms(speed)]
          for of_joint, speed in zip(eq.terms, speeds, strict=True)]  # fmt: skip
    columns = np.take_along_axis(eq.friction, np.array(at)[None], axis=2)
    return np.asarray(np.einsum("mkt,tk->mk", columns, values))


def with_identified(robot: Robot, consistent: Consistent, damping: Array) -> Robot:
    """Return a robot with the identified links, motors and damping."""
    return edited(robot, lambda root: put_identified(root, robot, consistent, damping))


def put_identified(root: ET.Element, robot: Robot, consistent: Consistent, damping: Array) -> None:
    """Put identified links, rotors and damping into the XML of a robot's SDF."""
    elements = links_by_name(root)
    for link, pseudo in zip(consistent.links, consistent.pseudo, strict=True):
        set_inertia(elements[link.name], *link.inertial(pseudo))
    joints = {joint.get("name"): joint for joint in root.iter("joint")}
    before = motor_parameters(robot)
    for k, name in enumerate(robot.joint_names):
        if consistent.motors[k] != before[k]:
            rotor = joints[name].find(f"{DRAKE}rotor_inertia")
            if rotor is None:
                rotor = ET.SubElement(joints[name], f"{DRAKE}rotor_inertia")
            rotor.text = repr(float(consistent.motors[k] / robot.gear_ratio[k] ** 2))
        if damping[k] != robot.damping[k]:
            for element in joints[name].iter("damping"):
                element.text = repr(float(damping[k]))


def _between(days: Array, values: Array) -> Array:
    """Return the standard deviation between recordings over the value, shape (n, 2).

    Recordings of one joint may agree by chance. So it is at least the RMS over all joints.

    Args:
        days: Difference of each recording from the value, shape (recordings, n, 2).
        values: Friction, shape (n, 2).
    """
    if len(days) < 2:
        return np.zeros_like(values)
    share = np.std(days, axis=0, ddof=1) / np.where(values > 0, values, np.inf)
    return np.maximum(share, np.sqrt(np.mean(share**2, axis=0)))


def _softest(robot: Robot, eq: Equations, coulomb: Array) -> float:
    """Return the presliding distance [rad] that lets light joints be simulated."""
    context = robot.plant.CreateDefaultContext()
    least = np.full(robot.n, np.inf)
    for q in eq.q[:: max(1, len(eq.q) // 50)]:
        robot.plant.SetPositions(context, q)
        least = np.minimum(least, np.diagonal(robot.plant.CalcMassMatrix(context)))
    return float(np.max(PRESLIDING_DAMPING_TIME * coulomb / least) / _MAX_STICKING)


def _speeds(v: Array) -> Array:
    """Return absolute speeds with the distribution of the recorded ones [rad/s]."""
    return np.quantile(np.abs(v), np.linspace(0.02, 1, _PLACES)) if len(v) else np.ones(1)


def _half(terms: tuple[Term, ...], v: Array, sign: int) -> Array:
    """Return the odd (sign -1) or even (sign 1) part of friction terms, shape (places, terms)."""
    least = 1e-9
    columns = [(term.at(v, least) + sign * term.at(-v, least)) / 2 for term in terms]
    return np.column_stack(columns)


def _best_peaks(
    eq: Equations, speeds: Sequence[Array], wanted: Sequence[Array]
) -> tuple[list[tuple[Array, float]], list[float | None]]:
    """Return the nearest friction of each joint with its residual, and its Stribeck speed or None.

    One speed counts for all joints if it halves what is left, and another one for a joint of whose
    friction more than _MIN_LEFT is left, if it halves that.

    Args:
        eq: The equations, which have the terms of all speeds that are tried.
        speeds: Absolute speeds of each joint [rad/s].
        wanted: Friction at these speeds [N m].
    """
    tried = [
        {peak: _nearest(v, tau, peak)
         for peak in (None, *(term.width for term in terms if term.kind == "stribeck"))}
        for v, tau, terms in zip(speeds, wanted, eq.terms, strict=True)
    ]  # fmt: skip

    def chosen(of: Sequence[Fits], peaks: Iterable[float], now: float | None) -> float | None:
        left = {peak: sum(fits[peak][1] for fits in of) for peak in (now, *peaks)}
        best = min(left, key=lambda peak: left[peak])
        return best if left[best] < _MAX_RATIO * left[now] else now

    common = chosen(tried, PEAKS, None)
    peaks = [
        chosen([fits], filter(None, fits), common) if fits[common][1] > _MIN_LEFT else common
        for fits in tried
    ]
    return [fits[peak] for fits, peak in zip(tried, peaks, strict=True)], peaks


def _basis(v: Array, peak: float | None) -> Array:
    """Return columns of viscous, Coulomb and, with a peak [rad/s], Stribeck friction."""
    columns = [v, np.ones_like(v)]
    if peak is not None:
        shown = Term("stribeck", peak).at(v, 1.0)
        columns.append(shown if shown.max() > _MIN_VISIBLE else np.zeros_like(v))
    return np.column_stack(columns)


def _nearest(v: Array, tau: Array, peak: float | None) -> tuple[Array, float]:
    """Fit viscous, Coulomb and Stribeck friction >= 0; return them and the relative residual."""
    basis = _basis(v, peak)
    size = np.linalg.norm(basis, axis=0)
    size[size == 0] = 1.0  # a peak that no recorded speed reaches is 0
    x, left = nnls(basis / size, tau)
    return x / size, float(left / max(np.linalg.norm(tau), 1e-12))
