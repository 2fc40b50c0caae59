"""Every figure and diagram here, drawn again.

    python diagrams/redraw.py [FOLDER] [--only NAME ...] [--record] [--studies FOLDER]

Writes into FOLDER, by default the folder of this script, in some two minutes; --help lists the
names. NAME_plot.png is a figure; the paper's loops are NAME.dot and NAME.svg, too. Scripts of
their own wire four of them, and write their own files (figure4_step_response.py and so on).
device.png is the device as its SDF draws it. With --record the training motions are also written as
training_NAME.html, the device in 3D, which plays in any browser.

The figures of the two shipped studies, monte_carlo and sizing, are drawn from their rows in the
folder --studies, by default those here. To run them again takes about a quarter of an hour each on
two cores:

    sdt-drake study run package://sdt/studies/monte_carlo.yaml --workers 2 --out studies/monte_carlo
    sdt-drake size package://sdt/studies/sizing.yaml --workers 2 --out studies/sizing
"""

import argparse
import json
import runpy
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from unittest import mock

import matplotlib.image
import numpy as np
from matplotlib.figure import Figure
from matplotlib.text import Text
from numpy.typing import NDArray
from PIL import Image
from PIL.PngImagePlugin import PngInfo
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    LightParameter,
    MakeRenderEngineVtk,
    RenderCameraCore,
    RenderEngineVtkParams,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.sensors import CameraInfo

from sdt_drake.analysis.comparison import compare
from sdt_drake.analysis.stability import IDEAL, stability_sweep
from sdt_drake.analysis.tracking import track_head
from sdt_drake.io.resources import models_dir
from sdt_drake.machine.identify.model import identified_robot
from sdt_drake.machine.identify.procedure import identify
from sdt_drake.machine.recordings.recorded import Recorded
from sdt_drake.motion import Motion, Story, load_plan, shipped_motions, story_of
from sdt_drake.paper.diagrams import DIAGRAMS, write_block_diagram
from sdt_drake.robot.deviation import Deviation
from sdt_drake.robot.device import ENCODERS
from sdt_drake.robot.dynamics import inverse_dynamics
from sdt_drake.run.design import Design, make_design
from sdt_drake.run.recording import Recording
from sdt_drake.run.scenario import load_scenario
from sdt_drake.run.simulate import simulate
from sdt_drake.show.figures import pilot as plots_pilot
from sdt_drake.show.figures import runs as plots
from sdt_drake.show.figures.fronts import sizing_front
from sdt_drake.show.figures.studies import distributions
from sdt_drake.show.panels import over_time, picture
from sdt_drake.show.style import PALETTE, Look, style
from sdt_drake.show.view3d.viewer import record_html
from sdt_drake.studies.results import read_study_table
from sdt_drake.studies.sizing import load_sizing
from sdt_drake.studies.verdicts import judge_candidates

HERE = Path(__file__).resolve().parent
SCRIPTS = {
    "figure4": "figure4_step_response",
    "figure5": "figure5_axis_pi",
    "figure6": "figure6_axis_ctc",
    "coupled_loop": "coupled_loop",
}
HOWTO = {x: x for x in ("gain", "temperature", "linear", "stops", "felt")} | {"probes": "loop"}
CONTROLLERS = ("pi", "pi_ctc", "pi_id", "p_pi", "p_pi+id", "pi_scheduled", "inverse_dynamics")


@cache
def designed(name: str) -> Design:
    """Of a shipped scenario."""
    return make_design(load_scenario(f"package://sdt/scenarios/{name}.yaml"))


# --- the paper's loops -----------------------------------------------------------------------


def figure3() -> Figure:
    """Decoupling of the inverse dynamics into load and alleviating torque."""
    design = designed("axis_pi")
    title = "Torques, motor side: PI on decoupled axes, Algorithm 1 as printed"
    return plots.torques(title, simulate(design), design.loads, design.device.simulated)


def coupled_loop() -> Figure:
    """The MultibodyPlant under PI, and under PI + CTC."""
    designs = {label: designed(f"coupled_{label}") for label in ("pi", "pi_ctc")}
    runs = {label: simulate(design) for label, design in designs.items()}
    names, reference = designs["pi"].device.simulated.joint_names, designs["pi"].reference.tracked
    return plots.speed_errors("Speed errors on the coupled MultibodyPlant", runs, names, reference)


