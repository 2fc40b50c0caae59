"""How links may differ from what was identified: as directions that a study can draw along."""

from __future__ import annotations

import numpy as np

from sdt_drake.arrays import Array
from sdt_drake.identification.consistency import SPREAD, effect_of, links_of
from sdt_drake.identification.procedure import Identified
from sdt_drake.robot import Robot
from sdt_drake.sdf import SYMMETRIC, links_by_name, parse_xml


def directions(found: Identified, robot: Robot) -> Array:
    """Changes S of the links' pseudo-inertias, L exp(S) L', a standard deviation of each.

    Drawn independently, to first order they have the identified covariance of the base parameters;
    where nothing was measured, that which `nearest_consistent` believes in. As L exp(S) L' is
    always a body that can be, so is every draw. Motors stay.

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
    believed = (SPREAD * weight) ** 2
    S = found.estimate.covariance[:r, :r]
    spread = (A * believed) @ A.T
    # Both what was believed and what was measured; then its principal directions.
    gain = spread @ np.linalg.pinv(spread + S, rcond=1e-14, hermitian=True)
    posterior = spread - gain @ spread
    values, vectors = np.linalg.eigh((posterior + posterior.T) / 2)
    keep = values > 1e-12 * values.max(initial=0.0)
    back = believed[:, None] * A.T @ np.linalg.pinv(spread, rcond=1e-12, hermitian=True)
    return np.asarray((back @ (vectors[:, keep] * np.sqrt(values[keep]))).T)
