"""A robot by itself: a page with sliders for its joints, and the same live."""

import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from helpers.figures import unpacked
from helpers.robots import RATE_TABLE, SEVEN

from sdt_drake.robot.robot import load_robot
from sdt_drake.show.view3d import robot_page
from sdt_drake.show.view3d.robot_page import (
    RobotScene,
    joint_table,
    link_table,
    moving_links,
    robot_html,
    sentence,
    show_robot,
)
from sdt_drake.show.view3d.viewer import record_html

BALL = "<visual><geometry><sphere radius='0.1'/></geometry></visual>"
MESH = "<visual><geometry><mesh filename='none.obj'/></geometry></visual>"


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """The seven-axis arm, with a shape, and a mesh that is missing."""
    text = SEVEN.replace('<link name="link_3">', f'<link name="link_3">{BALL}')
    path = tmp_path_factory.mktemp("own") / "seven.urdf"
    path.write_text(text.replace('<link name="link_4">', f'<link name="link_4">{MESH}'), "utf-8")
    return load_robot(path)


def poses(robot, q, links):
    """Of links in the world, by Drake."""
    context = robot.plant.CreateDefaultContext()
    robot.plant.SetPositions(context, q)
    bodies = [robot.plant.GetBodyByName(link) for link in links]
    return [robot.plant.EvalBodyPoseInWorld(context, body).GetAsMatrix4() for body in bodies]


def test_robot_page_turns_joints_as_drake(own, open_page, tmp_path):
    robot_html(own, tmp_path / "own.html")
    q = np.random.default_rng(3).uniform(own.position_lower, own.position_upper).round(3)
    with open_page(tmp_path / "own.html", width=300, height=200) as (page, errors, requests):
        shown = page.evaluate(
            """angles => {
              angles.forEach((angle, k) => {
                const input = document.getElementById("sdt-joint-" + k);
                input.step = "any";
                input.value = angle;
                input.oninput();
              });
              return ["link_3", "link_7"].map(name => {
                const {object} = viewer.scene_tree.find(["robot", "seven", name]);
                object.updateMatrix();
                return object.matrix.elements;
              });
            }""",
            np.degrees(q).tolist(),
        )
        text = page.inner_text("#sdt-joints")
        assert errors == [] and requests == []
    drawn = [np.reshape(matrix, (4, 4)).T for matrix in shown]
    np.testing.assert_allclose(drawn, poses(own, q, ["link_3", "link_7"]), atol=1e-6)
    assert "seven: 7 joints, 16.08 kg of moving links." in text
    assert "link 'link_4': mesh none.obj is missing" in text


def test_robot_page_tells_numbers_of_the_rate_table(tmp_path):
    (tmp_path / "own.urdf").write_text(RATE_TABLE, encoding="utf-8")
    robot = load_robot(tmp_path / "own.urdf")
    links = moving_links(robot)
    assert sentence(robot, links) == "rate_table: 3 joints, 325 kg of moving links"
    rows = joint_table(robot).rows
    assert rows[0] == ("1 outer_axis", "continuous", "any", "401.1", "900", "1", "0")
    # Second moments of the outer link: (28 + 34 - 22) / 2 = 20, 14 and 8 kg m²; m a² / 5.
    axes = ", ".join(f"{np.sqrt(5 * x / 180):.3g}" for x in (20, 14, 8))
    assert link_table(links).rows[0] == ("outer", "180", "0, 0, 0", axes)


