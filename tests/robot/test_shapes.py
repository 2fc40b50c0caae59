"""Meshes of a robot's file: found beside it or in its package, or left out and named."""

from __future__ import annotations

import pytest
from robots import URDF

from sdt_drake.robot.robot import load_robot
from sdt_drake.robot.shapes import drawable

UPPER = '<link name="upper">'
MESH = '<visual><geometry><mesh filename="{}"/></geometry></visual>'


@pytest.fixture
def drawn(tmp_path):
    """Text to draw and what is left out, of the arm with a mesh."""
    (tmp_path / "arm_description" / "urdf").mkdir(parents=True)
    (tmp_path / "arm_description" / "meshes").mkdir()
    for place in ("urdf/a b.obj", "urdf/a.dae", "meshes/a.gltf"):
        (tmp_path / "arm_description" / place).write_text("", encoding="utf-8")

    def of(uri: str) -> tuple[str, list[str]]:
        path = tmp_path / "arm_description" / "urdf" / "arm.urdf"
        path.write_text(URDF.replace(UPPER, UPPER + MESH.format(uri)), encoding="utf-8")
        return drawable(load_robot(path))

    return of


URIS = [("a%20b.obj", "urdf/a b.obj"), ("file://a%20b.obj", "urdf/a b.obj")]
URIS += [("package://arm_description/meshes/a.gltf", "meshes/a.gltf")]


@pytest.mark.parametrize("uri, place", URIS)
def test_a_mesh_is_found(drawn, tmp_path, uri, place):
    text, left_out = drawn(uri)
    assert str((tmp_path / "arm_description" / place).resolve()) in text and left_out == []


@pytest.mark.parametrize(
    "uri, why",
    [
        ("none.obj", "is missing"),
        ("package://sdt/../../a.obj", "is missing"),
        ("a.dae", "has an unsupported format, expected one of .obj, .gltf, .vtk"),
    ],
)
def test_a_mesh_that_cannot_be_drawn_is_named(drawn, uri, why):
    text, left_out = drawn(uri)
    assert left_out == [f"link 'upper': mesh {uri} {why}"] and "mesh" not in text


@pytest.mark.parametrize(
    "mesh, materials, outside",
    [
        ("mtllib ../../secret", "", True),
        ("v 0 0 0\r\n mtllib a.mtl\n", "newmtl a\nmap_Kd -s 1 1 1 ../../../secret\n", True),
        ("mtllib a.mtl", "bump /etc/hosts", True),
        ("mtllib a.mtl", "map_Kd ../textures/a.png", False),  # beside its folder
    ],
)
def test_the_looks_of_a_mesh_are_no_other_files(drawn, tmp_path, mesh, materials, outside):
    """They would be in a page that is handed on."""
    urdf = tmp_path / "arm_description" / "urdf"
    (urdf / "a.obj").write_text(mesh, encoding="utf-8")
    (urdf / "a.mtl").write_text(materials, encoding="utf-8")
    told = " ".join(drawn("a.obj")[1])
    assert ("a.obj refers to a file outside of its folder" in told) == outside == bool(told)
