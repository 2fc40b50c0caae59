"""Meshes of a robot's file: which are drawn, and which files they bring."""

import os
import sys
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from helpers.robots import URDF
from pydrake.geometry import SceneGraph
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from sdt_drake.robot.robot import load_robot
from sdt_drake.robot.shapes import drawable


def gltf(text):
    return f'{{"asset": {{"version": "2.0"}}, {text}}}'


LIBRARY, SECRET = "mtllib a.mtl", "../secret"
ABOVE = {"a.obj": LIBRARY, "a.mtl": "map_Kd ../textures/a.png"}
INSIDE = [
    {"a.obj": f"v 0 0 0\r\n {LIBRARY}", "a.mtl": "# by /usr/x\nmap_Kd -s 1 1 1 looks/a.png\n"},
    {"a.obj": "mtllib looks/a.mtl", "looks/a.mtl": "map_Kd ./none.png\nbump b.png\nmap_d C:\\c"},
    {"a.gltf": gltf('"images": [{"uri": "looks/a%20b.png"}], "buffers": [{"uri": "data:,/x"}]')},
    ABOVE | {"../package.xml": ""},
]  # fmt: skip
"""Files in the folder of a robot, or above it, with a mesh, the first, that keeps to it."""
OUTSIDE = [
    (ABOVE, "../textures/a.png"),
    ({"a.obj": f"mtllib {SECRET}"}, SECRET),
    ({"a.obj": f"mtllib \n\n{SECRET}"}, SECRET),  # on the next line, as Drake reads it
    ({"a.obj": f"# xmtllib{SECRET}"}, SECRET),
    ({"a.obj": "mtllib link"}, "link"),
    ({"a.obj": "mtllib l\x1fk"}, "l\x1fk"),  # white space to Python, not to Drake
    ({"a.obj": "mtllib link\0.mtl"}, "link\0.mtl"),
    ({"a.obj": "mtllib pipe"}, "pipe"),
    ({"a.obj": LIBRARY, "a.mtl": "bump /etc/hosts"}, "/etc/hosts"),
    ({"a.obj": LIBRARY, "a.mtl": f"map_Kd -s 1 1 1 {SECRET}"}, SECRET),
    ({"a.obj": LIBRARY, "a.mtl": f"map_Kd \n{SECRET} map_Ks a\r"}, SECRET),
    ({"a.obj": LIBRARY, "a.mtl": f"map_Kd a\nmap_Ks\n\n{SECRET}\v"}, SECRET),
    ({"a.obj": LIBRARY, "a.mtl": "MAP_KD https://x.y/z"}, "https://x.y/z"),  # a browser does
    ({"a.obj": LIBRARY, "a.mtl": "norm \\\\x.y\\z"}, "\\\\x.y\\z"),
    ({"a.obj": "mtllib looks/a.mtl", "looks/a.mtl": "map_Kd ../../secret"}, "../../secret"),
    ({"a.gltf": gltf('"images": [{"uri": "/etc/hosts"}]')}, "/etc/hosts"),
    ({"a.gltf": gltf('"buffers": [{"uri": "looks/../../secret"}]')}, "looks/../../secret"),
    ({"a.gltf": gltf('"images": [{"uri": "%2e%2e/secret"}]')}, "%2e%2e/secret"),
    ({"a.gltf": gltf('"images": [{"u\\u0072i": "link"}]')}, "link"),
    ({"a.gltf": gltf('"images": [{"uri": "link", "uri": "a"}], "images": []')}, "link"),
    ({"a.gltf": gltf('"images": [{"uri": "\\thttp:x.y/z"}]')}, "\thttp:x.y/z"),
    ({"a.gltf": gltf('"images": [{"uri": "DATA:,x"}]')}, "DATA:,x"),
]  # fmt: skip
"""Files in the folder of a robot with a mesh that brings others, and their name in it."""


@pytest.fixture
def with_mesh(tmp_path):
    """Makes a robot with a mesh of these files, and tells why the mesh is not drawn."""
    home = tmp_path / "description"
    (home / "looks").mkdir(parents=True)
    (tmp_path / "secret").write_text("secret", encoding="utf-8")
    for name, to in {"link": SECRET, "l\x1fk": SECRET}.items():
        (home / name).symlink_to(to)
    os.mkfifo(home / "pipe")

    def told(files, mesh=""):
        for name, text in files.items():
            (home / name).write_bytes(text.encode())
        mesh = mesh or f'filename="{next(iter(files))}"'
        link = f'<link name="upper"><visual><geometry><mesh {mesh}/></geometry></visual>'
        (home / "arm.urdf").write_text(URDF.replace('<link name="upper">', link), encoding="utf-8")
        return " ".join(drawable(load_robot(home / "arm.urdf"))[1])

    return told


@pytest.mark.parametrize("files", INSIDE)
def test_mesh_takes_textures_from_its_folders(with_mesh, files):
    assert with_mesh(files) == ""


@pytest.mark.parametrize("files, name", OUTSIDE)
def test_mesh_that_refers_to_foreign_files_is_not_drawn(with_mesh, files, name):
    """They would be in a page that is handed on."""
    told = with_mesh(files)
    assert told.startswith("link 'upper': mesh a.") and f" refers to {name}, expected " in told


def test_urdf_mesh_is_read_from_the_checked_path(with_mesh, tmp_path):
    """Drake reads an attribute, and <uri> only in an SDF."""
    files = {"a.obj": "", "b.obj": f"mtllib {SECRET}"}
    mesh = 'filename="file:///b.obj"><uri>a.obj</uri></mesh><none'
    assert with_mesh(files, mesh) == ""
    robot = load_robot(tmp_path / "description" / "arm.urdf")
    mesh = ET.fromstring(drawable(robot)[0]).find(".//mesh")
    checked = f"file://{tmp_path}/description/a.obj"
    assert (mesh.get("filename"), mesh.find("uri").text) == (checked, checked)


