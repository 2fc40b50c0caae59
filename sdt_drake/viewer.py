"""The device in motion, in Meshcat: live, and as a web page that plays by itself."""

from __future__ import annotations

import html
import re
import time as clock
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import (
    Cylinder,
    Meshcat,
    MeshcatCone,
    MeshcatParams,
    Rgba,
)
from pydrake.math import RigidTransform, RotationMatrix

from sdt_drake.errors import InputError, replacing, told_by
from sdt_drake.pilot import GRAVITY, check_head, has_head, head_motion
from sdt_drake.robot import Robot
from sdt_drake.systems import RobotDrawing

Array = NDArray[np.float64]

FRAME_RATE = 30.0
"""Pictures per second of motion [1/s]; the browser interpolates between them."""

LONGEST = 3600.0
"""Of the motions that are shown [s]: all pictures are in memory, and in the page."""

LARGEST = 1000.0
"""How far shapes may be from the origin of the world [m]: lines on the floor are 1 m apart."""

RATES = (0.01, 1000.0)
"""Slowest and fastest: 1 for real time, 2 for twice as fast [-]."""

METRES_PER_G = 0.7
"""Length of the arrow for 1 g of specific force [m]."""

_ARROW, _TRACE = (0.84, 0.15, 0.35), (0.0, 0.55, 0.45)  # RGB in 0..1
_SHAFT_RADIUS, _TIP_RADIUS, _FLOOR = 0.025, 0.07, 0.02  # m
_TIP = 0.25  # share of the arrow's length
_SKY, _HORIZON = [0.80, 0.87, 0.94], [0.97, 0.98, 0.99]  # RGB in 0..1
_FIELD_OF_VIEW = 40.0  # deg, from bottom to top
_PILOT_FIELD, _PILOT_NEAR = 75.0, 0.3  # deg; m: nothing nearer is drawn, as the pilot's own neck
_FROM = np.array([0.71, -0.57, 0.41])  # where the camera stands, of length 1
_CAMERA = "/Cameras/default/rotated/<object>"
_HEAD_PATH, _ARROW_PATH = "/head", "/arrow"


@dataclass(frozen=True, eq=False)
class Frames:
    """What is shown, picture by picture.

    Attributes:
        time: k / FRAME_RATE from the start of the motion [s], shape (F,).
        q: joint angles, joint side [rad], shape (F, n).
        position: of the head in the world [m], shape (F, 3); None for a robot without a head frame.
        rotation: head to world, shape (F, 3, 3); None likewise.
        specific_force: a - g at the head, in the **world** frame [m/s²], shape (F, 3); None
            likewise.
    """

    time: Array
    q: Array
    position: Array | None = None
    rotation: Array | None = None
    specific_force: Array | None = None


def make_frames(robot: Robot, time: Array, q: Array, specific_force: Array | None = None) -> Frames:
    """The pictures of a motion, and what the head does in them.

    Args:
        robot: whose joints these are.
        time: in equal steps [s], shape (N,), N >= 3.
        q: joint angles, joint side [rad], shape (N, n).
        specific_force: at the head, in the head frame [m/s²], shape (N, 3); by default from
            central differences of q.

    Raises:
        InputError: as in `check_motion`.
    """
    time, q = np.asarray(time, dtype=float), np.asarray(q, dtype=float)
    check_motion(robot, time, q, specific_force)
    # A motion that ends on a picture has it, though time steps are not exact in binary.
    count = int((time[-1] - time[0]) * FRAME_RATE + 1e-6) + 1
    at = np.arange(count) / FRAME_RATE
    sampled = _sample(time, q, at)
    if not has_head(robot):
        return Frames(at, sampled)
    v = np.gradient(q, time, axis=0)
    vd = np.gradient(v, time, axis=0)
    head = head_motion(robot, sampled, _sample(time, v, at), _sample(time, vd, at))
    felt = head.specific_force
    if specific_force is not None:
        felt = _sample(time, np.asarray(specific_force, dtype=float), at)
    in_world = np.einsum("fij,fj->fi", head.rotation, felt)
    return Frames(at, sampled, head.position, head.rotation, in_world)


