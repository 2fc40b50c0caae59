"""Files of an identified robot: SDF, and directions of uncertainty of its links.

A study draws robots along these directions.
"""

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.files import write_text
from sdt_drake.machine.identify.consistency import effect_of, links_of
from sdt_drake.machine.identify.plant import put_identified, with_identified
from sdt_drake.machine.identify.procedure import Identified
from sdt_drake.robot.robot import Robot
from sdt_drake.robot.sdf import SYMMETRIC, links_by_name
from sdt_drake.robot.xml_files import parse_xml

_SPREAD = 0.5  # relative standard deviation of links that were not measured


def identified_robot(found: Identified) -> Robot:
    """Return the robot with the identified links and motors."""
    return with_identified(found.nominal, found.consistent, found.plant_friction.damping)


def save_robot(found: Identified, path: Path) -> None:
    """Write the identified robot as an SDF file; shapes are kept if the robot's file is an SDF."""
    file, text = found.nominal.path, found.nominal.sdf
    is_sdf = file.suffix.lower() == ".sdf"
    root = parse_xml(file.read_bytes() if is_sdf else text, file, shapes=is_sdf)
    root.set("xmlns:drake", "http://drake.mit.edu")
    if found.nominal.is_coupled:
        root.set("xmlns:sdt", "urn:sdt_drake")
    put_identified(root, found.nominal, found.consistent, found.plant_friction.damping)
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
