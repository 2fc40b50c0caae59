"""Masses and inertias of links in the XML of an SDF, changed in place."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence

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


def child(element: ET.Element, name: str) -> ET.Element:
    """A child that every valid SDF has."""
    found = element.find(name)
    assert found is not None, name
    return found


def scale_link(link: ET.Element, factor: float) -> None:
    """Multiply a link's mass and inertia by `factor`."""
    for element in (*link.findall("inertial/mass"), *link.findall("inertial/inertia/*")):
        element.text = repr(float(element.text or "") * float(factor))


def shift_link(link: ET.Element, offset: Sequence[float]) -> None:
    """Move a link's centre of mass by `offset` [m], in the frame of the link."""
    inertial = child(link, "inertial")
    pose = inertial.find("pose")
    if pose is None:
        pose = ET.SubElement(inertial, "pose")
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
    old = child(link, "inertial")
    old.clear()
    ET.SubElement(old, "pose").text = " ".join([*(repr(float(x)) for x in com), "0 0 0"])
    ET.SubElement(old, "mass").text = repr(float(mass))
    inertia = ET.SubElement(old, "inertia")
    for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)):
        ET.SubElement(inertia, f"i{'xyz'[i]}{'xyz'[j]}").text = repr(float(central[i, j]))