# --- beyond the paper ------------------------------------------------------------------------


def controllers() -> Figure:
    """Controllers compared on the coupled plant."""
    title = "Controllers on the coupled MultibodyPlant, model known exactly"
    return plots.comparison(title, compare(designed("coupled_pi"), CONTROLLERS))


def stability() -> Figure:
    """How fast the loops may be, with elastic joints."""
    design = designed("real_device")
    cascade = design.scenario.changed({"controller.kind": "p_pi"})
    loops = {
        "pi, ideal drive": (design, IDEAL),
        "pi, sampled at 1 ms": (design, design.scenario.drive),
        "p_pi, ideal drive": (design.variant(cascade), IDEAL),
    }
    omega_r = design.scenario.controller.omega_r
    sweeps = {
        encoder: {
            label: stability_sweep(of, omega_r, encoder=encoder, drive=drive)
            for label, (of, drive) in loops.items()
        }
        for encoder in ENCODERS
    }
    title = f"Loops tuned for ω_n, joints elastic with ω_r = {omega_r:.1f} rad/s"
    return plots.stability(title, sweeps, design.device.simulated.joint_names)


def observer() -> Figure:
    """PI with a disturbance observer, with a wrong model."""
    title = "PI, computed torque and disturbance observer: model 40 kg too light, friction unknown"
    return plots.comparison(title, compare(designed("wrong_model"), ("pi", "pi_ctc", "pi_dob")))


def gears() -> Figure:
    """Speed errors of PI without and with ripple, losses of gears and play."""
    plan = designed("coupled_pi").reference.planned
    motion = Motion(plan.period, plan.q[:801], plan.v[:801], plan.vd[:801])
    elastic = {"plant.elasticity.natural_frequency": [66.0, 66.0, 0.0, 0.0]}
    play = {"plant.elasticity.backlash": [1e-3, 1e-3, 0.0, 0.0]}
    cases = {
        "ideal": {},
        "efficiency 0.8": {"plant.gear_efficiency": [0.8] * 4},
        "ripple of 2 %": {"drive.ripple_harmonics": [6.0], "drive.ripple_amplitude": [0.02]},
        "play of 1 mrad": elastic | play,
    }
    runs = {
        label: simulate(make_design(load_scenario("coupled_pi", changes), motion=motion))
        for label, changes in cases.items()
    }
    names = designed("coupled_pi").device.simulated.joint_names
    return plots.speed_errors("Gears and motors that are not ideal, PI", runs, names, motion)


def filters() -> Figure:
    """A notch where motor and link swing against each other, with encoders on the links."""
    design, omega_r = designed("axis_pi"), 65.991
    free = omega_r * np.sqrt(design.i_eff / design.nominal.motor_inertia) / (2 * np.pi)
    changes = {"controller.filters.notch_frequency": [*free[:2], 0.0, 0.0]}
    notched = design.variant(design.scenario.changed(changes))
    sweeps = {
        label: stability_sweep(of, omega_r, encoder="link")
        for label, of in (("no filter", design), ("notch", notched))
    }
    title = "Notches of joints 1 and 2 at the frequency of motor against link"
    return plots.stability(title, {"link": sweeps}, design.device.simulated.joint_names)


def identification() -> Figure:
    """The torques that a training motion needs, and by how much the file of the device and the
    identified robot miss them.

    The real device of the scenario `real_device`, with frames 8 % heavier than its file says and
    another pilot, flies exciting.yaml, which `sdt-drake excite` has made; its torques are recorded
    with 1 % of noise.
    """
    scales = [1.08, 1.08, 1.08, 1.08, 1.0]
    deviation = Deviation(payload_mass=18.0, payload_offset=[0.0, 0.03, 0.0265], link_scales=scales)
    changes = {"plant.deviation": deviation, "controller.model": Deviation()}
    changes["motion"] = str(HERE / "exciting.yaml")
    design = make_design(load_scenario("real_device", changes))
    device, run = design.device.simulated, simulate(design)
    tau = run.tau_mean * device.gear_ratio
    noise = np.random.default_rng(0).normal(size=tau.shape)
    tau += 0.01 * np.sqrt(np.mean(tau**2, axis=0)) * noise
    recorded = Recorded(HERE / "exciting.csv", run.time, {"q": run.q, "tau": tau, "tau_mean": tau})
    identified = identified_robot(identify(design.device.nominal, [recorded]))

    motion = load_plan("coriolis").motion
    needed, file, found = (
        inverse_dynamics(robot, motion.q, motion.v, motion.vd)
        for robot in (device, design.device.nominal, identified)
    )
    whole = [("needed by the device", Look(PALETTE[0]), needed)]
    torques = over_time("torque [N m], joint side", motion.time, whole, device.joint_names)
    parts = [
        ("missed by the file", Look(PALETTE[7], "--"), needed - file),
        ("missed by the identified robot", Look(PALETTE[1]), needed - found),
    ]
    missed = over_time("missed [N m], joint side", motion.time, parts)
    for name, torque in (("file", file), ("identified", found)):
        left = np.sqrt(np.mean((needed - torque) ** 2, axis=0) / np.mean(needed**2, axis=0))
        print(f"{name} misses {' '.join(f'{100 * x:.2f}' for x in left)} % of the RMS torque")
    title = "Torques of the links on the Coriolis motion; identified from another motion"
    return picture(title, [torques, missed])


