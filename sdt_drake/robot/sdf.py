"""The XML of a robot: read from SDF or URDF, checked for what a parser would misread, changed."""

from __future__ import annotations

import itertools
import re
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from xml.parsers import expat

import numpy as np

from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.fields import suggestion
from sdt_drake.robot.coupling import TURNS_WITH
from sdt_drake.robot.rounding import last_digit, nearest_inertia
from sdt_drake.robot.urdf import sdf_of_urdf

DRAKE = "drake:"
"""Prefix of Drake's own elements; it goes by that alone, whatever address it is declared with."""


def read_robot_file(file: Path) -> tuple[ET.Element, list[str]]:
    """What an SDF or URDF says of the motion of its robot, as an SDF; and what of it has no say.

    Raises:
        InputError: if it is neither, or no XML.
    """
    if file.suffix not in (".sdf", ".urdf"):
        raise InputError(f"{file}: expected an .sdf or .urdf file")
    root = parse_xml(file.read_bytes(), file)
    return sdf_of_urdf(root, file) if file.suffix == ".urdf" else (root, [])


def parse_xml(data: bytes | str, file: Path, *, shapes: bool = False) -> ET.Element:
    """The elements of an XML text, prefixes as they are written; comments left out, and shapes
    where they are not asked for; with shapes, other files that are included.

    What Drake is given is written anew from these. So it sees no comment, entity or section within
    a number, at which its own XML parser would stop reading.
    """
    builder, reader, path = ET.TreeBuilder(), expat.ParserCreate(), []
    left_out, count = {"include"} if shapes else _SHAPES, itertools.count()

    def start(tag: str, attributes: dict[str, str]) -> None:
        path.append(tag)
        if len(path) > _DEEPEST:
            raise InputError(f"{file}: more than {_DEEPEST} elements within each other")
        if next(count) == _MOST:
            raise InputError(f"{file}: more than {_MOST} elements, expected a robot")
        if not left_out.intersection(path):
            builder.start(tag, attributes)

    def end(tag: str) -> None:
        if not left_out.intersection(path):
            builder.end(tag)
        path.pop()

    def text(data: str) -> None:
        if not left_out.intersection(path):
            builder.data(data)

    def refuse(*_: object) -> None:
        raise InputError(f"{file}: <!DOCTYPE> is not supported; remove it")

    reader.StartElementHandler, reader.EndElementHandler = start, end
    reader.CharacterDataHandler, reader.StartDoctypeDeclHandler = text, refuse
    try:
        reader.Parse(data, True)
    except InputError:
        raise
    except (expat.ExpatError, ValueError, LookupError) as error:
        raise InputError(f"{file}: not well-formed XML ({error})") from None
    return builder.close()


_DEEPEST, _MOST = 50, 20_000  # elements
_PARTS, _MOST_PARTS = ("link", "joint", "frame"), 1000  # Drake takes the time of their square
_SHAPES = {"visual", "collision", f"{DRAKE}collision_filter_group"}  # nothing touches anything here


# --- what is refused -------------------------------------------------------------------------

# Numbers of an SDF that move a robot, and how many there may be in one element.
_MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
_LIMITS = ("lower", "upper", "effort", "velocity", f"{DRAKE}acceleration")  # may be infinite
_POSITIVE = ("velocity", f"{DRAKE}acceleration")  # Drake takes a speed < 0 for no limit
_MOTOR = (f"{DRAKE}rotor_inertia", f"{DRAKE}gear_ratio")
# Elements that must be zero, because nothing here models them.
_ZERO = {
    "friction": "Drake would drop it",
    "spring_stiffness": "springs are not supported",
    "spring_reference": "springs are not supported",
}
_SCALARS = ("mass", *_MOMENTS, *_LIMITS, *_MOTOR, TURNS_WITH, "damping", *_ZERO)
_COUNTS = {"pose": (0, 6, 7), "xyz": (3,)} | dict.fromkeys(_SCALARS, (1,))
_PLAIN = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_INFINITE = re.compile(r"[+-]?inf(inity)?", re.IGNORECASE)
# Elements without effect here, and where those with a prefix have one.
_UNKNOWN = {"include", "mimic", "axis2", "fluid_added_mass"}
_DRAKES = {*(("joint", tag) for tag in (*_MOTOR, TURNS_WITH)), ("limit", f"{DRAKE}acceleration")}
_OWN = TURNS_WITH.partition(":")[0] + ":"
_LONGEST_NAME = 100


