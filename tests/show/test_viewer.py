"""The page that plays pictures of a motion, and pictures that are played live."""

import base64
import io
import os
import re
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.figures import unpacked
from helpers.motions import TIME, smooth
from helpers.robots import URDF
from helpers.robots import loaded as loaded_robot
from PIL import Image
from pydrake.geometry import Box, Cylinder

from sdt_drake.io.errors import InputError
from sdt_drake.motion import IntendedIllusion, Story, TimedSegment
from sdt_drake.pilot.illusions import quantities
from sdt_drake.pilot.orientation import CAUTION
from sdt_drake.show.view3d import viewer
from sdt_drake.show.view3d.poster import poster, triangles
from sdt_drake.show.view3d.scene import ARROW, FRAME_RATE, METRES_PER_G, Scene, make_frames
from sdt_drake.show.view3d.viewer import record_html

EVIL = "</script><b onload='x'>"
SMALL = {"width": 200, "height": 130}  # WebGL in software is slow


# --- the page -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def page_file(tmp_path_factory, robot):
    path = tmp_path_factory.mktemp("page") / "run.html"
    rows = ("roll", 0, 0.5, "to 1.5 deg/s, cosine"), ("roll", 0.8, 2, EVIL), ("yaw", 0.8, 2, "hold")
    segments = tuple(TimedSegment(*row) for row in rows)
    meant = IntendedIllusion(quantity="yaw rate", sign=1, start=0, end=0.1)
    story = Story(feels="A <b> lean.", segments=segments, illusion=meant)
    q = smooth(robot)[0] + [-2 * np.pi, 0, 0, 2 * np.pi]
    record_html(robot, TIME, q, path, title="Leans <1>", story=story, pilot=True)
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


def test_poster_faces_enclose_their_shapes_and_its_colours_are_those_of_the_file(robot, meshcat):
    frames = make_frames(robot, TIME, smooth(robot)[0])
    scene = Scene(robot, frames, meshcat)
    query, sides = scene.query(), 16
    found = {Box: 0, Cylinder: 0}
    for geometry in query.inspector().GetAllGeometryIds():
        shape = query.inspector().GetShape(geometry)
        volume = np.linalg.det(triangles(query, geometry)).sum() / 6
        if isinstance(shape, Box):
            assert volume == pytest.approx(np.prod(shape.size()))
        if isinstance(shape, Cylinder):
            area = sides / 2 * np.sin(2 * np.pi / sides) * shape.radius() ** 2
            assert volume == pytest.approx(area * shape.length())
        found[type(shape)] = found.get(type(shape), 0) + 1
    assert found[Box] > 3 and found[Cylinder] > 3
    _, data = poster(scene).split(",")
    picture = np.asarray(Image.open(io.BytesIO(base64.b64decode(data))), dtype=int)
    red, _, blue = np.moveaxis(picture, 2, 0)
    assert np.mean(blue > red + 60) > 0.02 and np.mean(red > blue + 60) > 0.02  # arm, roll frame


def test_player_fits_a_phone(page):
    seek(page, 0.4)
    page.set_viewport_size({"width": 390, "height": 844})
    slider, *others = (
        page.locator(f"#sdt-{name}").bounding_box() for name in ("seek", "play", "time", "view")
    )
    assert slider["width"] > 300 and slider["height"] >= 24
    for box in others:  # below it, and on the screen
        assert box["y"] >= slider["y"] + slider["height"]
        assert box["x"] >= 0 and box["x"] + box["width"] <= 390
        assert box["y"] + box["height"] <= 844
    page.mouse.click(slider["x"] + slider["width"] / 2, slider["y"] + slider["height"] / 2)
    assert page.evaluate("viewer.animator.time") == pytest.approx(1.0, abs=0.1)
    page.wait_for_function("document.getElementById('sdt-play').textContent === 'Play'")
    page.set_viewport_size(SMALL)


def cells(page, table, texts):
    """Wait until a table has these texts: the page played until now, and may be a moment late."""
    page.wait_for_function(
        """([table, told]) => `${told}` ===
          `${Array.from(document.querySelectorAll(table + " td"), x => x.innerText)}`""",
        arg=[table, texts],
    )


def test_page_shows_felt_beside_true_attitude_and_rates(page, robot):
    frames = make_frames(robot, TIME, smooth(robot)[0])
    felt, head, pairs = frames.felt, frames.head, quantities(frames.felt, frames.head)
    page.evaluate("document.getElementById('sdt-legend').open = true")  # closed on a small screen
    legend = page.inner_text("#sdt-legend")
    assert "felt attitude" in legend and CAUTION in legend
    assert "A <b> lean. clark2019 does not predict the illusion: yaw rate felt at" in legend
    for k in (15, 55):
        seek(page, frames.time[k])
        np.testing.assert_allclose(place_of(page, ["felt"]), head.position[k], atol=1e-4)
        m = page.evaluate("viewer.scene_tree.find(['felt']).object.matrixWorld.elements")
        axes = np.array([[x, -z, y] for x, y, z in (m[0:3], m[4:7], m[8:11])])  # in the world
        np.testing.assert_allclose(axes.T @ felt.gravity[k], [0, 0, -1], atol=2e-3)
        texts = [
            (f"{name}, felt | true", f"{own[k]:.1f}{unit} | {true[k]:.1f}{unit}")
            for name, (own, true) in pairs.items()
            for unit in ["°/s" if name.endswith("rate") else "°"]
        ]
        cells(page, "#sdt-felt", [text for row in texts for text in row])
    shown = "viewer.scene_tree.find(['felt']).object.visible"
    assert page.evaluate(shown)
    page.click("#sdt-view")
    assert not page.evaluate(shown)  # it would be around the camera