def monte_carlo(studies: Path) -> Figure:
    title = "Devices that differ from their controllers' model: share at or below an error"
    outcomes = ("max_abs_speed_error", "max_abs_position_error")
    return distributions(title, read_study_table(studies / "monte_carlo"), outcomes)


def sizing(studies: Path) -> Figure:
    what, _ = load_sizing("package://sdt/studies/sizing.yaml")
    verdicts = judge_candidates(what, read_study_table(studies / "sizing"))
    return sizing_front("Motor sets and structures, each in all motions", verdicts)


def howto(page: str) -> Figure:
    """What the code on a page of the documentation saves."""
    text = (HERE.parent / f".github/docs/pages/howto/{page}.md").read_text(encoding="utf-8")
    saved = []
    with mock.patch.object(Figure, "savefig", lambda figure, _: saved.append(figure)):
        exec(text.split("```python\n")[1].split("```")[0], {})
    return saved[-1]


# --- the device ------------------------------------------------------------------------------


@cache
def flown(motion: str) -> tuple[Design, Recording, Story]:
    """A training motion that ships with the package, simulated."""
    design = make_design(load_scenario("training", {"motion": motion}))
    story = story_of(motion, design.device.simulated, design.reference.tracked)
    return design, simulate(design), story


def training(motion: str) -> Figure:
    """What the pilot feels of a training motion."""
    design, run, story = flown(motion)
    return plots_pilot.pilot(motion, run.time, track_head(run, design.device.simulated), story)


def device(path: Path) -> None:
    """Write a picture of the device."""
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
    Parser(plant).AddModels(str(models_dir() / "sdt.sdf"))
    plant.Finalize()
    directions = {(-0.5, -0.4, -0.8): 0.85, (-0.9, 0.3, -0.2): 0.4, (0.4, -0.8, -0.2): 0.35}
    lights = [
        LightParameter(type="directional", direction=direction, frame="world", intensity=intensity)
        for direction, intensity in directions.items()
    ]
    parameters = RenderEngineVtkParams(default_clear_color=[0.96, 0.97, 0.98], lights=lights)
    scene_graph.AddRenderer("vtk", MakeRenderEngineVtk(parameters))
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    plant.SetPositions(plant.GetMyMutableContextFromRoot(context), [0.0, 0.3, -0.15, 0.3])  # rad

    core = RenderCameraCore(
        "vtk", CameraInfo(1200, 640, np.radians(34)), ClippingRange(0.1, 50), RigidTransform()
    )
    camera = looking(np.array([7.3, 4.0, 3.0]), np.array([1.3, -0.2, -0.55]))  # m
    query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(context))
    image = query.RenderColorImage(ColorRenderCamera(core), scene_graph.world_frame_id(), camera)
    path.parent.mkdir(parents=True, exist_ok=True)
    matplotlib.image.imsave(path, image.data[:, :, :3])


def looking(eye: np.ndarray, target: np.ndarray) -> RigidTransform:
    """Pose of a camera at `eye` that looks at `target`: z forward, y down."""
    z = (target - eye) / np.linalg.norm(target - eye)
    x = np.cross(z, [0, 0, 1])
    x /= np.linalg.norm(x)
    return RigidTransform(RotationMatrix(np.stack([x, np.cross(z, x), z], axis=1)), eye)


