"""What was identified as files of a robot: an SDF, friction as a scenario has it, and directions in
which links may differ from that, along which a study can draw."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import nnls

from sdt_drake.io.arrays import Array
from sdt_drake.io.files import write_text
from sdt_drake.machine.identify.consistency import effect_of, links_of
from sdt_drake.machine.identify.friction import Term
from sdt_drake.machine.identify.procedure import Identified
from sdt_drake.robot.device import PRESLIDING_DAMPING_TIME, Friction
from sdt_drake.robot.robot import Robot, edited
from sdt_drake.robot.sdf import DRAKE, SYMMETRIC, links_by_name, parse_xml, set_inertia

_SPREAD = 0.5  # of links about those of the file, where nothing was measured
_PEAKS = (0.005, 0.01, 0.02, 0.05, 0.1)  # rad/s, of Stribeck friction
_WORTH = 0.5  # of what is left, for a peak to be believed: it trades with the other two
_SEEN = 0.1  # of its height, where a peak shows: one that no speed comes near could be any size
_PLACES = 200
_STIFFEST = 5e3  # rad/s, of a joint that sticks: far above every loop, and quick to simulate


@dataclass(frozen=True, eq=False)
class PlantFriction:
    """Friction as `plant.friction` of a scenario has it, the nearest to the identified laws.

    But for an offset, that is the same both ways, and never drives.

    Attributes:
        friction: joint side; beside the damping of the robot's file.
        std: standard deviations of coulomb [N m] and viscous [N m s/rad], shape (2, n): by noise,
            by how far the values are apart that other laws give, where data do not decide, and by
            the spread between recordings.
        between: share of a value that is the spread between recordings, shape (2, n); 0 of one.
        undecided: the share of these variances that is of the laws, the larger one, shape (n,).
        left: RMS difference to what of the laws is the same both ways, at the recorded speeds, over
            the RMS of this, shape (n,).
    """

    friction: Friction
    std: Array
    between: Array
    undecided: Array
    left: Array


def identified_robot(found: Identified) -> Robot:
    """The robot with its links and motors as identified."""
    return edited(found.nominal, lambda root: _put(found, root))


def _put(found: Identified, root: ET.Element) -> None:
    """Into the XML of an SDF: links that were free, and rotors."""
    elements = links_by_name(root)
    for link, pseudo in zip(found.consistent.links, found.consistent.pseudo, strict=True):
        set_inertia(elements[link.name], *link.inertial(pseudo))
    robot, motors = found.nominal, found.consistent.motors
    joints = {joint.get("name"): joint for joint in root.iter("joint")}
    for k, name in enumerate(robot.joint_names):
        if motors[k] != robot.reflected_inertia[k]:
            rotor = joints[name].find(f"{DRAKE}rotor_inertia")
            if rotor is None:
                rotor = ET.SubElement(joints[name], f"{DRAKE}rotor_inertia")
            rotor.text = repr(float(motors[k] / robot.gear_ratio[k] ** 2))


def save_robot(found: Identified, path: Path) -> None:
    """Write the robot as an SDF file: that of the file it began with, with its shapes if it is
    one."""
    file, text = found.nominal.path, found.nominal.sdf
    is_sdf = file.suffix == ".sdf"
    root = parse_xml(file.read_bytes() if is_sdf else text, file, shapes=is_sdf)
    root.set("xmlns:drake", "http://drake.mit.edu")
    if found.nominal.is_coupled:
        root.set("xmlns:sdt", "urn:sdt_drake")
    _put(found, root)
    for mesh in root.iter("uri"):
        if mesh.text and "://" not in mesh.text:  # beside the file it was read from
            mesh.text = str((file.parent / mesh.text).resolve())
    ET.indent(root)
    write_text(path, ET.tostring(root, encoding="unicode") + "\n")


def directions(found: Identified, robot: Robot) -> Array:
    """Changes S of the links' pseudo-inertias, L exp(S) L', a standard deviation of each.

    Drawn independently, to first order they have the identified covariance of the base parameters;
    where nothing was measured, they are spread by half of what they are in the file. As L exp(S) L'
    is always a body that can be, so is every draw. Motors stay.

    Args:
        found: what was identified.
        robot: the identified one.

    Returns:
        Shape (r, 10 links): the entries SYMMETRIC of S for each link of the file, in its order.
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
    # Of S as of a symmetric matrix: its entries off the diagonal stand for two.
    weight = np.tile([1.0 if i == j else np.sqrt(0.5) for i, j in SYMMETRIC], len(order))
    believed = (_SPREAD * weight) ** 2
    S = found.estimate.covariance[:r, :r]
    spread = (A * believed) @ A.T
    # Both what was believed and what was measured; then its principal directions.
    gain = spread @ np.linalg.pinv(spread + S, rcond=1e-14, hermitian=True)
    posterior = spread - gain @ spread
    values, vectors = np.linalg.eigh((posterior + posterior.T) / 2)
    keep = values > 1e-12 * values.max(initial=0.0)
    back = believed[:, None] * A.T @ np.linalg.pinv(spread, rcond=1e-12, hermitian=True)
    return np.asarray((back @ (vectors[:, keep] * np.sqrt(values[keep]))).T)


