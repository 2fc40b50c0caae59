"""The page that plays pictures of a motion, and pictures that are played live."""

import os
import re

import numpy as np
import pytest
from helpers.motions import TIME, smooth

from sdt_drake.motion import IntendedIllusion, Story, TimedSegment
from sdt_drake.show.view3d.scene import ARROW, METRES_PER_G, Scene, make_frames
from sdt_drake.show.view3d.viewer import record_html

EVIL = "</script><b onload='x'>"
SMALL = {"width": 200, "height": 130}  # WebGL in software is slow


# --- the page -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def page_file(tmp_path_factory, robot):
    path = tmp_path_factory.mktemp("page") / "run.html"
    segments = (
        TimedSegment("roll", 0, 0.5, "to 1.5 deg/s, cosine"),
        TimedSegment("roll", 0.8, 2, EVIL),
        TimedSegment("yaw", 0.8, 2, "hold"),
    )
    meant = IntendedIllusion(quantity="yaw rate", sign=1, start=0, end=0.1)
    story = Story(feels="A <b> lean.", segments=segments, illusion=meant)
    record_html(robot, TIME, smooth(robot)[0], path, title="Leans <1>", story=story, pilot=True)
    return path


@pytest.fixture(scope="module")
def loaded(open_page, page_file):
    """The page, loaded once, as that takes long: it plays until a test seeks."""
    with open_page(page_file, **SMALL) as opened:
        opened.page.wait_for_function("viewer.animator.time > 0.1")  # it plays by itself
        assert opened.page.inner_text("#sdt-view") == "From outside"  # it began as the pilot
        yield opened
        assert opened.errors == [] and opened.requests == []


@pytest.fixture
def page(loaded):
    """The same, seen from outside."""
    view = loaded.page.locator("#sdt-view")
    if view.inner_text() == "From outside":
        view.dispatch_event("click")  # at once: a mouse waits until what moves is drawn
    yield loaded.page
    assert loaded.errors == [] and loaded.requests == []


def seek(page, time):
    """Show a time, which ends the play: from then on, nothing is drawn that nobody asks for."""
    page.wait_for_function("document.getElementById('sdt-seek').max > 0")  # it is loaded
    page.evaluate(
        """t => {
          viewer.animate = () => {};
          const slider = document.getElementById("sdt-seek");
          slider.value = t;
          slider.oninput();
          viewer.render();
        }""",
        time,
    )


def place_of(page, path):
    """Where a path of the scene is [m], in Drake's axes: Meshcat's own have y upwards."""
    x, y, z = page.evaluate(
        """path => {
          const object = viewer.scene_tree.find(path).object;
          object.updateWorldMatrix(true, false);
          return object.matrixWorld.elements.slice(12, 15);
        }""",
        path,
    )
    return np.array([x, -z, y])


def colours(page):
    """What each pixel of the picture shows, 4 bit for each of red, green and blue."""
    return page.evaluate(
        """() => {
          viewer.render();
          const shown = viewer.renderer.domElement, copy = document.createElement("canvas");
          copy.width = shown.width;
          copy.height = shown.height;
          const paint = copy.getContext("2d");
          paint.drawImage(shown, 0, 0);
          const data = paint.getImageData(0, 0, copy.width, copy.height).data, found = [];
          for (let i = 0; i < data.length; i += 4)
            found.push((data[i] >> 4) * 256 + (data[i + 1] >> 4) * 16 + (data[i + 2] >> 4));
          return found;
        }"""
    )


def test_recording_page_plays_without_server(page, robot, page_file):
    text = page_file.read_text(encoding="utf-8")
    assert "<title>Leans &lt;1&gt;</title>" in text and "<b>Leans &lt;1&gt;</b>" in text
    assert not re.search(r"<(script|link|img)[^>]*(src|href)=.?https?:", text)
    assert len(text) < 4e6
    red, green, blue = (f"{255 * part:.0f}" for part in ARROW)
    assert f'background: rgb({red},{green},{blue})"></i>specific force at the head' in text
    assert page.evaluate("viewer.animator.duration") == pytest.approx(2.0)
    frames = make_frames(robot, TIME, smooth(robot)[0])
    head = frames.head
    for k in (0, 31, 60):
        seek(page, frames.time[k])
        np.testing.assert_allclose(place_of(page, ["head"]), head.position[k], atol=1e-4)
        force = head.force_in_world[k] * METRES_PER_G / 9.80665
        tip = place_of(page, ["arrow", "unit", "tip"])
        np.testing.assert_allclose(tip - head.position[k], force, atol=2e-3)
    before = colours(page)
    seek(page, 0.4)
    assert len(set(before)) > 50 and colours(page) != before


def test_pilots_view_follows_the_head(page, robot, meshcat):
    frames = make_frames(robot, TIME, smooth(robot)[0])
    head = frames.head
    camera = ["Cameras", "default", "rotated", "<object>"]
    seek(page, 0.0)
    eye = Scene(robot, frames, meshcat).eye  # from where all is seen
    np.testing.assert_allclose(place_of(page, camera), eye, atol=1e-3)
    page.click("#sdt-view")
    assert page.inner_text("#sdt-view") == "From outside"
    for k in (45, 10):
        seek(page, frames.time[k])
        np.testing.assert_allclose(place_of(page, camera), head.position[k], atol=1e-4)
        # The camera's y, up, and -z, forward, are the head's z and x.
        m = page.evaluate("viewer.camera.matrixWorld.elements")
        (ux, uy, uz), (bx, by, bz) = m[4:7], m[8:11]
        np.testing.assert_allclose([ux, -uz, uy], head.rotation[k][:, 2], atol=1e-3)
        np.testing.assert_allclose([-bx, bz, -by], head.rotation[k][:, 0], atol=1e-3)


@pytest.mark.skipif(not os.path.isdir("/proc/self/task"), reason="needs /proc")
def test_recording_leaves_no_server(robot, tmp_path):
    def threads():
        return len(os.listdir("/proc/self/task"))

    before = threads()
    record_html(robot, TIME, smooth(robot)[0], tmp_path / "a.html")
    assert threads() <= before
