"""Masses and inertias of links in the XML of an SDF, changed in place."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence

import numpy as np

from sdt_drake.arrays import Array
from sdt_drake.errors import InputError


def links_by_name(root: ET.Element) -> dict[str, ET.Element]:
    """All links, in the order of the file."""
    return {link.get("name", ""): link for link in root.iter("link")}


def link_named(root: ET.Element, name: str, where: str) -> ET.Element:
    """The link of this name.

    Raises:
        InputError: starting with `where`, and listing the links, if there is none of this name.
    """
    links = links_by_name(root)
    if name not in links:
        raise InputError(f"{where}: no link '{name}', expected one of {', '.join(links)}")
    return links[name]


def child(parent: ET.Element, tag: str) -> ET.Element:
    """The child of this tag; made if there is none."""
    found = parent.find(tag)
    return ET.SubElement(parent, tag) if found is None else found


def scale_link(link: ET.Element, factor: float) -> None:
    """Multiply a link's mass and inertia by `factor`."""
    for element in (*link.findall("inertial/mass"), *link.findall("inertial/inertia/*")):
        element.text = repr(float(element.text or "") * float(factor))


def shift_link(link: ET.Element, offset: Sequence[float]) -> None:
    """Move a link's centre of mass by `offset` [m], in the frame of the link."""
    pose = child(child(link, "inertial"), "pose")
    if not (pose.text or "").strip():  # at the link's origin
        pose.attrib.clear()  # it might ask for a quaternion
        pose.text = "0 0 0 0 0 0"
    values = (pose.text or "").split()
    position = [repr(float(x) + float(dx)) for x, dx in zip(values[:3], offset, strict=True)]
    pose.text = " ".join(position + values[3:])


def set_inertia(link: ET.Element, mass: float, com: Array, central: Array) -> None:
    """Give a link another body.

    Args:
        link: the link.
        mass: [kg].
        com: centre of mass in the frame of the link [m], shape (3,).
        central: inertia about it, along the axes of that frame [kg m²], shape (3, 3).
    """
    inertial = child(link, "inertial")
    inertial.clear()
    child(inertial, "pose").text = " ".join([*(repr(float(x)) for x in com), "0 0 0"])
    child(inertial, "mass").text = repr(float(mass))
    for i, j in zip(*np.triu_indices(3), strict=True):
        moment = child(child(inertial, "inertia"), f"i{'xyz'[i]}{'xyz'[j]}")
        moment.text = repr(float(central[i, j]))


# --- pseudo-inertia --------------------------------------------------------------------------
# [Sigma h; h' m] with h = m c and Sigma the second moments of the mass about the origin of a frame;
# a body can be if it is positive definite (Wensing, Kim, Slotine 2018, see identification).


def pseudo_inertia(mass: float, com: Array, central: Array) -> Array:
    """Of a body, shape (4, 4): mass [kg], centre [m], inertia about it [kg m²]."""
    sigma = np.trace(central) / 2 * np.eye(3) - central + mass * np.outer(com, com)
    h = mass * np.asarray(com)[:, None]
    return np.block([[sigma, h], [h.T, np.array([[mass]])]])


def body_of(pseudo: Array) -> tuple[float, Array, Array]:
    """Mass, centre and central inertia of a pseudo-inertia."""
    mass = float(pseudo[3, 3])
    com = pseudo[:3, 3] / mass
    sigma = pseudo[:3, :3] - mass * np.outer(com, com)
    return mass, com, np.trace(sigma) * np.eye(3) - sigma


SYMMETRIC = tuple(zip(*np.triu_indices(4), strict=True))
"""Entries of a symmetric (4, 4) matrix that say all of it."""


def symmetric(entries: Array) -> Array:
    """The matrix of these ten entries."""
    matrix = np.zeros((4, 4))
    for value, (i, j) in zip(entries, SYMMETRIC, strict=True):
        matrix[i, j] = matrix[j, i] = value
    return matrix


def stretched(pseudo: Array, change: Array) -> Array:
    """L exp(S) L' of P = L L': another body that can be, whatever the symmetric S, of which
    `change` has the ten entries."""
    root = np.linalg.cholesky(pseudo)
    values, vectors = np.linalg.eigh(symmetric(change))
    return np.asarray(root @ (vectors * np.exp(values)) @ vectors.T @ root.T)
