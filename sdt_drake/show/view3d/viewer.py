"""Motions in 3D: live in Meshcat, and as a web page that plays offline."""

import gc
import html
import time as clock
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.geometry import Meshcat, MeshcatParams

from sdt_drake.io.arguments import a_path, instance_of, takes
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.files import checked_output, checked_suffix, write_text
from sdt_drake.io.shown import numbered
from sdt_drake.motion import Story
from sdt_drake.pilot.head import check_head
from sdt_drake.pilot.illusions import LEVELS, intended, quantities, unit_of
from sdt_drake.pilot.orientation import CAUTION
from sdt_drake.robot.robot import Robot
from sdt_drake.run.design import Design, as_design
from sdt_drake.run.recording import Recording
from sdt_drake.run.scenario import Scenario
from sdt_drake.show.documents import render_html
from sdt_drake.show.sections import Block, Page, said
from sdt_drake.show.view3d import scene as scenes
from sdt_drake.show.view3d.poster import poster

PAGES = (".html",)
"""Suffixes of pages."""


def record_html(
    robot: Robot,
    time: Array,
    q: Array,
    path: str | Path,
    *,
    title: str = "",
    pilot: bool = False,
    story: Story | None = None,
) -> None:
    """Write a web page that plays a motion without a server or a network.

    The page also shows joint angles, G at the pilot's head, predicted felt attitude, and the
    current segments.

    Args:
        robot: the robot, with the shapes of its file.
        time: increasing samples [s], shape (N,), N >= 3.
        q: joint angles, joint side [rad], shape (N, n).
        path: a file that ends in .html.
        title: title of the page; by default the robot's name.
        pilot: start with the pilot's view; a button of the page switches the view.
        story: purpose and segments of the motion; its title replaces `title`.

    Raises:
        InputError: if the motion does not fit the robot, or the file cannot be written.
    """
    checked_suffix(checked_output(Path(path)), PAGES)
    page = recorded_page(robot, time, q, title=title, pilot=pilot, story=story)
    Animation(page, title).save(path)


class Animation:
    """A motion in 3D, which a notebook plays below the cell without a server or a network."""

    def __init__(self, page: str, title: str) -> None:
        self._page, self._title = page, title

    def __repr__(self) -> str:
        return f"<Animation {self._title}, {len(self._page.encode()) / 1e6:.1f} MB>"

    def _repr_html_(self) -> str:
        """Return the HTML that a notebook shows."""
        page, title = html.escape(self._page), html.escape(self._title)
        style = "width:100%;height:420px;border:0"
        return f'<iframe title="{title}" style="{style}" srcdoc="{page}"></iframe>'

    @takes(path=a_path)
    def save(self, path: str | Path) -> None:
        """Write the animation as a web page; see `record_html`.

        Raises:
            InputError: if the path does not end in .html, or the file cannot be written.
        """
        write_text(checked_suffix(Path(path), PAGES), self._page)


@takes(recording=instance_of(Recording, "sdt_drake.simulate"), pilot=instance_of(bool))
def view(
    design: Design | Scenario, recording: Recording | None = None, *, pilot: bool = False
) -> Animation:
    """Show a run in 3D, or, without a recording, the planned motion.

    Args:
        design: the design or scenario of the run.
        recording: the recording of the run.
        pilot: start with the pilot's view.

    Raises:
        InputError: if the robot has no pilot's head, or the motion is too long.

    Examples:
        >>> import sdt_drake as sdt
        >>> sdt.view(sdt.load("axis_pi")).save("run.html")
    """
    design = as_design(design)
    motion, title = design.reference.tracked, design.scenario.name
    time, q = (motion.time, motion.q) if recording is None else (recording.time, recording.q)
    return Animation(
        recorded_page(design.device.simulated, time, q, title=title, pilot=pilot), title
    )


@contextmanager
def freeing_meshcat() -> Iterator[None]:
    """Collect garbage after a function that draws in a Meshcat of its own.

    Drake's diagrams are reference cycles. If the collector freed them in another thread, their
    Meshcat would end the process.
    """
    try:
        yield
    finally:
        gc.collect()


@freeing_meshcat()
def recorded_page(
    robot: Robot,
    time: Array,
    q: Array,
    *,
    title: str = "",
    pilot: bool = False,
    story: Story | None = None,
) -> str:
    """Return the text of the page that `record_html` writes."""
    if pilot:
        check_head(robot)
    story = story or Story()
    frames = scenes.make_frames(robot, time, q)
    meshcat = open_meshcat()
    scene = scenes.Scene(robot, frames, meshcat)
    meshcat.StartRecording(scenes.FRAME_RATE, set_visualizations_while_recording=False)
    for k in range(len(frames.time)):
        scene.show(k, record=True)
    meshcat.StopRecording()
    meshcat.PublishRecording()
    scene.show(0)
    title = story.title or title or robot.name
    overlay = render_html(
        "viewer.html.j2",
        title=title,
        poster=poster(scene),
        feels=story.feels,
        predicted=_predicted(frames, story),
        data=_page_data(robot, frames, story),
        pilot=pilot,
        has_head=frames.head is not None,
        metres=scenes.METRES_PER_G,
        arrow=_css(scenes.ARROW),
        trace=_css(scenes.TRACE),
        felt=_css(scenes.FELT),
        has_felt=frames.felt is not None,
        felt_by=scenes.FELT_MODEL,
        caution=CAUTION,
        eye=in_browser(scene.eye),
        target=in_browser(scene.target),
        outside=scenes.FIELD_OF_VIEW,
        width=scenes.WIDTH,
        field=scenes.PILOT_FIELD,
        near=scenes.PILOT_NEAR,
    )
    return page_with(meshcat, title, overlay)


