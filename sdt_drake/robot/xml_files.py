"""Robots' files as XML: reading SDF and URDF."""

import itertools
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple
from xml.parsers import expat

from sdt_drake.io.errors import InputError
from sdt_drake.robot.held import hold_joints, told_held
from sdt_drake.robot.published import cleaned
from sdt_drake.robot.urdf import sdf_of_urdf

SUFFIXES = (".sdf", ".urdf")
"""Suffixes of robots' files, in small or capital letters."""


def is_robot(name: str | Path) -> bool:
    """Return whether a file is a robot by its suffix, also one that is to be expanded by xacro."""
    return Path(name).suffix.lower() in (*SUFFIXES, ".xacro")


class RobotXml(NamedTuple):
    """A robot's file as SDF, without shapes."""

    root: ET.Element
    """The <sdf> element."""
    notes: list[str]
    """One sentence for each thing that was left out, renamed or held."""
    held: dict[str, float]
    """Positions of held joints by their names [rad, m]."""
    without_mass: list[str]
    """Names of the links of a URDF that have no <inertial>."""


def read_robot_file(file: Path, hold: str | Sequence[str] = (), tip: str = "") -> RobotXml:
    """Read a robot as SDF, from an SDF or URDF file, without shapes.

    Args:
        file: the file.
        hold, tip: what is held, as in `hold_joints`.

    Raises:
        InputError: another suffix, no XML, xacro, or what `hold_joints` refuses.
    """
    if not is_robot(file):
        raise InputError(f"{file}: expected an .sdf or .urdf file")
    root = parse_xml(file.read_bytes(), file)
    is_sdf = file.suffix.lower() == ".sdf"
    notes = [] if is_sdf else cleaned(root, file)
    held = hold_joints(root, hold, tip, file)
    root, without_mass = (root, []) if is_sdf else sdf_of_urdf(root, file)
    return RobotXml(root, [*notes, *told_held(held)], held, without_mass)


def parse_xml(data: bytes | str, file: Path, *, shapes: bool = False) -> ET.Element:
    """Parse an XML text without comments, with prefixes as written.

    Drake gets a text written from the result. Drake's own parser would stop reading a number at a
    comment, entity or section.

    Args:
        data: the text.
        file: the file, for messages.
        shapes: keep shapes, and omit <include> instead.

    Raises:
        InputError: malformed XML, a <!DOCTYPE>, or too many elements or attributes.
    """
    builder, reader, path = ET.TreeBuilder(), expat.ParserCreate(), []
    left_out, count = {"include"} if shapes else _SHAPES, itertools.count()

    def start(tag: str, attributes: dict[str, str]) -> None:
        path.append(tag)
        if len(path) > _MAX_DEPTH:
            raise InputError(f"{file}: more than {_MAX_DEPTH} nested elements, expected a robot")
        if next(count) == _MAX_ELEMENTS:
            raise InputError(f"{file}: more than {_MAX_ELEMENTS} elements, expected a robot")
        if len(attributes) > _MAX_ATTRIBUTES:
            raise InputError(
                f"{file}: <{short(tag)}> has {len(attributes)} attributes, expected at most "
                f"{_MAX_ATTRIBUTES}"
            )
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


# Drake's time grows with the square of an element's attributes.
_MAX_DEPTH, _MAX_ELEMENTS, _MAX_ATTRIBUTES = 50, 20_000, 50
_SHAPES = {"visual", "collision", "drake:collision_filter_group"}  # there is no contact here


def short(text: str) -> str:
    """Return a text for messages, cut to 40 characters."""
    return text if len(text) <= 40 else f"{text[:40]}..."
