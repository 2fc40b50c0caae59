"""Meshes in formats that Drake does not draw, converted to OBJ and glTF, which it does."""

import atexit
import io
import tempfile
import xml.etree.ElementTree as ET
from functools import cache, lru_cache
from pathlib import Path

import numpy as np

from sdt_drake.io.errors import InputError, needing, one_line
from sdt_drake.io.files import checked_input

CONVERTED = (".stl", ".dae")
"""Suffixes of the meshes that are converted."""

_MAX_BYTES = 100_000_000
_Z_UP_TO_Y_UP = np.array(
    [[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]]
)  # Drake turns back


def converted(mesh: Path) -> Path:
    """Convert an STL mesh to OBJ, a COLLADA mesh with its colours to glTF.

    The file stays until the process ends. An OBJ gets the colour of the robot's file. Lengths are
    metres, or as COLLADA's unit says; z is up whatever its up axis is, as in ROS. Pictures that
    COLLADA names are not read.

    Raises:
        InputError: trimesh is not installed, or the file cannot be read.
    """
    return _converted(mesh, mesh.stat().st_mtime_ns)


@lru_cache(maxsize=1000)
def _converted(mesh: Path, changed: int) -> Path:
    with needing("needs trimesh, which is not installed", "sdt_drake[meshes]"):
        import collada  # noqa: F401
        import trimesh
        from trimesh.exchange.gltf import export_gltf
        from trimesh.exchange.obj import export_obj
    data, kind = checked_input(mesh, _MAX_BYTES).read_bytes(), mesh.suffix.lower().removeprefix(".")
    if kind == "dae" and (b"<!DOCTYPE" in data or b"\0" in data):
        raise InputError("has a <!DOCTYPE> or is no UTF-8, which is not supported")
    try:
        if kind == "dae" and _placed(ET.fromstring(data)) > _MAX_BYTES:
            raise ValueError("too many nodes")
        scene = trimesh.load_scene(io.BytesIO(data), file_type=kind)
        if scene.bounds is None or not np.isfinite(scene.bounds).all():
            raise ValueError("no triangles")
        if kind == "dae":
            scene = scene.convert_units("meters").apply_transform(_Z_UP_TO_Y_UP)
            content, suffix = export_gltf(scene, embed_buffers=True)["model.gltf"], ".gltf"
        else:
            content, suffix = export_obj(scene.to_mesh()).encode(), ".obj"
    except Exception as error:  # the libraries raise many types
        # Of bytes that are no text, trimesh asks for a library that guesses their encoding.
        why = "neither binary nor text" if isinstance(error, ImportError) else one_line(error)
        raise InputError(f"cannot be read as {mesh.suffix} ({why})") from None
    file = Path(_folder()) / f"{len(list(Path(_folder()).iterdir()))}{suffix}"
    file.write_bytes(content)
    return file


def _placed(root: ET.Element) -> int:
    """Return the size of a COLLADA scene with all that its nodes place, again and again [bytes].

    Raises:
        ValueError: a node within itself.
    """
    named = {f"#{one.get('id')}": one for one in root.iter() if one.get("id")}
    sizes: dict[ET.Element, int] = {}

    def size(part: ET.Element) -> int:
        if part not in sizes:
            sizes[part] = -1  # is being measured
            inner = [*part.iterfind("{*}node")]
            inner += [named[one.get("url", "")] for one in part if one.tag.endswith(_INSTANCES)]
            own = _NODE_BYTES if part.tag.endswith("}node") else sum(map(len, part.itertext()))
            sizes[part] = own + sum(map(size, inner))
        if sizes[part] < 0:
            raise ValueError("a node within itself")
        return sizes[part]

    return sum(map(size, root.iterfind(".//{*}visual_scene/{*}node")))


_INSTANCES = ("}instance_node", "}instance_geometry", "}instance_controller")
_NODE_BYTES = 50_000  # of text that take as long to read as a node


@cache
def _folder() -> str:
    folder = tempfile.TemporaryDirectory(prefix="sdt_drake_meshes_")
    atexit.register(folder.cleanup)
    return folder.name