def played(
    name: str, words: str, robot: Robot, time: Array, q: Array, **options: Any
) -> list[Block]:
    """Return the blocks of a report that play a motion in 3D, or say why there is no recording.

    Args:
        name: file of the page, from the folder of the report.
        words: text above the button.
        robot: the robot, with the shapes of its file.
        time: increasing samples [s], shape (N,), N >= 3.
        q: joint angles, joint side [rad], shape (N, n).
        options: options of `recorded_page`.
    """
    try:
        return [words, Page(name, "Play", recorded_page(robot, time, q, **options))]
    except InputError as error:
        return [said("There is no 3D recording: {}.", error)]


def page_with(meshcat: Meshcat, title: str, overlay: str) -> str:
    """Return Meshcat's page with a title, a language and an overlay before its end."""
    page = meshcat.StaticHtml().replace("<html>", '<html lang="en">', 1)
    page = page.replace("<title>Drake MeshCat</title>", f"<title>{html.escape(title)}</title>")
    body, end, rest = page.rpartition("</body>")
    return body + overlay + end + rest


def _page_data(robot: Robot, frames: scenes.Frames, story: Story) -> dict[str, object]:
    """Return the data of the page's script: angles [deg] and G of each picture, and segments."""
    return {
        "rate": scenes.FRAME_RATE,
        "names": numbered(robot.joint_names),
        "angles": np.degrees(frames.q).round(1).tolist(),
        "g": [] if frames.head is None else frames.head.resultant_g.round(2).tolist(),
        **_felt(frames),
        "segments": story.segments,
        "window": [story.illusion.start, story.illusion.end] if story.illusion else [],
        "duration": float(frames.time[-1]),
    }


def _felt(frames: scenes.Frames) -> dict[str, list[Any]]:
    """Return names and units of quantities that are felt or change, and felt and true values.

    A picture has a list of pairs. Rates below the level of an illusion are left out.
    """
    if frames.head is None or frames.felt is None:
        return {"quantities": [], "felt": []}
    found = {
        name: np.array(both).T.round(1).tolist()
        for name, both in quantities(frames.felt, frames.head).items()
        if np.abs(both).max() >= LEVELS[name] or unit_of(name) == "deg"
    }
    names = [[name, "°/s" if name.endswith("rate") else "°"] for name in found]
    return {"quantities": names, "felt": [*zip(*found.values(), strict=True)]}


def _predicted(frames: scenes.Frames, story: Story) -> str:
    """Return if the intended illusion is predicted, as a sentence; "" without one."""
    if frames.head is None or frames.felt is None or story.illusion is None:
        return ""
    felt = {scenes.FELT_MODEL: frames.felt}
    return intended(story.title, story.illusion, frames.head, felt).sentence(scenes.FELT_MODEL)


def in_browser(place: Array) -> str:
    """Return a place [m] in the axes of Meshcat's page, where y is up."""
    x, y, z = place
    return f"{x:.6g}, {z:.6g}, {-y:.6g}"


def _css(colour: tuple[float, ...]) -> str:
    return "rgb({})".format(",".join(f"{255 * part:.0f}" for part in colour))


# --- live -----------------------------------------------------------------------------------------


def open_meshcat(port: int | None = None) -> Meshcat:
    """Start a Meshcat server that only this machine can reach.

    Args:
        port: 1024 to 65535; by default the first free one from 7000 on.

    Raises:
        InputError: if the port is in use.
    """
    try:
        return Meshcat(MeshcatParams(host="localhost", port=port, show_stats_plot=False))
    except RuntimeError:
        used = f"{port} is in use" if port else "none from 7000 on is free"
        raise InputError(f"port: {used}, expected a free one") from None


@freeing_meshcat()
def play(
    robot: Robot,
    time: Array,
    q: Array,
    *,
    rate: float = 1.0,
    pilot: bool = False,
    port: int | None = None,
    once: bool = False,
    announce: Callable[[str], None] = print,
) -> None:
    """Play a motion in a browser repeatedly, until Ctrl-C.

    Args:
        robot: the robot, with the shapes of its file.
        time: increasing samples [s], shape (N,), N >= 3.
        q: joint angles, joint side [rad], shape (N, n).
        rate: 1 for real time, 2 for twice the speed [-].
        pilot: show the pilot's view.
        port: port of the server on this machine; by default the first free one from 7000 on.
        once: return at the end of the motion.
        announce: function that is called with the address of the page, before the motion starts.

    Raises:
        InputError: if the motion does not fit the robot, or no port is free.
    """
    if pilot:
        check_head(robot)
    frames = scenes.make_frames(robot, time, q)
    meshcat = open_meshcat(port)
    scene = scenes.Scene(robot, frames, meshcat)
    scene.overview()
    try:
        announce(meshcat.web_url())
        while True:
            _run_once(scene, rate, pilot)
            if once:
                return
    except KeyboardInterrupt:
        return


def _run_once(scene: scenes.Scene, rate: float, pilot: bool) -> None:
    """Show every picture at its time, without those that are already too late."""
    frames, start = scene.frames, clock.perf_counter()
    k, last = -1, len(scene.frames.time) - 1
    while k < last:
        due = (clock.perf_counter() - start) * rate * scenes.FRAME_RATE
        k = int(min(max(k + 1, due), last))
        clock.sleep(max(0.0, frames.time[k] / rate - (clock.perf_counter() - start)))
        scene.show(k)
        if pilot:
            scene.pilot_view(k)
        scene.meshcat.Flush()
