"""The SDF of a robot: checks that Drake's parser omits, and edits."""

import re
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import (
    MAX_NUMBER,
    InputError,
    Problem,
    gathering,
    raise_all,
    suggestion,
)
from sdt_drake.robot.coupling import TURNS_WITH
from sdt_drake.robot.rounding import last_digit, nearest_inertia
from sdt_drake.robot.xml_files import short

DRAKE = "drake:"
"""Prefix of Drake's own elements. Drake ignores the address of this namespace."""


# --- checks ----------------------------------------------------------------------------------

_PARTS, _MAX_PARTS = ("link", "joint", "frame"), 1000  # Drake's time grows with their square
# Elements with numbers, and the allowed counts of numbers in each.
_MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
_LIMITS = ("lower", "upper", "effort", "velocity", f"{DRAKE}acceleration")  # may be infinite
_SIGNS = {f"{DRAKE}acceleration": ">", "friction": ">="}
_MOTOR = (f"{DRAKE}rotor_inertia", f"{DRAKE}gear_ratio")
# Elements that must be zero, because they are not modelled.
_ZERO = {
    "spring_stiffness": "springs are not supported",
    "spring_reference": "springs are not supported",
}
_SCALARS = ("mass", *_MOMENTS, *_LIMITS, *_MOTOR, TURNS_WITH, "damping", "friction", *_ZERO)
_COUNTS = {"pose": (0, 6, 7), "xyz": (3,)} | dict.fromkeys(_SCALARS, (1,))
_PLAIN = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_INFINITE = re.compile(r"[+-]?inf(inity)?", re.IGNORECASE)
# Elements without effect here, and the allowed parents of elements with a prefix.
_UNKNOWN = {"include", "mimic", "axis2", "fluid_added_mass"}
_DRAKES = {*(("joint", tag) for tag in (*_MOTOR, TURNS_WITH)), ("limit", f"{DRAKE}acceleration")}
_OWN = TURNS_WITH.partition(":")[0] + ":"
_MAX_NAME = 100  # characters


def check_sdf(root: ET.Element, file: Path) -> list[str]:
    """Check for content that Drake's parser would misread, complete, replace or ignore.

    An inertia that became impossible by rounding is replaced by the nearest possible one, in place.

    Returns:
        One sentence for each replaced inertia.

    Raises:
        InputError: such content; the message has the file, the link or joint, and the element.
    """
    if root.tag != "sdf" or not re.fullmatch(r"1\.\d\d?", root.get("version", "")):
        given = short(f"{root.tag} version='{root.get('version', '')}'")
        raise InputError(f"{file}: <{given}>, expected <sdf version='1.9'> or the like")
    models = root.findall(".//model")
    if len(models) != 1:
        raise InputError(f"{file}: {len(models)} models, expected one")
    if sum(element.tag in _PARTS for element in root.iter()) > _MAX_PARTS:
        raise InputError(
            f"{file}: more than {_MAX_PARTS} links, joints and frames, expected a robot"
        )
    problems: list[Problem] = []
    for element in root.iter():
        with gathering(problems):
            _check_name(element, file)
    parts = set(models[0])
    inside = set(models[0].iter())
    around = [element for element in root.iter() if element not in inside]
    for part in (*around, models[0], *models[0]):
        name = f"{part.tag} '{part.get('name')}'" if part.get("name") else f"<{part.tag}>"
        below = part.iter() if part in parts else (part,)
        for element in below:
            with gathering(problems):
                _check_element(element, f"{file}: {name}")
    raise_all(problems)
    texts = []
    for link in root.iter("link"):
        name = f"link '{link.get('name')}'"
        with gathering(problems):
            if text := _check_inertial(link, f"{file}: {name}"):
                texts.append(f"{name}: {text}")
    raise_all(problems)
    return texts


def zero_limits(root: ET.Element) -> dict[str, list[str]]:
    """Set limits of 0 or -1 [N m, rad/s], by which none is known, to infinite, in place.

    Returns:
        Names of the joints with such an "effort" or "velocity".
    """
    found: dict[str, list[str]] = {"effort": [], "velocity": []}
    for joint in root.iter("joint"):
        for limit in joint.iter("limit"):
            for tag, names in found.items():
                element = limit.find(tag)
                if element is not None and float(element.text or 0) <= 0:
                    element.text = "inf"
                    names.append(joint.get("name", ""))
    return found


def _check_name(element: ET.Element, file: Path) -> None:
    name = element.get("name", "a name")
    if not name.isprintable() or not 0 < len(name) <= _MAX_NAME:
        raise InputError(
            f"{file}: <{short(element.tag)}> has the name {short(name)!r}, expected 1 to "
            f"{_MAX_NAME} printable characters"
        )


