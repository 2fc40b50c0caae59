"""Files of an identified robot: SDF, friction, and directions of uncertainty of its links.

A study draws robots along these directions.
"""

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import nnls

from sdt_drake.io.arrays import Array
from sdt_drake.io.files import write_text
from sdt_drake.machine.identify.base_parameters import motor_parameters
from sdt_drake.machine.identify.consistency import effect_of, links_of
from sdt_drake.machine.identify.friction import Term
from sdt_drake.machine.identify.procedure import Identified
from sdt_drake.robot.device import PRESLIDING_DAMPING_TIME, Friction
from sdt_drake.robot.robot import Robot, edited
from sdt_drake.robot.sdf import DRAKE, SYMMETRIC, links_by_name, parse_xml, set_inertia

_SPREAD = 0.5  # relative standard deviation of links that were not measured
_PEAKS = (0.005, 0.01, 0.02, 0.05, 0.1)  # speeds of a Stribeck peak [rad/s]
_MAX_RATIO = 0.5  # residual with a Stribeck peak over that without, for it to be used
_MIN_VISIBLE = 0.1  # share of a peak's height that recorded speeds reach, for it to be used
_PLACES = 200  # speeds at which friction laws are compared
_MAX_STICKING = 5e3  # natural frequency of a sticking joint [rad/s], far above every loop


@dataclass(frozen=True, eq=False)
class PlantFriction:
    """The friction of a scenario (`plant.friction`) that is closest to the identified laws.

    Apart from an offset, it is the same in both directions and always brakes.
    """

    friction: Friction
    """Friction in addition to the damping of the robot's file, joint side."""
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


def identified_robot(found: Identified) -> Robot:
    """Return the robot with the identified links and motors."""
    return edited(found.nominal, lambda root: _put(found, root))


def _put(found: Identified, root: ET.Element) -> None:
    """Put identified links and rotors into the XML of an SDF."""
    elements = links_by_name(root)
    for link, pseudo in zip(found.consistent.links, found.consistent.pseudo, strict=True):
        set_inertia(elements[link.name], *link.inertial(pseudo))
    robot, motors = found.nominal, found.consistent.motors
    before = motor_parameters(robot)
    joints = {joint.get("name"): joint for joint in root.iter("joint")}
    for k, name in enumerate(robot.joint_names):
        if motors[k] != before[k]:
            rotor = joints[name].find(f"{DRAKE}rotor_inertia")
            if rotor is None:
                rotor = ET.SubElement(joints[name], f"{DRAKE}rotor_inertia")
            rotor.text = repr(float(motors[k] / robot.gear_ratio[k] ** 2))


def save_robot(found: Identified, path: Path) -> None:
    """Write the identified robot as an SDF file; shapes are kept if the robot's file is an SDF."""
    file, text = found.nominal.path, found.nominal.sdf
    is_sdf = file.suffix == ".sdf"
    root = parse_xml(file.read_bytes() if is_sdf else text, file, shapes=is_sdf)
    root.set("xmlns:drake", "http://drake.mit.edu")
    if found.nominal.is_coupled:
        root.set("xmlns:sdt", "urn:sdt_drake")
    _put(found, root)
    for mesh in root.iter("uri"):
        if mesh.text and "://" not in mesh.text:  # relative to the file that it was read from
            mesh.text = str((file.parent / mesh.text).resolve())
    ET.indent(root)
    write_text(path, ET.tostring(root, encoding="unicode") + "\n")


