"""The shapes of a robot's file, for drawing."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path
from urllib.parse import unquote

from sdt_drake.io.resources import PACKAGE_PREFIX
from sdt_drake.robot.robot import Robot
from sdt_drake.robot.sdf import parse_xml

MESHES = (".obj", ".gltf", ".vtk")
"""Suffixes of the meshes that Drake draws."""

_NAMING = re.compile(r"(?:mtllib|map_|bump|disp|decal|refl)[^\r\n]*")


def drawable(robot: Robot) -> tuple[str, list[str]]:
    """Read a robot's file for drawing, with absolute paths of its meshes.

    Returns:
        The text of the file, and one sentence for each omitted mesh: link, mesh and reason.
    """
    root = parse_xml(robot.path.read_bytes(), robot.path, shapes=True)
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
    uri, text = mesh.find("uri"), _uri(mesh)
    if text.startswith(PACKAGE_PREFIX) and ".." not in text:
        return ""
    path = _found(text, file)
    if path is None:
        return f"{text} is missing"
    if path.suffix.lower() not in MESHES:
        return f"{text} has an unsupported format, expected one of {', '.join(MESHES)}"
    if outside := _outside(path):
        return f"{text} refers to a file outside of its folder, {outside}"
    if uri is None:
        mesh.set("filename", f"file://{path}")
    else:
        uri.text = f"file://{path}"
    return ""


def _outside(mesh: Path) -> str:
    """Return a file outside of the folder above an .obj that it or its materials refer to, or "".

    Drake would embed this file in the page, whatever it contains.
    """
    if mesh.suffix.lower() != ".obj":  # Drake itself restricts .gltf to its folder
        return ""
    words = _words(mesh)
    materials = [place for word in words if (place := mesh.parent / word).is_file()]
    words += [word for place in materials for word in _words(place)]
    home = mesh.resolve().parent.parent
    return next((x for x in words if not (mesh.parent / x).resolve().is_relative_to(home)), "")


def _words(file: Path) -> list[str]:
    """Return all words of the lines that refer to other files."""
    return " ".join(_NAMING.findall(file.read_bytes().decode("latin-1"))).replace("\0", "").split()


def _found(text: str, file: Path) -> Path | None:
    """Find the file of a URI. A package is a folder of its name above the robot's file."""
    kind, slashes, rest = text.rpartition("://")
    places = [file.parent / unquote(rest)]
    if slashes and kind != "file":
        package, _, inner = unquote(rest).partition("/")
        places = [folder / package / inner for folder in file.resolve().parents]
    return next((place.resolve() for place in places if place.is_file()), None)
