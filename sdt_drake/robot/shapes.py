"""The shapes of a robot's file, for drawing."""

import json
import os
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from sdt_drake.io.errors import InputError
from sdt_drake.io.files import checked_input
from sdt_drake.io.resources import PACKAGE_PREFIX, models_dir
from sdt_drake.robot.held import weld
from sdt_drake.robot.meshes import CONVERTED, converted
from sdt_drake.robot.published import make_distinct
from sdt_drake.robot.robot import Robot
from sdt_drake.robot.xml_files import parse_xml

_MAX_PACKAGE = 1_000_000  # bytes of a package.xml

MESHES = (".obj", ".gltf", ".vtk")
"""Suffixes of the meshes that Drake draws."""


def drawable(robot: Robot) -> tuple[str, list[str]]:
    """Read a robot's file for drawing, with absolute paths of its meshes.

    Returns:
        The text of the file, and one sentence for each omitted mesh: link, mesh and reason.
    """
    root = parse_xml(robot.path.read_bytes(), robot.path, shapes=True)
    if root.tag == "robot":
        make_distinct(root)
    weld(root, robot.held, robot.path)
    omitted = []
    for link in root.iter("link"):
        for collision in link.findall("collision"):
            link.remove(collision)
        for visual in link.findall("visual"):
            why = [text for mesh in visual.iter("mesh") if (text := _placed(mesh, robot.path))]
            if why:
                link.remove(visual)
                omitted.append(f"link '{link.get('name')}': mesh {why[0]}")
    return ET.tostring(root, encoding="unicode"), omitted


def mesh_files(robot: Robot) -> dict[str, Path]:
    """Find the mesh files beside a robot's file or in its package, by URI."""
    root = parse_xml(robot.path.read_bytes(), robot.path, shapes=True)
    uris = {
        text for mesh in root.iter("mesh") if not (text := _uri(mesh)).startswith(PACKAGE_PREFIX)
    }
    return {uri: path for uri in sorted(uris) if (path := _found(uri, robot.path))}


def _uri(mesh: ET.Element) -> str:
    uri = mesh.find("uri")
    return mesh.get("filename", "") if uri is None else (uri.text or "").strip()


def _placed(mesh: ET.Element, file: Path) -> str:
    """Set the absolute path of a mesh. Return why it cannot be drawn, or ""."""
    text = _uri(mesh)
    path = _found(text, file)
    if path is None:
        return f"{text} is missing"
    suffix = path.suffix.lower()
    if suffix not in (*MESHES, *CONVERTED):
        known = ", ".join((*MESHES, *CONVERTED))
        return f"{text} has an unsupported format, expected one of {known}"
    try:
        path = converted(path) if suffix in CONVERTED else path
    except InputError as error:
        return f"{text} {error}"
    if suffix in MESHES and (why := _wrong_names(path, file)):
        return f"{text} {why}"
    for uri in mesh.findall("uri"):
        uri.text = f"file://{path}"
    if "filename" in mesh.attrib:  # a URDF, where Drake reads no other than this
        mesh.set("filename", f"file://{path}")
    return ""


def _found(text: str, file: Path) -> Path | None:
    """Find the file of a URI.

    A package is a folder above the robot's file, or beside one above it, with its name, or a folder
    above it whose package.xml has the name.
    """
    kind, slashes, rest = text.rpartition("://")
    places = [file.parent / unquote(rest)]
    if text.startswith(PACKAGE_PREFIX):
        places = [models_dir() / text.removeprefix(PACKAGE_PREFIX)]
    elif slashes and kind != "file":
        package, _, inner = unquote(rest).partition("/")
        above = file.resolve().parents
        places = [folder / package / inner for folder in above]
        places += [folder / inner for folder in above if _package_name(folder) == package]
    return next((place.resolve() for place in places if place.is_file()), None)