def directions(found: Identified, robot: Robot) -> Array:
    """Return directions of uncertainty: changes S of pseudo-inertias L exp(S) L'.

    Each direction is one standard deviation. Independent draws along them have the identified
    covariance of the base parameters, to first order. Parameters that were not measured vary by
    half of their value in the file. Every draw is physically consistent, since L exp(S) L' is
    positive definite. Motors do not change.

    Args:
        found: The identification.
        robot: The identified robot.

    Returns:
        The entries SYMMETRIC of S for each link in the order of the file, shape (r, 10 links).
    """
    names = [link.name for link in found.consistent.links]
    order = list(links_by_name(parse_xml(robot.sdf, robot.path)))
    effect = np.zeros((11 * robot.n, 10 * len(order)))
    for link in links_of(robot):
        if link.name in names:
            at = 10 * order.index(link.name)
            root = np.linalg.cholesky(link.to_link @ link.pseudo @ link.to_link.T)
            factor = np.asarray(np.linalg.solve(link.to_link, root))
            effect[:, at : at + 10] = effect_of(robot, link, factor)
    A = found.unknown.base.combination @ effect[found.unknown.columns]
    r = len(A)
    # Entries of S off the diagonal stand for two entries of the matrix.
    weight = np.tile([1.0 if i == j else np.sqrt(0.5) for i, j in SYMMETRIC], len(order))
    believed = (_SPREAD * weight) ** 2
    S = found.estimate.covariance[:r, :r]
    spread = (A * believed) @ A.T
    # Posterior of prior and measurement; then its principal directions.
    gain = spread @ np.linalg.pinv(spread + S, rcond=1e-14, hermitian=True)
    posterior = spread - gain @ spread
    values, vectors = np.linalg.eigh((posterior + posterior.T) / 2)
    keep = values > 1e-12 * values.max(initial=0.0)
    back = believed[:, None] * A.T @ np.linalg.pinv(spread, rcond=1e-12, hermitian=True)
    return np.asarray((back @ (vectors[:, keep] * np.sqrt(values[keep]))).T)


def plant_friction(found: Identified) -> PlantFriction:
    """Return the friction of a scenario that is closest to the identified laws."""
    robot, estimate = found.nominal, found.estimate
    r = len(estimate.beta)
    covariance = estimate.covariance[r:, r:]
    moves, speed = found.equations.moves, found.equations.speed
    speeds = [_speeds(speed[moves[:, k], k]) for k in range(robot.n)]
    parts = [estimate.friction_of(k) for k in range(robot.n)]
    odd, even = (
        [_half(law.terms, v, sign) for law, v in zip(estimate.laws, speeds, strict=True)]
        for sign in (-1, 1)
    )
    wanted = [
        law @ found.friction[part] - damping * v
        for law, part, v, damping in zip(odd, parts, speeds, robot.damping, strict=True)
    ]
    simple = [_nearest(v, tau, None) for v, tau in zip(speeds, wanted, strict=True)]
    best, peak = simple, None
    for width in _PEAKS:
        tried = [_nearest(v, tau, width) for v, tau in zip(speeds, wanted, strict=True)]
        if sum(left for _, left in tried) < (_MAX_RATIO if peak is None else 1.0) * sum(
            x for _, x in best
        ):
            best, peak = tried, width
    x = np.array([[*found_, 0.0][:3] for found_, _ in best])
    given: dict[str, Any] = {"coulomb": x[:, 1], "viscous": x[:, 0]}
    if peak is not None:
        given |= {"breakaway": x[:, 1] + x[:, 2], "stribeck_speed": peak}
    given["offset"] = [
        np.mean(law @ found.friction[part]) for law, part in zip(even, parts, strict=True)
    ]
    softest = max(Friction().presliding, _softest(found, x[:, 1]))
    friction = Friction(**given, presliding=softest)
    std, undecided, days = [], [], []
    for k, (v, law, part, (values, _)) in enumerate(zip(speeds, odd, parts, best, strict=True)):
        basis = _basis(v, peak)[:, : len(values)]
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
    return PlantFriction(friction, wide[:, ::-1].T, between[:, ::-1].T, np.array(undecided), left)


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


def _softest(found: Identified, coulomb: Array) -> float:
    """Return the presliding distance [rad] that lets light joints be simulated."""
    robot = identified_robot(found)
    context, rows = robot.plant.CreateDefaultContext(), found.equations.q
    least = np.full(robot.n, np.inf)
    for q in rows[:: max(1, len(rows) // 50)]:
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