def _check_element(element: ET.Element, where: str) -> None:
    """Check that all numbers of an element are valid, and that all its children have an effect."""
    children = Counter((child.tag, child.get("name") or child.get("joint")) for child in element)
    drakes = [tag for parent, tag in _DRAKES if parent == element.tag]
    for tag, name in children:
        bare = tag.removeprefix(DRAKE).removeprefix(_OWN)
        if tag in _UNKNOWN or (tag not in drakes and (tag != bare or DRAKE + tag in drakes)):
            raise InputError(
                f"{where}: <{short(bare)}> in <{element.tag}> is not supported or would have no "
                f"effect; {suggestion(DRAKE + bare, drakes, 'remove it')}"
            )
        if children[tag, name] > 1:
            again = f"<{short(tag)}>" if name is None else f"{short(tag)} '{name}'"
            raise InputError(f"{where}: {again} more than once in <{element.tag}>")
    if element.tag not in _COUNTS:
        return
    values = numbers(element, where)
    if element.tag in _ZERO and values[0] != 0:
        tag = element.tag
        raise InputError(f"{where}: <{tag}> {element.text}, {_ZERO[tag]}; remove it")
    if element.tag in _LIMITS and abs(values[0]) > MAX_NUMBER:  # some programs print 1.79769e308
        element.text = "inf" if values[0] > 0 else "-inf"
    sign = _SIGNS.get(element.tag, "")
    if (sign == ">" and values[0] <= 0) or (sign == ">=" and values[0] < 0):
        tag = element.tag.removeprefix(DRAKE)
        raise InputError(f"{where}: <{tag}> {element.text}, expected a number {sign} 0")


def numbers(element: ET.Element, where: str) -> list[float]:
    """Read the numbers of an element. Drake's parser would silently stop at the first letter.

    Raises:
        InputError: a malformed number, or the wrong count of numbers.
    """
    text = (element.text or "").strip(_BLANK)
    words = re.split(f"[{_BLANK}]+", text) if text else []
    counts = _COUNTS[element.tag]
    if len(words) in counts and not len(element) and all(_is_number(w, element) for w in words):
        return [float(word) for word in words]
    expected = "a number" if counts == (1,) else f"{' or '.join(map(str, counts[-2:]))} numbers"
    tag = element.tag.removeprefix(DRAKE)
    raise InputError(f"{where}: <{tag}> is '{short(text)}', expected {expected}")


_BLANK = " \t\r\n"


def _is_number(word: str, element: ET.Element) -> bool:
    if _PLAIN.fullmatch(word):
        return element.tag in _LIMITS or abs(float(word)) <= MAX_NUMBER
    return element.tag in _LIMITS and _INFINITE.fullmatch(word) is not None


def _check_inertial(link: ET.Element, where: str) -> str:
    """Check mass and inertia of a link, and correct an inertia impossible by rounding, in place.

    Returns:
        A sentence on the correction; "" if there is none.

    Raises:
        InputError: mass or inertia is impossible.
    """
    mass, inertia = mass_and_inertia(link, where)
    if mass < 0:
        raise InputError(f"{where}: <mass> {mass:g} kg, expected a number >= 0")
    moments = np.linalg.eigvalsh(inertia)
    if mass == 0 and np.any(moments != 0):
        raise InputError(
            f"{where}: <inertia> without <mass>, expected both zero, or a small mass with an "
            "inertia that obeys the triangle inequality (J about one axis, J/2 about the others)"
        )
    missed = float(moments[2] - moments[0] - moments[1])
    if missed <= 1e-12 * moments[2] and moments[0] >= 0:
        return ""
    digit = last_digit(link)
    nearest = nearest_inertia(inertia, digit)
    if nearest is not None:
        _write_inertia(link, nearest)
        return (
            f"inertia misses the triangle inequality by {missed:.2g} kg m², within its last "
            f"printed digit, {digit:g}; set to the nearest possible inertia"
        )
    if moments[0] < 0:
        raise InputError(
            f"{where}: inertia has the principal moment {moments[0]:g} kg m², expected >= 0"
        )
    raise InputError(
        f"{where}: inertia breaks the triangle inequality, principal moments "
        f"{moments[0]:g} + {moments[1]:g} < {moments[2]:g} kg m²"
    )