def plant_friction(found: Identified) -> PlantFriction:
    """The friction of a scenario that is nearest to the identified laws."""
    robot, estimate = found.nominal, found.estimate
    r = len(estimate.beta)
    covariance = estimate.covariance[r:, r:]
    speeds = [_speeds(found.equations.v[found.equations.moves[:, k], k]) for k in range(robot.n)]
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
        if sum(left for _, left in tried) < (_WORTH if peak is None else 1.0) * sum(
            x for _, x in best
        ):
            best, peak = tried, width
    x = np.array([[*found_, 0.0][:3] for found_, _ in best])
    friction = Friction(coulomb=x[:, 1].tolist(), viscous=x[:, 0].tolist())
    if peak is not None:
        friction.breakaway = (x[:, 1] + x[:, 2]).tolist()
        friction.stribeck_speed = peak
    friction.offset = [
        float(np.mean(law @ found.friction[part])) for law, part in zip(even, parts, strict=True)
    ]
    friction.presliding = max(friction.presliding, _softest(found, x[:, 1]))
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
    """Standard deviation between recordings over the value, shape (n, 2): that of each joint, or
    where it is larger that of all, as two recordings of one joint may be alike by chance.

    Args:
        days: what each recording adds, shape (recordings, n, 2).
        values: of friction, shape (n, 2).
    """
    if len(days) < 2:
        return np.zeros_like(values)
    share = np.std(days, axis=0, ddof=1) / np.where(values > 0, values, np.inf)
    return np.maximum(share, np.sqrt(np.mean(share**2, axis=0)))


def _softest(found: Identified, coulomb: Array) -> float:
    """How far joints may give way before they slide, so that light ones can be simulated [rad]."""
    robot = identified_robot(found)
    context, rows = robot.plant.CreateDefaultContext(), found.equations.q
    least = np.full(robot.n, np.inf)
    for q in rows[:: max(1, len(rows) // 50)]:
        robot.plant.SetPositions(context, q)
        least = np.minimum(least, np.diagonal(robot.plant.CalcMassMatrix(context)))
    return float(np.max(PRESLIDING_DAMPING_TIME * coulomb / least) / _STIFFEST)


def _speeds(v: Array) -> Array:
    """Speeds at which a joint was seen, as often as there, without their signs [rad/s]."""
    return np.quantile(np.abs(v), np.linspace(0.02, 1, _PLACES)) if len(v) else np.ones(1)


def _half(terms: tuple[Term, ...], v: Array, sign: int) -> Array:
    """What terms of friction do against the motion, the same both ways (sign -1), or in one
    direction whichever way it goes (1), shape (places, terms)."""
    least = 1e-9
    columns = [(term.at(v, least) + sign * term.at(-v, least)) / 2 for term in terms]
    return np.column_stack(columns)


def _basis(v: Array, peak: float | None) -> Array:
    """Viscous, Coulomb and, with a peak at some speed, Stribeck friction."""
    columns = [v, np.ones_like(v)]
    if peak is not None:
        shown = Term("stribeck", peak).at(v, 1.0)
        columns.append(shown if shown.max() > _SEEN else np.zeros_like(v))
    return np.column_stack(columns)


def _nearest(v: Array, tau: Array, peak: float | None) -> tuple[Array, float]:
    """Viscous, Coulomb, Stribeck >= 0, and the share of tau that they leave."""
    basis = _basis(v, peak)
    size = np.linalg.norm(basis, axis=0)
    size[size == 0] = 1.0  # a peak that was not seen gets nothing
    x, left = nnls(basis / size, tau)
    return x / size, float(left / max(np.linalg.norm(tau), 1e-12))