def test_meshcat_sliders_move_robot_and_axes(own, monkeypatch):
    made, told = [], []

    class Seen(RobotScene):
        def __init__(self, robot, meshcat):
            super().__init__(robot, meshcat)
            made.append(self)
            self.placed = []

        def place(self, q):
            super().place(q)
            getattr(self, "placed", []).append(q)

    def sleep(_):
        (shown,) = made
        if any(q[1] != 0 for q in shown.placed):
            raise KeyboardInterrupt
        shown.scene.meshcat.SetSliderValue("2 joint_2", 0.5)

    monkeypatch.setattr(robot_page, "RobotScene", Seen)
    monkeypatch.setattr(robot_page.clock, "sleep", sleep)
    show_robot(own, port=None, once=False, announce=told.append)
    (shown,) = made
    assert told[0].startswith("http://localhost:")
    q = shown.placed[-1]
    np.testing.assert_allclose(q, [0, 0.5, 0, -0.0698, 0, 0, 0], atol=0.01)
    path = "/masses/link_7"
    joint, at_zero = shown.marks[path]
    zero, moved = (poses(own, angles, ["link_7"])[0] for angles in (np.zeros(7), q))
    expected = moved @ np.linalg.inv(zero) @ at_zero.GetAsMatrix4()
    drawn = unpacked(shown.scene.meshcat._GetPackedTransform(path), 16)
    np.testing.assert_allclose(np.reshape(drawn, (4, 4)).T, expected, atol=1e-9)
    centre = own.plant.GetBodyByName("link_7").default_spatial_inertia().get_com()
    assert joint == 6 and np.any(centre != 0)
    np.testing.assert_allclose(at_zero.translation(), (zero @ [*centre, 1])[:3], atol=1e-12)


# --- names that would like to be scripts ---------------------------------------------------------

NAMES = ["<img src=x onerror=window.ran=1>", "e'}));window.ran=2;(({'a':'"]


@pytest.fixture(scope="module")
def evil(tmp_path_factory):
    """The rate table, with such names of the robot, its links, joints, shapes and colours."""
    path = tmp_path_factory.mktemp("evil") / "own.urdf"
    root = ET.fromstring(RATE_TABLE)
    for link in root.findall("link"):
        visual = ET.SubElement(link, "visual", name="box")
        ET.SubElement(ET.SubElement(visual, "geometry"), "box", size="1 1 1")
        ET.SubElement(ET.SubElement(visual, "material", name="red"), "color", rgba="1 0 0 1")
    given = sorted({x.get("name", "") for x in root.iter()} - {""})
    new = {name: NAMES[k % 2][:-1] + f"{k}" + NAMES[k % 2][-1] for k, name in enumerate(given)}
    for element in root.iter():
        for field in {"name", "link", "joint"} & element.attrib.keys():
            element.set(field, new.get(element.get(field), element.get(field)))
    path.write_text(ET.tostring(root, encoding="unicode"), encoding="utf-8")
    return load_robot(path)


RAN = """() => {
  document.querySelectorAll(".dg .title, .dg .close-button").forEach(button => button.click());
  return [window.ran || 0, document.querySelectorAll("img:not(#sdt-poster)").length];
}"""  # what ran at once, and pictures that would run it


def test_names_are_escaped_in_robot_pages(evil, open_page, tmp_path):
    time = np.arange(31) / 30
    robot_html(evil, tmp_path / "robot.html")
    record_html(evil, time, np.outer(time, np.ones(evil.n)), tmp_path / "motion.html")
    for path in tmp_path.iterdir():
        with open_page(path, width=200, height=130) as (page, errors, requests):
            page.wait_for_function("viewer.scene_tree.find(['robot']).object.children.length > 0")
            assert page.evaluate(RAN) == [0, 0] and errors == [] and requests == []


def test_names_are_escaped_beside_sliders(evil, browser, monkeypatch):
    told, ran = [], []

    def sleep(_):
        page = browser.new_page()
        page.goto(told[0])
        page.wait_for_function(f"Object.keys(viewer.gui_controllers).length >= {evil.n}")
        ran.append(page.evaluate(RAN))
        page.close()
        raise KeyboardInterrupt

    monkeypatch.setattr(robot_page.clock, "sleep", sleep)
    show_robot(evil, port=None, once=False, announce=told.append)
    assert ran == [[0, 0]]


@pytest.mark.parametrize("name", [*NAMES, "a&lt;b", '"', "`${x}`", "\\u0027", "\u2028"])
def test_slider_names_have_no_script_characters(name):
    assert re.fullmatch(r"[\w .:+-]+", robot_page.slider_name(f"1 {name}"))