def check_motion(robot: Robot, time: Array, q: Array, specific_force: Array | None = None) -> None:
    """Refuse what cannot be shown.

    Args:
        robot, time, q, specific_force: as in `make_frames`.

    Raises:
        InputError: if shapes do not fit, a value is not finite, or the motion is too long.
    """
    if time.ndim != 1 or len(time) < 3 or not np.all(np.diff(time) > 0):
        raise InputError("time: expected at least three samples that grow")
    check_duration(time[-1] - time[0])
    for name, values, width in (("q", q, robot.n), ("specific_force", specific_force, 3)):
        if values is None:
            continue
        if np.shape(values) != (len(time), width):
            raise InputError(
                f"{name}: shape {np.shape(values)}, expected ({len(time)}, {width}) "
                f"for robot '{robot.name}'"
            )
        if not np.all(np.isfinite(values)):
            raise InputError(f"{name}: contains a value that is not finite")


def check_duration(duration: float) -> None:
    """Refuse a motion [s] that is too long to show.

    Raises:
        InputError: naming its duration.
    """
    if not duration <= LONGEST:
        raise InputError(f"lasts {duration:g} s, expected at most {LONGEST:g} s to show")


def _sample(time: Array, values: Array, at: Array) -> Array:
    """Columns of `values` between their samples, `at` seconds after the first one."""
    return np.stack([np.interp(at + time[0], time, column) for column in values.T], axis=1)


# --- the scene ------------------------------------------------------------------------------------


class Scene:
    """A robot, its head's trace and its specific force in a Meshcat.

    Args:
        robot: drawn as its **file** draws it; changes in memory are not seen.
        frames: what is going to be shown: the trace, and how far the floor and the camera are.
        meshcat: to draw in; emptied first.

    Attributes:
        eye, target: from where a camera sees everything, and what it looks at, in the world [m].

    Raises:
        InputError: if Drake cannot draw a shape of the file, or they reach too far.
    """

    def __init__(self, robot: Robot, frames: Frames, meshcat: Meshcat) -> None:
        self.meshcat, self.frames = meshcat, frames
        meshcat.Delete()
        with _drawing(robot):
            self._robot = RobotDrawing(robot=robot, meshcat=meshcat)
            self._context = self._robot.CreateDefaultContext()
            low, high = _extent(robot, self._robot, frames.q)
        _draw_surroundings(meshcat, low, high)
        if frames.position is not None:
            _draw_head(meshcat, frames.position)
        self.target = (low + high) / 2
        reach = float(np.linalg.norm(high - low)) / 2
        self.eye = self.target + 1.6 * reach * _FROM
        self.show(0)

    def show(self, k: int, *, record: bool = False) -> None:
        """Picture k; into the recording that is running, if `record`."""
        frames = self.frames
        at = frames.time[k] if record else None
        self._context.SetTime(frames.time[k])
        state = np.concatenate([frames.q[k], np.zeros_like(frames.q[k])])
        self._robot.get_input_port().FixValue(self._context, state)
        self._robot.ForcedPublish(self._context)
        if frames.position is None:
            return
        head = RigidTransform(RotationMatrix(frames.rotation[k]), frames.position[k])
        self.meshcat.SetTransform(_HEAD_PATH, head, at)
        arrow, length = arrow_pose(frames.position[k], frames.specific_force[k])
        self.meshcat.SetTransform(_ARROW_PATH, arrow, at)
        self.meshcat.SetProperty(f"{_ARROW_PATH}/unit", "scale", [1.0, 1.0, length], at)

    def overview(self) -> None:
        """The camera where it sees everything."""
        self.meshcat.SetProperty(_CAMERA, "fov", _FIELD_OF_VIEW)
        self.meshcat.SetCameraPose(self.eye, self.target)

    def pilot_view(self, k: int) -> None:
        """The camera where the head is in picture k, looking forward, turning with it."""
        eye, (x, _, z) = self.frames.position[k], self.frames.rotation[k].T
        self.meshcat.SetCameraPose(eye, eye + x)
        # Meshcat keeps its camera upright, by a vector `up` with y upwards: that can roll it.
        values = {"fov": _PILOT_FIELD, "near": _PILOT_NEAR}
        values |= {"up.x": z[0], "up.y": z[2], "up.z": -z[1]}
        for name, value in values.items():
            self.meshcat.SetProperty(_CAMERA, name, value)


