"""The shapes of a robot's file, without those that cannot be drawn."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path
from urllib.parse import unquote

from sdt_drake.io.resources import PACKAGE_PREFIX
from sdt_drake.robot.robot import Robot
from sdt_drake.robot.sdf import parse_xml

MESHES = (".obj", ".gltf", ".vtk")
"""Kinds of meshes that Drake draws."""

_NAMING = re.compile(r"(?:mtllib|map_|bump|disp|decal|refl)[^\r\n]*")


def drawable(robot: Robot) -> tuple[str, list[str]]:
    """Read the file of a robot for drawing: its text, with meshes by their whole paths.

    Returns:
        The text, and a sentence for each mesh that is left out: its file, its link, and why.
    """
    root = parse_xml(robot.path.read_bytes(), robot.path, shapes=True)
    told = []
    for link in root.iter("link"):
        for collision in link.findall("collision"):
            link.remove(collision)
        for visual in link.findall("visual"):
            why = [text for mesh in visual.iter("mesh") if (text := _placed(mesh, robot.path))]
            if why:
                link.remove(visual)
                told.append(f"link '{link.get('name')}': mesh {why[0]}")
    return ET.tostring(root, encoding="unicode"), told


def mesh_files(robot: Robot) -> dict[str, Path]:
    """Files of the meshes that a robot's file names beside itself or in a package, by their
    URIs."""
    root = parse_xml(robot.path.read_bytes(), robot.path, shapes=True)
    uris = {
        text for mesh in root.iter("mesh") if not (text := _uri(mesh)).startswith(PACKAGE_PREFIX)
    }
    return {uri: path for uri in sorted(uris) if (path := _found(uri, robot.path))}


def _uri(mesh: ET.Element) -> str:
    uri = mesh.find("uri")
    return mesh.get("filename", "") if uri is None else (uri.text or "").strip()


def _placed(mesh: ET.Element, file: Path) -> str:
    """Give a mesh its whole path; or why it cannot be drawn."""
    uri, text = mesh.find("uri"), _uri(mesh)
    if text.startswith(PACKAGE_PREFIX) and ".." not in text:
        return ""
    path = _found(text, file)
    if path is None:
        return f"{text} is not there"
    if path.suffix.lower() not in MESHES:
        return f"{text} is not drawn, expected one of {', '.join(MESHES)}"
    if outside := _outside(path):
        return f"{text} has materials or pictures elsewhere, {outside}"
    if uri is None:
        mesh.set("filename", f"file://{path}")
    else:
        uri.text = f"file://{path}"
    return ""


def _outside(mesh: Path) -> str:
    """What an .obj names for its looks beyond the folder above its own, or its materials do; "" if
    nothing. Whatever it is, Drake would put it into the page."""
    if mesh.suffix.lower() != ".obj":  # Drake itself keeps to the folder of a .gltf
        return ""
    words = _words(mesh)
    materials = [place for word in words if (place := mesh.parent / word).is_file()]
    words += [word for place in materials for word in _words(place)]
    home = mesh.resolve().parent.parent
    return next((x for x in words if not (mesh.parent / x).resolve().is_relative_to(home)), "")


def _words(file: Path) -> list[str]:
    """All words in lines that name other files."""
    return " ".join(_NAMING.findall(file.read_bytes().decode("latin-1"))).replace("\0", "").split()


def _found(text: str, file: Path) -> Path | None:
    """The file of a URI; packages are folders above the robot's file, by their names."""
    kind, slashes, rest = text.rpartition("://")
    places = [file.parent / unquote(rest)]
    if slashes and kind != "file":
        package, _, inner = unquote(rest).partition("/")
        places = [folder / package / inner for folder in file.resolve().parents]
    return next((place.resolve() for place in places if place.is_file()), None)