@pytest.mark.parametrize("text", ["", "[" * 100_000, "\xff", '{"a": 1} x'])
def test_broken_mesh_is_left_out_with_reason(with_mesh, text):
    assert with_mesh({"a.gltf": text}) == "link 'upper': mesh a.gltf is not valid glTF"
    many = "\n".join(f"map_Kd {k}" for k in range(2001))
    told = with_mesh({"a.obj": LIBRARY, "a.mtl": many})
    assert told == "link 'upper': mesh a.obj refers to more than 2000 files"


PLACES = [
    ("a%20b.obj", "a b.obj"),
    ("file://a%20b.obj", "a b.obj"),
    ("package://description/looks/a.gltf", "looks/a.gltf"),
    ("none.obj", "none.obj is missing"),
    ("package://sdt/../../a.obj", "package://sdt/../../a.obj is missing"),
    ("package://{ros}/looks/a.gltf", "looks/a.gltf"),
    ("package://other/looks/a.gltf", "package://other/looks/a.gltf is missing"),
    ("a.ply", "a.ply has an unsupported format, expected one of .obj, .gltf, .vtk, .stl, .dae"),
    ("a.dae", "a.dae cannot be read as .dae (no element found"),
    ("b.dae", "b.dae has a <!DOCTYPE> or is no UTF-8, which is not supported"),
    ("a.stl", "a.stl cannot be read as .stl (no triangles)"),
]
"""Names of meshes, and the files that they are, or why they are not drawn."""


@pytest.mark.parametrize("uri, expected", PLACES)
def test_mesh_is_found_beside_its_robot_or_in_its_package(with_mesh, tmp_path, uri, expected):
    files = {"a b.obj": "", "a.dae": "", "b.dae": "<!DOCTYPE a>", "a.stl": "solid a\nendsolid a"}
    files |= {"looks/a.gltf": gltf('"images": []'), "a.ply": ""}
    files["package.xml"] = "<package><name>{ros}</name></package>"
    told, home = with_mesh(files, f'filename="{uri}"'), tmp_path / "description"
    mesh = ET.fromstring(drawable(load_robot(home / "arm.urdf"))[0]).find(".//mesh")
    if expected in files:
        assert (told, mesh.get("filename")) == ("", f"file://{home / expected}")
    else:
        assert told.startswith(f"link 'upper': mesh {expected}") and mesh is None


STL = """solid box
facet normal 0 0 0|outer loop|vertex 0 0 0|vertex 4 0 0|vertex 0 2 0|endloop|endfacet
facet normal 0 0 0|outer loop|vertex 0 0 0|vertex 4 0 0|vertex 0 0 1|endloop|endfacet
endsolid box""".replace("|", "\n")
DAE = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="0.5"/><up_axis>Y_UP</up_axis></asset>
<library_images><image id="i"><init_from>../secret</init_from></image></library_images>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="12">0 0 0 8 0 0 0 4 0 0 0 2</float_array>
<technique_common><accessor source="#a" count="4" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="2"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2 0 1 3</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


@pytest.mark.parametrize(("name", "text"), [("a.stl", STL), ("a.DAE", DAE)])
def test_converted_mesh_has_the_corners_of_its_file(with_mesh, tmp_path, name, text):
    """4 m along x, 2 m along y, 1 m along z, of COLLADA in units of 0.5 m; z is up as in ROS."""
    assert with_mesh({name: text}) == ""
    robot = load_robot(tmp_path / "description" / "arm.urdf")
    plant, scene_graph = MultibodyPlant(0.0), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    Parser(plant).AddModelsFromString(drawable(robot)[0], "urdf")
    (shape,) = plant.GetVisualGeometriesForBody(plant.GetBodyByName("upper"))
    mesh = scene_graph.model_inspector().GetShape(shape)
    corners = mesh.GetConvexHull()
    found = np.array([corners.vertex(k) for k in range(corners.num_vertices())])
    np.testing.assert_allclose(
        [found.min(axis=0), found.max(axis=0)], [[0, 0, 0], [4, 2, 1]], atol=1e-9
    )


def test_mesh_without_its_library_is_left_out_with_what_installs_it(with_mesh, monkeypatch):
    monkeypatch.setitem(sys.modules, "trimesh", None)
    told = with_mesh({"other.stl": STL})
    what, remedy = told.split(", which is not installed: ")
    assert what == "link 'upper': mesh other.stl needs trimesh"
    assert remedy == "pip install 'sdt_drake[meshes]'"


NODE = '<node><instance_geometry url="#g"/></node>'
AGAIN = "".join(
    f'<node id="n{k + 1}"><instance_node url="#n{k}"/><instance_node url="#n{k}"/></node>'
    for k in range(30)
)
LIBRARY_OF_NODES = f'<library_nodes><node id="n0"/>{AGAIN}</library_nodes><library_visual_scenes>'
ENDLESS = [
    ('<node><instance_node url="#n30"/></node>', LIBRARY_OF_NODES, "too many nodes"),
    ('<node id="a"><instance_node url="#a"/></node>', "<library_visual_scenes>", "within itself"),
    (3000 * "<node>" + 3000 * "</node>", "<library_visual_scenes>", "maximum recursion depth"),
]


@pytest.mark.parametrize(("node", "library", "why"), ENDLESS, ids=[case[-1] for case in ENDLESS])
def test_collada_that_places_itself_without_end_is_left_out(with_mesh, node, library, why):
    text = DAE.replace("<library_visual_scenes>", library).replace(NODE, node)
    assert why in with_mesh({"a.dae": text})