def arrow_pose(position: Array, specific_force: Array) -> tuple[RigidTransform, float]:
    """Where the arrow starts, with z along `specific_force` [m/s²]; and how long it is [m]."""
    size = float(np.linalg.norm(specific_force))
    if size < 1e-6:  # in free fall there is no direction
        return RigidTransform(position), 0.0
    rotation = RotationMatrix.MakeFromOneVector(specific_force, 2)
    return RigidTransform(rotation, position), METRES_PER_G * size / GRAVITY


@contextmanager
def _drawing(robot: Robot) -> Iterator[None]:
    """What is wrong with shapes shows here: `load_robot` reads none."""
    try:
        yield
    except InputError:
        raise
    except (Exception, SystemExit) as error:  # the latter is how Drake refuses a radius
        reason = re.sub(rf"\S*{re.escape(robot.path.name)}:", "line ", told_by(error))
        raise InputError(
            f"{robot.path}: a <visual> cannot be drawn ({reason}); a robot without any is drawn as "
            "balls and rods"
        ) from None


def _extent(robot: Robot, drawing: RobotDrawing, q: Array) -> tuple[Array, Array]:
    """Lowest and highest x, y, z that the visuals reach, in some 60 of the pictures [m]."""
    inspector, plant = drawing.scene_graph.model_inspector(), drawing.plant
    corners = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1)
    boxes = []
    for geometry in inspector.GetAllGeometryIds():
        box = inspector.GetObbInGeometryFrame(geometry)
        if box is not None:  # a half space has none
            pose = inspector.GetPoseInFrame(geometry) @ box.pose()
            body = plant.GetBodyFromFrameId(inspector.GetFrameId(geometry))
            boxes.append((body, pose.multiply(corners * box.half_width()[:, None])))
    own, points = plant.CreateDefaultContext(), []
    for row in q[:: max(1, len(q) // 60)]:
        plant.SetPositions(own, row)
        points += [plant.EvalBodyPoseInWorld(own, body).multiply(local) for body, local in boxes]
    cloud = np.hstack(points)
    if not np.all(np.abs(cloud) <= LARGEST):
        raise InputError(
            f"{robot.path}: reaches {np.abs(cloud).max():g} m from the world's origin, expected at "
            f"most {LARGEST:g} m to show"
        )
    return cloud.min(axis=1), cloud.max(axis=1)


def _draw_surroundings(meshcat: Meshcat, low: Array, high: Array) -> None:
    """Sky, a floor under the lowest part, and lines 1 m apart on it."""
    for path in ("/Axes", "/Grid"):
        meshcat.SetProperty(path, "visible", False)
    meshcat.SetProperty("/Background/<object>", "top_color", _SKY)
    meshcat.SetProperty("/Background/<object>", "bottom_color", _HORIZON)
    radius = float(np.ceil(1.1 * np.abs([low[:2], high[:2]]).max()))
    _light(meshcat, radius)
    meshcat.SetObject("/floor", Cylinder(radius, _FLOOR), Rgba(0.86, 0.87, 0.88))
    meshcat.SetTransform("/floor", RigidTransform([0.0, 0.0, low[2] - _FLOOR]))
    at = np.arange(1 - radius, radius)
    half, z = np.sqrt(radius**2 - at**2), np.full(len(at), low[2] - 0.4 * _FLOOR)
    starts = np.hstack([[at, -half, z], [-half, at, z]])
    ends = np.hstack([[at, half, z], [half, at, z]])
    meshcat.SetLineSegments("/lines", starts, ends, 1.0, Rgba(0.66, 0.68, 0.71))


def _light(meshcat: Meshcat, radius: float) -> None:
    """One lamp from above that throws shadows within `radius` [m] of the middle."""
    for lamp in ("PointLightNegativeX", "PointLightPositiveX"):  # these stand within the device
        meshcat.SetProperty(f"/Lights/{lamp}", "visible", False)
    meshcat.SetProperty("/Lights/AmbientLight/<object>", "intensity", 1.6)
    values = {"intensity": 2.2, "position": [4.0, -7.0, 14.0], "castShadow": True}
    values |= {"shadow.mapSize.x": 2048.0, "shadow.mapSize.y": 2048.0, "shadow.normalBias": 0.03}
    for side, sign in {"left": -1, "right": 1, "bottom": -1, "top": 1}.items():
        values[f"shadow.camera.{side}"] = sign * radius
    for name, value in values.items():
        meshcat.SetProperty("/Lights/FillLight/<object>", name, value)


def _draw_head(meshcat: Meshcat, position: Array) -> None:
    """The trace, and an arrow of 1 m along z that is stretched later."""
    meshcat.SetLine("/trace", position.T, 3.0, Rgba(*_TRACE))
    unit = f"{_ARROW_PATH}/unit"
    meshcat.SetObject(f"{unit}/shaft", Cylinder(_SHAFT_RADIUS, 1 - _TIP), Rgba(*_ARROW))
    meshcat.SetTransform(f"{unit}/shaft", RigidTransform([0.0, 0.0, (1 - _TIP) / 2]))
    # A cone of Meshcat has its point at the origin and opens along +z.
    meshcat.SetObject(f"{unit}/tip", MeshcatCone(_TIP, _TIP_RADIUS, _TIP_RADIUS), Rgba(*_ARROW))
    flip = RotationMatrix.MakeXRotation(np.pi)
    meshcat.SetTransform(f"{unit}/tip", RigidTransform(flip, [0.0, 0.0, 1.0]))


# --- to a file ------------------------------------------------------------------------------------


def record_html(
    robot: Robot,
    time: Array,
    q: Array,
    path: str | Path,
    *,
    title: str = "",
    specific_force: Array | None = None,
    pilot: bool = False,
) -> None:
    """Write a web page that plays the motion without a server or a network.

    Args:
        robot: drawn as its file draws it.
        time: growing [s], shape (N,), N >= 3.
        q: joint angles, joint side [rad], shape (N, n).
        path: ends in .html.
        title: of the page; by default the robot's name.
        specific_force: at the head, in the head frame [m/s²], shape (N, 3); by default from q.
        pilot: start with the pilot's own view; a button changes it in either case.

    Raises:
        InputError: if the motion does not fit the robot, or the file cannot be written.
    """
    path = Path(path)
    check_html(path)
    if pilot:
        check_head(robot)
    page = _page(robot, make_frames(robot, time, q, specific_force), title or robot.name, pilot)
    with replacing(path) as partial:
        partial.write_text(page, encoding="utf-8")


def check_html(path: Path) -> None:
    """Refuse, before anything is computed, a path that no page is written to.

    Raises:
        InputError: if it is a folder, or does not end in .html.
    """
    if path.is_dir():
        raise InputError(f"{path}: is a folder, expected a file")
    if path.suffix != ".html":
        raise InputError(f"{path}: expected an .html file")


def _page(robot: Robot, frames: Frames, title: str, pilot: bool) -> str:
    meshcat = open_meshcat()
    scene = Scene(robot, frames, meshcat)
    meshcat.StartRecording(FRAME_RATE, set_visualizations_while_recording=False)
    for k in range(len(frames.time)):
        scene.show(k, record=True)
    meshcat.StopRecording()
    meshcat.PublishRecording()
    title = html.escape(title)
    page = meshcat.StaticHtml().replace("<title>Drake MeshCat</title>", f"<title>{title}</title>")
    body, end, rest = page.rpartition("</body>")
    return body + _overlay(scene, title, pilot) + end + rest


def _overlay(scene: Scene, title: str, pilot: bool) -> str:
    """Title, legend and player of the page."""
    head = scene.frames.position is not None
    values = {
        "METRES": f"{METRES_PER_G:g}",
        "ARROW": _css(_ARROW),
        "TRACE": _css(_TRACE),
        "NO_HEAD": "" if head else "hidden",
        "EYE": _in_browser(scene.eye),
        "TARGET": _in_browser(scene.target),
        "OUTSIDE": f"{_FIELD_OF_VIEW:g}",
        "FIELD": f"{_PILOT_FIELD:g}",
        "NEAR": f"{_PILOT_NEAR:g}",
        "PILOT": str(pilot).lower(),
        "TITLE": title,  # the last, it may hold anything
    }
    text = _OVERLAY
    for name, value in values.items():
        text = text.replace(f"${name}", value)
    return text


def _in_browser(place: Array) -> str:
    """A place [m] as Meshcat's page has it, with y upwards."""
    x, y, z = place
    return f"{x:.6g}, {z:.6g}, {-y:.6g}"


def _css(colour: tuple[float, ...]) -> str:
    return "rgb({})".format(",".join(f"{255 * part:.0f}" for part in colour))


# Meshcat's page hides its player in a menu, and has no camera that rides along.
_OVERLAY = """
<style>
  .sdt { position: fixed; left: 0; color: #1c2733; font: 14px/1.5 system-ui, sans-serif;
    background: rgba(255, 255, 255, 0.82); padding: 8px 14px; box-sizing: border-box; }
  .sdt b { font-size: 16px; }
  .sdt i { display: inline-block; width: 18px; height: 4px; margin-right: 8px;
    vertical-align: middle; }
  #sdt-legend { top: 0; border-radius: 0 0 6px 0; max-width: 75vw; }
  #sdt-player { bottom: 0; width: 100%; display: flex; gap: 12px; align-items: center; }
  #sdt-player input { flex: 1; min-width: 0; }
  #sdt-player button { font: inherit; padding: 4px 12px; white-space: nowrap; }
  #sdt-time { white-space: nowrap; font-variant-numeric: tabular-nums; }
  @media (max-width: 760px) {
    .dg.main { display: none; }
    #sdt-player { flex-wrap: wrap; justify-content: space-between; }
    #sdt-player input { flex-basis: 100%; order: -1; height: 32px; margin: 0; }
  }
</style>
<div class="sdt" id="sdt-legend"><b>$TITLE</b>
  <div $NO_HEAD><i style="background: $ARROW"></i>specific force at the head, a − g: $METRES m
    for 1 g<br><i style="background: $TRACE"></i>path of the head</div>
</div>
<div class="sdt" id="sdt-player">
  <button id="sdt-play" type="button">Pause</button>
  <input id="sdt-seek" type="range" min="0" step="any" value="0" aria-label="time">
  <span id="sdt-time"></span>
  <button id="sdt-view" type="button" $NO_HEAD>Pilot's view</button>
</div>
<script>
(function () {
  const [play, seek, shown, view] =
    ["play", "seek", "time", "view"].map(name => document.getElementById("sdt-" + name));
  const animator = viewer.animator;
  play.onclick = () => animator.playing ? animator.pause() : animator.play();
  seek.oninput = () => {
    animator.pause();
    animator.time = +seek.value;
    animator.seek(animator.time);
  };
  (function update() {
    seek.max = animator.duration;
    seek.value = animator.time;
    play.textContent = animator.playing ? "Pause" : "Play";
    shown.textContent = animator.time.toFixed(1) + " / " + animator.duration.toFixed(1) + " s";
    requestAnimationFrame(update);
  })();

  // On a screen that is higher than wide, the device fits from further away.
  const camera = viewer.camera, target = viewer.controls.target.set($TARGET);
  const away = Math.max(1, 1.3 * innerHeight / innerWidth);
  camera.position.set($EYE).sub(target).multiplyScalar(away).add(target);
  camera.fov = $OUTSIDE;

  let outside = null;  // how the camera was before it moved to the head
  function ride(on) {
    if (on) {
      outside = {fov: camera.fov, near: camera.near, position: camera.position.clone()};
      camera.fov = $FIELD;
      camera.near = $NEAR;
    } else {
      camera.position.copy(outside.position);
      camera.fov = outside.fov;
      camera.near = outside.near;
      outside = null;
    }
    viewer.controls.enabled = !on;
    view.textContent = on ? "From outside" : "Pilot's view";
    viewer.set_dirty();
  }
  view.onclick = () => ride(outside === null);
  // Meshcat calls this between its own placing of the camera and the drawing.
  viewer.render_callback = function () {
    if (outside === null) return;
    const head = viewer.scene_tree.find(["head"]).object;
    head.updateWorldMatrix(true, false);
    camera.parent.updateWorldMatrix(true, false);
    // A camera looks along its -z with y up; the head has x forward, y left and z up.
    const turn = head.matrixWorld.clone().set(0, 0, -1, 0, -1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1);
    camera.parent.matrixWorld.clone().invert().multiply(head.matrixWorld).multiply(turn)
      .decompose(camera.position, camera.quaternion, camera.scale);
  };
  if ($PILOT) ride(true);
})();
</script>
"""


# --- live -----------------------------------------------------------------------------------------


def check_port(port: int | None) -> None:
    """Refuse a port that a server of a user cannot have; None is any free one.

    Raises:
        InputError: if it is out of range.
    """
    if port is not None and not 1024 <= port <= 65535:
        raise InputError(f"port: {port}, expected 1024 to 65535")


def check_rate(rate: float, where: str = "rate") -> None:
    """Refuse a rate [-] at which nobody can watch.

    Raises:
        InputError: naming `where`, if it is beyond RATES.
    """
    slowest, fastest = RATES
    if not slowest <= rate <= fastest:
        raise InputError(f"{where}: {rate:g}, expected {slowest:g} to {fastest:g}")


def open_meshcat(port: int | None = None) -> Meshcat:
    """A Meshcat server that only this machine reaches.

    Args:
        port: 1024 to 65535; by default the first free one from 7000 to 7099.

    Raises:
        InputError: if the port is out of range, or in use.
    """
    check_port(port)
    try:
        return Meshcat(MeshcatParams(host="localhost", port=port, show_stats_plot=False))
    except RuntimeError:
        used = f"{port} is in use" if port else "7000 to 7099 are all in use"
        raise InputError(f"port: {used}, choose another one") from None


def play(
    robot: Robot,
    time: Array,
    q: Array,
    *,
    specific_force: Array | None = None,
    rate: float = 1.0,
    pilot: bool = False,
    port: int | None = None,
    once: bool = False,
    announce: Callable[[str], None] = print,
) -> None:
    """Show the motion in a browser, again and again, until Ctrl-C.

    Args:
        robot, time, q, specific_force: as in `record_html`.
        rate: 1 for real time, 2 for twice as fast; within RATES.
        pilot: with the camera at the head, looking forward.
        port: of the server on this machine; by default the first free one from 7000 to 7099.
        once: return at the end of the motion.
        announce: called with the address of the page, before the motion starts.

    Raises:
        InputError: if the motion does not fit the robot, the rate is beyond RATES, or there is no
            port.
    """
    check_rate(rate)
    if pilot:
        check_head(robot)
    frames = make_frames(robot, time, q, specific_force)
    meshcat = open_meshcat(port)
    scene = Scene(robot, frames, meshcat)
    scene.overview()
    try:
        announce(meshcat.web_url())
        while True:
            _run_once(scene, rate, pilot)
            if once:
                return
    except KeyboardInterrupt:
        return


def _run_once(scene: Scene, rate: float, pilot: bool) -> None:
    """Every picture at its time; those that it is too late for are left out."""
    frames, start = scene.frames, clock.perf_counter()
    k, last = -1, len(scene.frames.time) - 1
    while k < last:
        due = (clock.perf_counter() - start) * rate * FRAME_RATE
        k = int(min(max(k + 1, due), last))
        clock.sleep(max(0.0, frames.time[k] / rate - (clock.perf_counter() - start)))
        scene.show(k)
        if pilot:
            scene.pilot_view(k)
        scene.meshcat.Flush()