def check_sdf(root: ET.Element, file: Path) -> list[str]:
    """Refuse what the SDF parser would misread, fill in, replace or drop without an error.

    Inertias that no body can have by rounding alone become the nearest that one can, in place.

    Returns:
        A sentence for each of these.

    Raises:
        InputError: naming the file, the link or joint, and the element.
    """
    if root.tag != "sdf" or not re.fullmatch(r"1\.\d\d?", root.get("version", "")):
        given = _short(f"{root.tag} version='{root.get('version', '')}'")
        raise InputError(f"{file}: <{given}>, expected <sdf version='1.9'> or the like")
    models = root.findall(".//model")
    if len(models) != 1:
        raise InputError(f"{file}: {len(models)} models, expected one")
    for element in root.iter():
        _check_name(element, file)
    if sum(element.tag in _PARTS for element in root.iter()) > _MOST_PARTS:
        raise InputError(
            f"{file}: more than {_MOST_PARTS} links, joints and frames, expected a robot"
        )
    parts = set(models[0])
    inside = set(models[0].iter())
    around = [element for element in root.iter() if element not in inside]
    for part in (*around, models[0], *models[0]):
        name = f"{part.tag} '{part.get('name')}'" if part.get("name") else f"<{part.tag}>"
        below = part.iter() if part in parts else (part,)
        for element in below:
            _check_element(element, f"{file}: {name}")
    links = [(link, f"link '{link.get('name')}'") for link in root.iter("link")]
    told = [_check_inertial(link, f"{file}: {name}") for link, name in links]
    return [f"{name}: {text}" for (_, name), text in zip(links, told, strict=True) if text]


def _check_name(element: ET.Element, file: Path) -> None:
    name = element.get("name", "a name")
    if not name.isprintable() or not 0 < len(name) <= _LONGEST_NAME:
        raise InputError(
            f"{file}: <{_short(element.tag)}> has the name {_short(name)!r}, expected 1 to "
            f"{_LONGEST_NAME} characters that can be printed"
        )


def _check_element(element: ET.Element, where: str) -> None:
    """Every number is one, every element is read, and has an effect."""
    children = Counter((child.tag, child.get("name") or child.get("joint")) for child in element)
    drakes = [tag for parent, tag in _DRAKES if parent == element.tag]
    for tag, name in children:
        bare = tag.removeprefix(DRAKE).removeprefix(_OWN)
        if tag in _UNKNOWN or (tag not in drakes and (tag != bare or DRAKE + tag in drakes)):
            raise InputError(
                f"{where}: <{_short(bare)}> in <{element.tag}> is not supported or would have no "
                f"effect; {suggestion(DRAKE + bare, drakes, 'remove it')}"
            )
        if children[tag, name] > 1:
            again = f"<{_short(tag)}>" if name is None else f"{_short(tag)} '{name}'"
            raise InputError(f"{where}: {again} more than once in <{element.tag}>")
    if element.tag not in _COUNTS:
        return
    values = numbers(element, where)
    if element.tag in _ZERO and values[0] != 0:
        tag = element.tag
        raise InputError(f"{where}: <{tag}> {element.text}, {_ZERO[tag]}; remove it")
    if element.tag in _POSITIVE and values[0] <= 0:
        tag = element.tag.removeprefix(DRAKE)
        raise InputError(f"{where}: <{tag}> {element.text}, expected a number > 0")