# --- all of them -----------------------------------------------------------------------------


MADE = (figure3, coupled_loop, controllers, stability, filters, observer, gears, identification)


def figures(studies: Path) -> dict[str, Callable[[], Figure]]:
    """What draws each, by name."""
    return {
        **{draw.__name__: draw for draw in MADE},
        **{name: partial(howto, page) for name, page in HOWTO.items()},
        "monte_carlo": partial(monte_carlo, studies),
        "sizing": partial(sizing, studies),
        **{f"training_{motion}": partial(training, motion) for motion in shipped_motions()},
    }


# --- files -----------------------------------------------------------------------------------


def drawn_numbers(figure: Figure) -> list[list[float]]:
    """What a figure shows: x and y of every line, set of points or areas, and bar, in their order.

    Of each at most 50 points, evenly among them, to 4 digits.
    """
    shown = []
    for axes in figure.axes:
        shown += [line.get_xydata() for line in axes.lines]
        for points in axes.collections:
            paths = (path.vertices for path in points.get_paths())
            shown.append(np.vstack([points.get_offsets(), *paths]))
        for patch in axes.patches:
            shown.append(patch.get_patch_transform().transform(patch.get_path().vertices))
    return [_thinned(np.asarray(points, dtype=float)) for points in shown]


def texts(figure: Figure) -> list[str]:
    """Title, titles and labels of axes, words in them, and legends of a figure."""
    words: list[str | Text] = [figure.get_suptitle()]
    for axes in figure.axes:
        words += [axes.get_title(loc) for loc in ("left", "center", "right")]
        words += [axes.get_xlabel(), axes.get_ylabel(), *axes.texts]
    for legend in (*figure.legends, *(axes.get_legend() for axes in figure.axes)):
        words += legend.get_texts() if legend else []
    words = (one if isinstance(one, str) else one.get_text() for one in words)
    return [text for text in words if text]


def _thinned(points: NDArray[np.float64]) -> list[float]:
    few = points[np.linspace(0, len(points) - 1, min(len(points), 50)).round().astype(int)]
    return [float(f"{value:.4g}") for value in few.ravel()]


def save(figure: Figure, path: Path) -> None:
    """Write a PNG with its numbers and texts, by which two are compared: pixels depend on versions
    and fonts."""
    content = {"numbers": drawn_numbers(figure), "texts": texts(figure)}
    path.parent.mkdir(parents=True, exist_ok=True)
    with style():
        figure.savefig(path, metadata={"Comment": json.dumps(content)})
    shrink(path)


def shrink(path: Path) -> None:
    """Reduce a PNG to 256 colours, a third of its size; its comment stays."""
    with Image.open(path) as image:
        info = PngInfo()
        if "Comment" in image.info:
            info.add_text("Comment", image.info["Comment"])
        few = image.convert("RGB").quantize(256, dither=Image.Dither.NONE)
    few.save(path, optimize=True, pnginfo=info)


NAMES = tuple(dict.fromkeys(["device", *DIAGRAMS, *figures(HERE)]))


def draw(name: str, folder: Path, studies: Path, *, record: bool) -> None:
    """Write all that is called `name`."""
    if name in DIAGRAMS:
        write_block_diagram(name, designed("coupled_pi"), folder)
    if name in SCRIPTS:
        figure, _ = runpy.run_path(str(HERE / f"{SCRIPTS[name]}.py"))["main"](folder)
        save(figure, folder / f"{SCRIPTS[name]}.png")
    if name == "device":
        device(folder / "device.png")
    if name in figures(studies):
        save(figures(studies)[name](), folder / f"{name}_plot.png")
    motion = name.removeprefix("training_")
    if record and motion != name:
        design, run, story = flown(motion)
        record_html(design.device.simulated, run.time, run.q, folder / f"{name}.html", story=story)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", nargs="?", type=Path, default=HERE)
    parser.add_argument(
        "--only", nargs="+", choices=NAMES, default=NAMES, metavar="NAME", help=", ".join(NAMES)
    )
    parser.add_argument("--record", action="store_true", help="training motions in 3D, too")
    parser.add_argument("--studies", type=Path, default=HERE / "studies", help="folder of both")
    options = parser.parse_args()
    for name in options.only:
        print(name, flush=True)
        draw(name, options.folder, options.studies, record=options.record)


if __name__ == "__main__":
    main()