def _package_name(folder: Path) -> str:
    """Return the name of a ROS package by its package.xml; "" if the folder is none."""
    file = folder / "package.xml"
    try:
        root = parse_xml(checked_input(file, _MAX_PACKAGE).read_bytes(), file)
    except (InputError, OSError):
        return ""
    return (root.findtext("name") or "").strip()


# --- other files of a mesh -----------------------------------------------------------------------
# Drake embeds them in the page, whatever they contain. A browser asks for those that Drake lacks.

_MAX_NAMES = 2000
_MATERIALS = re.compile(rb"mtllib")
_PICTURES = re.compile(rb"map_|bump|disp|decal|refl|norm", re.IGNORECASE)
_ADDRESS = re.compile(r"[a-z][a-z0-9+.-]+:.", re.IGNORECASE)  # "https:"; one letter is a drive


def _wrong_names(mesh: Path, robot: Path) -> str:
    """Return what is wrong with the names of other files in a mesh, or "".

    They may lead to the folder of the robot, to that of the mesh, and to their package.
    """
    homes = [robot.resolve().parent, mesh.parent]
    for home in tuple(homes):  # and the folder of its ROS package
        above = (home, *home.parents)
        homes += [place for place in above if (place / "package.xml").is_file()][:1]
    seen: set[tuple[Path, str]] = set()
    try:
        for folder, name in _names(mesh):
            if (folder, name) not in seen and not _stays(folder, name, homes):
                shown = os.fsencode(name)[:100].decode("utf-8", "replace")
                return (
                    f"refers to {shown}, expected a file in the folder of the robot or of the "
                    "mesh, or in their package, which has a package.xml"
                )
            seen.add((folder, name))
            if len(seen) > _MAX_NAMES:
                return f"refers to more than {_MAX_NAMES} files"
    except (ValueError, RecursionError):
        return "is not valid glTF"
    return ""


def _stays(folder: Path, name: str, homes: list[Path]) -> bool:
    """Check whether a name of a file stays in some folders, as Drake or a browser reads it."""
    browsed = re.sub(r"[\x00-\x20]", "", unquote(name)).replace("\\", "/")
    if _ADDRESS.match(browsed):
        return False
    try:
        places = [(folder / text).resolve() for text in (name, unquote(name), browsed)]
        return all(
            any(map(place.is_relative_to, homes))
            and (place.is_file() or place.is_dir() or not place.exists())  # no device, no pipe
            for place in places
        )
    except (OSError, RuntimeError, ValueError):  # a link to itself, a name with a zero
        return False


def _names(mesh: Path) -> Iterator[tuple[Path, str]]:
    """Yield folders, and all words of a mesh and its materials that may be names of files there.

    Raises:
        ValueError: a .gltf is no JSON.
    """
    folder, kind = mesh.parent, mesh.suffix.lower()
    if kind == ".gltf":
        uris: list[str] = []

        def collect(pairs: list[tuple[str, Any]]) -> None:
            uris.extend(x for key, x in pairs if key == "uri" and isinstance(x, str))

        json.loads(mesh.read_bytes().decode("utf-8-sig"), object_pairs_hook=collect)
        yield from ((folder, uri) for uri in uris if not uri.startswith("data:"))
    for name in _words(mesh, _MATERIALS) if kind == ".obj" else ():
        yield folder, name  # is opened below only if the caller goes on
        file = folder / name
        for word in _words(file, _PICTURES) if file.is_file() else ():
            yield from ((place, word) for place in {folder, file.parent})


def _words(file: Path, key: re.Pattern[bytes]) -> Iterator[str]:
    """Yield all words of the lines with a key, what follows the key, and the next word after them.

    Drake's patterns accept a name on the next line, and no space after a key.
    """
    is_open = False
    for line in re.split(rb"[\r\n]+", file.read_bytes()):
        words, found = line.split(), key.search(line)
        if found:
            words += line[found.end() :].split(None, 1)[:1]
        elif words:
            words = words[:1] if is_open else []
        yield from map(os.fsdecode, dict.fromkeys(words))
        is_open = bool(found) or (is_open and not line.strip())