def numbers(element: ET.Element, where: str) -> list[float]:
    """The numbers of an element; what Drake's parser would read up to some letter is none.

    Raises:
        InputError: naming `where`, if one is none, or there are too few or too many of them.
    """
    text = (element.text or "").strip(_BLANK)
    words = re.split(f"[{_BLANK}]+", text) if text else []
    counts = _COUNTS[element.tag]
    if len(words) in counts and not len(element) and all(_is_number(w, element) for w in words):
        return [float(word) for word in words]
    expected = "a number" if counts == (1,) else f"{' or '.join(map(str, counts[-2:]))} numbers"
    tag = element.tag.removeprefix(DRAKE)
    raise InputError(f"{where}: <{tag}> is '{_short(text)}', expected {expected}")


_BLANK = " \t\r\n"


def _is_number(word: str, element: ET.Element) -> bool:
    if _PLAIN.fullmatch(word):
        return bool(np.isfinite(float(word)))
    return element.tag in _LIMITS and _INFINITE.fullmatch(word) is not None


def _short(text: str) -> str:
    return text if len(text) <= 40 else f"{text[:40]}..."


def _check_inertial(link: ET.Element, where: str) -> str:
    """No mass and no inertia, or mass > 0 and principal moments that some body can have; what
    rounding has changed of them is put right, and told."""
    mass, inertia = mass_and_inertia(link, where)
    if mass < 0:
        raise InputError(f"{where}: <mass> {mass:g} kg, expected a number >= 0")
    moments = np.linalg.eigvalsh(inertia)
    if mass == 0 and np.any(moments != 0):
        raise InputError(
            f"{where}: <inertia> without <mass>, expected both zero, or a small mass with an "
            "inertia that keeps the triangle inequality (J about one axis: J/2 about the others)"
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
            f"printed digit, {digit:g}; taken as the nearest that a body can have"
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
    """Mass [kg] and central inertia [kg m²], shape (3, 3), along the axes of <inertial>.

    Raises:
        InputError: naming `where`, if a number is missing for which Drake would take 1.
    """
    mass = link.find("inertial/mass")
    if mass is None:
        raise InputError(f"{where}: no <mass>; Drake would take 1 kg")
    inertia = np.zeros((3, 3))
    for key in _MOMENTS:
        i, j = "xyz".index(key[1]), "xyz".index(key[2])
        element = link.find(f"inertial/inertia/{key}")
        if element is None and i == j:
            raise InputError(f"{where}: no <{key}>; Drake would take 1 kg m²")
        if element is not None:
            inertia[i, j] = inertia[j, i] = numbers(element, where)[0]
    return numbers(mass, where)[0], inertia


# --- masses and inertias of links, changed in place ------------------------------------------


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
        raise InputError(f"no link '{name}', expected one of {', '.join(links)}", place=where)
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
    _write_inertia(link, central)


def _write_inertia(link: ET.Element, inertia: Array) -> None:
    """Give a link other moments of inertia, along the axes of its <inertial>."""
    moments = child(child(link, "inertial"), "inertia")
    for i, j in zip(*np.triu_indices(3), strict=True):
        child(moments, f"i{'xyz'[i]}{'xyz'[j]}").text = repr(float(inertia[i, j]))


# --- pseudo-inertia --------------------------------------------------------------------------
# [Sigma h; h' m] with h = m c and Sigma the second moments of the mass about the origin of a frame;
# a body can be if it is positive definite (Wensing, Kim, Slotine 2018, see identification).


def pseudo_inertia(mass: float, com: Array, central: Array) -> Array:
    """Pseudo-inertia of a body, shape (4, 4): mass [kg], centre [m], inertia about it [kg m²]."""
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
    """The symmetric (4, 4) matrix of the ten entries SYMMETRIC."""
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