def mass_and_inertia(link: ET.Element, where: str) -> tuple[float, Array]:
    """Read mass [kg] and central inertia [kg m²], shape (3, 3), along the axes of <inertial>.

    Raises:
        InputError: a missing number, for which Drake would use 1.
    """
    mass = link.find("inertial/mass")
    if mass is None:
        raise InputError(f"{where}: no <mass>; Drake would use 1 kg")
    inertia = np.zeros((3, 3))
    for key in _MOMENTS:
        i, j = "xyz".index(key[1]), "xyz".index(key[2])
        element = link.find(f"inertial/inertia/{key}")
        if element is None and i == j:
            raise InputError(f"{where}: no <{key}>; Drake would use 1 kg m²")
        if element is not None:
            inertia[i, j] = inertia[j, i] = numbers(element, where)[0]
    return numbers(mass, where)[0], inertia


# --- masses and inertias of links, changed in place ------------------------------------------


def links_by_name(root: ET.Element) -> dict[str, ET.Element]:
    """Return all links by name, in the order of the file."""
    return {link.get("name", ""): link for link in root.iter("link")}


def link_named(root: ET.Element, name: str, where: str) -> ET.Element:
    """Return the link of this name.

    Raises:
        InputError: no such link, at the place `where`; the message lists the links.
    """
    links = links_by_name(root)
    if name not in links:
        raise InputError(f"no link '{name}', expected one of {', '.join(links)}", place=where)
    return links[name]


def child(parent: ET.Element, tag: str) -> ET.Element:
    """Return the child of this tag, and create it if missing."""
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
        pose.attrib.clear()  # such as the format of a quaternion
        pose.text = "0 0 0 0 0 0"
    values = (pose.text or "").split()
    position = [repr(float(x) + float(dx)) for x, dx in zip(values[:3], offset, strict=True)]
    pose.text = " ".join(position + values[3:])


def set_inertia(link: ET.Element, mass: float, com: Array, central: Array) -> None:
    """Set mass, centre of mass and inertia of a link.

    Args:
        link: the link.
        mass: mass [kg].
        com: centre of mass in the frame of the link [m], shape (3,).
        central: inertia about the centre of mass, along the axes of this frame [kg m²], shape
            (3, 3).
    """
    inertial = child(link, "inertial")
    inertial.clear()
    child(inertial, "pose").text = " ".join([*(repr(float(x)) for x in com), "0 0 0"])
    child(inertial, "mass").text = repr(float(mass))
    _write_inertia(link, central)


def _write_inertia(link: ET.Element, inertia: Array) -> None:
    """Set the moments of inertia of a link, along the axes of its <inertial>."""
    moments = child(child(link, "inertial"), "inertia")
    for i, j in zip(*np.triu_indices(3), strict=True):
        child(moments, f"i{'xyz'[i]}{'xyz'[j]}").text = repr(float(inertia[i, j]))


# --- pseudo-inertia --------------------------------------------------------------------------
# [Sigma h; h' m] with h = m c and Sigma the second moments of the mass about the origin of a frame.
# A body is possible if this matrix is positive definite (Wensing, Kim, Slotine 2018).


def pseudo_inertia(mass: float, com: Array, central: Array) -> Array:
    """Compute the pseudo-inertia of a body, shape (4, 4).

    Args:
        mass: mass [kg].
        com: centre of mass [m], shape (3,).
        central: inertia about the centre of mass [kg m²], shape (3, 3).
    """
    sigma = np.trace(central) / 2 * np.eye(3) - central + mass * np.outer(com, com)
    h = mass * np.asarray(com)[:, None]
    return np.block([[sigma, h], [h.T, np.array([[mass]])]])


def body_of(pseudo: Array) -> tuple[float, Array, Array]:
    """Return mass, centre of mass and central inertia of a pseudo-inertia."""
    mass = float(pseudo[3, 3])
    com = pseudo[:3, 3] / mass
    sigma = pseudo[:3, :3] - mass * np.outer(com, com)
    return mass, com, np.trace(sigma) * np.eye(3) - sigma


SYMMETRIC = tuple(zip(*np.triu_indices(4), strict=True))
"""Indices of the ten independent entries of a symmetric (4, 4) matrix."""


def symmetric(entries: Array) -> Array:
    """Make the symmetric (4, 4) matrix of the ten entries SYMMETRIC."""
    matrix = np.zeros((4, 4))
    for value, (i, j) in zip(entries, SYMMETRIC, strict=True):
        matrix[i, j] = matrix[j, i] = value
    return matrix


def stretched(pseudo: Array, change: Array) -> Array:
    """Change a pseudo-inertia P = L L' to L exp(S) L', which is possible for any symmetric S.

    Args:
        pseudo: P, shape (4, 4).
        change: the ten entries of S, see SYMMETRIC.
    """
    root = np.linalg.cholesky(pseudo)
    values, vectors = np.linalg.eigh(symmetric(change))
    return np.asarray(root @ (vectors * np.exp(values)) @ vectors.T @ root.T)
