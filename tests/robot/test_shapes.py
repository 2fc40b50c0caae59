"""Meshes of a robot's file: found beside it or in its package, or left out and named."""

import pytest
from robots import URDF

from sdt_drake.robot.robot import load_robot
from sdt_drake.robot.shapes import drawable


@pytest.fixture
def drawn(tmp_path):
    """Text to draw and what is left out, of the arm with a mesh of these files."""
    urdf = tmp_path / "arm_description" / "urdf"
    for folder in (urdf, urdf.with_name("meshes")):
        folder.mkdir(parents=True)
    for place in ("a b.obj", "a.dae", "../meshes/a.gltf"):
        (urdf / place).write_text("", encoding="utf-8")

    def of(uri, **files):
        for suffix, text in files.items():
            (urdf / f"a.{suffix}").write_text(text, encoding="utf-8")
        mesh = f'<link name="upper"><visual><geometry><mesh filename="{uri}"/></geometry></visual>'
        (urdf / "arm.urdf").write_text(URDF.replace('<link name="upper">', mesh), encoding="utf-8")
        return drawable(load_robot(urdf / "arm.urdf"))

    return of


LOOKS = [
    ("mtllib ../../secret", "", True),
    ("v 0 0 0\r\n mtllib a.mtl\n", "newmtl a\nmap_Kd -s 1 1 1 ../../../secret\n", True),
    ("mtllib a.mtl", "bump /etc/hosts", True),
    ("mtllib a.mtl", "map_Kd ../textures/a.png", False),  # beside its folder
]


@pytest.mark.parametrize("mesh, materials, outside", LOOKS)
def test_the_looks_of_a_mesh_are_no_other_files(drawn, mesh, materials, outside):
    """They would be in a page that is handed on."""
    told = " ".join(drawn("a.obj", obj=mesh, mtl=materials)[1])
    assert ("a.obj refers to a file outside of its folder" in told) == outside == bool(told)