def test_player_marks_what_happens_wraps_angles_repeats_and_changes_speed(page, robot):
    seek(page, 2.0)
    places = page.locator("#sdt-marks span").evaluate_all(
        "all => all.map(one => [one.style.left, one.style.width, one.className, one.title])"
    )
    shown = [(float(left[:-1]), float(width[:-1])) for left, width, *_ in places]
    np.testing.assert_allclose(shown, [(0, 25), (40, 60), (40, 60), (0, 5)], atol=0.01)
    assert [name for *_, name, _ in places] == ["", "", "", "window"] and EVIL in places[1][3]
    told = page.locator("#sdt-joints td:last-child").all_text_contents()
    angles = np.degrees(smooth(robot)[0][-1])  # within a turn
    np.testing.assert_allclose([float(text[:-1]) for text in told], angles, atol=0.051)

    page.select_option("#sdt-speed", "2")
    assert page.evaluate("viewer.animator.mixer.timeScale") == 2
    assert not page.is_visible(".dg.main")  # Meshcat's own controls
    assert not page.is_visible("#sdt-poster")  # until the scene is there
    page.evaluate("document.getElementById('sdt-loop').click()")
    page.evaluate("document.getElementById('sdt-play').click()")
    page.evaluate("viewer.animator.pause()")  # as at its end
    page.wait_for_function("viewer.animator.playing")
    page.evaluate("document.getElementById('sdt-loop').click()")
    page.evaluate("viewer.animator.pause()")
    page.wait_for_function("document.getElementById('sdt-play').textContent === 'Play'")


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


def test_page_of_a_robot_without_head_and_of_a_browser_without_webgl(open_page, tmp_path):
    robot = loaded_robot(URDF, ".urdf")
    q = smooth(robot)[0]
    record_html(robot, TIME, q, tmp_path / "a.html")
    with pytest.raises(InputError, match="no pilot's head"):
        record_html(robot, TIME, q, tmp_path / "b.html", pilot=True)
    assert not (tmp_path / "b.html").exists()
    with open_page(tmp_path / "a.html", **SMALL) as (page, errors, requests):
        assert not page.is_visible("#sdt-view") and not page.is_visible("#sdt-meter")
        seek(page, 1.0)
        names = page.evaluate("Object.keys(viewer.scene_tree.children)")
        assert "robot" in names and not {"trace", "arrow", "head", "felt"} & set(names)
        assert errors == [] and requests == []
        page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
        page.reload()
        assert page.inner_text("#sdt-time") == "no 3D: this browser has no WebGL"
        assert page.is_visible("#sdt-poster")
        assert page.is_disabled("#sdt-play")


# --- live ---------------------------------------------------------------------------------------


def test_play_once_shows_every_second_at_its_time(robot, monkeypatch):
    """By a clock of its own, on which each picture takes longer than there is for it."""
    shown, now, show, scenes = [], [0.0], Scene.show, set()
    clock = SimpleNamespace(
        perf_counter=lambda: now[0], sleep=lambda s: now.__setitem__(0, now[0] + s)
    )

    def spy(scene, k, **options):
        shown.append((scene.frames.time[k], now[0]))
        scenes.add(scene)
        now[0] += 0.05  # slower than two pictures at twice the speed
        show(scene, k, **options)

    monkeypatch.setattr(viewer, "clock", clock)
    monkeypatch.setattr(Scene, "show", spy)
    addresses = []
    q = smooth(robot)[0]
    viewer.play(robot, TIME, q, rate=2.0, pilot=True, once=True, announce=addresses.append)
    assert re.fullmatch(r"http://localhost:\d+", *addresses)
    motion, wall = np.array(shown[1:]).T  # the first one is there before the clock starts
    assert motion[0] == 0 and motion[-1] == 2.0
    late = (wall - wall[0]) * 2.0 - motion
    assert np.all(late > -1e-9) and np.all(late < 0.05 * 2.0 + 2 / FRAME_RATE)
    assert len(motion) < 30  # 61 pictures, of which there was time for some

    # The camera is in the head, looks forward, and is upright with it; Meshcat's y is upwards.
    (scene,) = scenes
    parts = re.findall(r'base64,([\w+/]+=*)"', scene.meshcat.StaticHtml())
    messages = [base64.b64decode(part) for part in parts]

    def told(key, count=3):
        return unpacked(next(x for x in messages if key in x), count)

    eye, looked = told(b"property\xa8position"), told(b"set_target")
    up = np.hstack([told(b"property\xa4up.%c" % axis, 1) for axis in b"xyz"])
    head, turned = scene.frames.head, np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    np.testing.assert_allclose(turned @ eye, head.position[-1], atol=1e-9)
    np.testing.assert_allclose(turned @ (looked - eye), head.rotation[-1][:, 0], atol=1e-9)
    np.testing.assert_allclose(turned @ up, head.rotation[-1][:, 2], atol=1e-9)
