"""The report of one run: the answer first, then all details."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sdt_drake.analysis.comparison import Compared
from sdt_drake.analysis.frequency_response import FrequencyResponse, frequency_response, left_out
from sdt_drake.analysis.heat import heat_of
from sdt_drake.analysis.metrics import COMPARED, METRICS
from sdt_drake.io.errors import InputError
from sdt_drake.io.files import write_text
from sdt_drake.io.shown import by_joint, joint_count
from sdt_drake.io.versions import versions
from sdt_drake.io.yaml_files import yaml_text
from sdt_drake.motion import Story, story_of
from sdt_drake.pilot.head import has_head
from sdt_drake.pilot.illusions import feel, illusions, intended
from sdt_drake.pilot.orientation import CAUTION, Percept
from sdt_drake.run.controllers import option_names
from sdt_drake.run.design import Design
from sdt_drake.run.options import in_print
from sdt_drake.run.recording import Recording
from sdt_drake.show import sections as doc
from sdt_drake.show.documents import Report, written
from sdt_drake.show.figures.pilot import felt_panels, felt_true
from sdt_drake.show.figures.scope import (
    joint_panels,
    probe_panels,
    torque_over_speed,
    warm_windings,
)
from sdt_drake.show.panels import MAX_SAMPLES, Plots
from sdt_drake.show.reports.run_answer import answer
from sdt_drake.show.style import joint_title
from sdt_drake.show.view3d.scene import FELT_MODEL
from sdt_drake.show.view3d.viewer import played


def write_run_report(
    design: Design, recording: Recording, path: Path, joints: Sequence[int]
) -> None:
    """Write the report of a run: one page (.html), or Markdown with pictures beside it (.md).

    Args:
        design: the design of the run.
        recording: the recording of all joints.
        path: a file that ends in .html or .md.
        joints: joints that are shown over time, counted from 0.

    Raises:
        InputError: if a file cannot be written.
    """
    report = run_report(design, recording, path, joints)
    if path.suffix == ".html":
        write_text(path, report.page(path.parent))
        return
    write_text(path, report.markdown())
    report.write_parts(path.parent)


def run_report(design: Design, recording: Recording, path: Path, joints: Sequence[int]) -> Report:
    """Make the report of a run; arguments as in `write_run_report`."""
    scenario, robot = design.scenario, design.device.simulated
    run = Compared(scenario.controller.label, design, recording)
    try:
        response: FrequencyResponse | str = frequency_response(design)
    except InputError as error:  # a user's controller that Drake cannot linearise
        response = str(error)
    tracked = [(METRICS[name], run.metrics[name]) for name in COMPARED]
    story = story_of(scenario.motion, robot, design.reference.tracked)
    yaml = yaml_text(scenario).rstrip()
    samples, name = len(recording.time), path.stem
    return written("run", {
        **answer(run, response),
        "name": name, "title": scenario.summary().title, "robot": robot.name,
        "motion": Path(scenario.motion).stem, "duration": design.reference.planned.duration,
        "what": doc.Table(["", ""], list(_what(design))), "gains": _gains(design),
        **_loops(design, response),
        "tracking": _table(design, [(m.label, m.format, m.factor * x) for m, x in tracked]),
        "all": None if samples > MAX_SAMPLES else samples,
        "many": samples if samples > MAX_SAMPLES else None,
        "over_time": list(_over_time(run, joints, name)), "over_speed": _over_speed(design),
        f"{name}_torque.png": Plots([[torque_over_speed(recording, design, k)] for k in joints]),
        "probes": list(_probes(recording, name)),
        "windings": _windings(run),
        f"{name}_windings.png": design.windings and Plots([warm_windings(recording, design)]),
        "pilot": _pilot(run, story, name) if has_head(robot) else [],
        "recording": played(
            f"{name}_3d.html", "The run in 3D; drag to turn the view.", robot, recording.time,
            recording.q, title=scenario.name, story=story,
        ),
        "scenario": doc.details("The scenario, every field of it, as YAML", doc.fenced(yaml)),
        "versions": doc.Table(["", "version"], list(versions().items())),
    })  # fmt: skip


# --- tables ----------------------------------------------------------------------------------


def _what(design: Design) -> Iterator[tuple[str, str]]:
    """Return robot, motion, controller, plant and drives in words."""
    scenario, wanted = design.scenario, design.reference.planned
    choice, plant, drive = scenario.controller, scenario.plant, scenario.drive
    robot = design.device.simulated
    file, motion = doc.code(Path(scenario.robot).name), doc.code(Path(scenario.motion).name)
    yield "robot", doc.said("{}, {} ({})", robot.name, joint_count(robot.n), file)
    learned = "" if design.reference.tracked is wanted else "; the reference is learned"
    times = wanted.duration, wanted.period
    yield "motion", doc.said("{}, {:g} s at {:g} s{}", motion, *times, learned)
    yield "controller", doc.said("{}: {}", in_print(choice.label), choice.in_words(design))
    gain = f" times {list(choice.feedforward_gain)}" if choice.feedforward_gain else ""
    yield (
        "torque feedforward",
        _those(
            "none",
            (f"{choice.feedforward_in_use}{gain}", choice.feedforward_in_use != "none"),
            ("friction at the speed of the reference", choice.friction_compensation),
            ("learned torque", design.reference.torque is not None),
        ),
    )
    exact = design.device.model.sdf == robot.sdf
    yield "controller's model", "exact" if exact else "differs from the simulated robot"
    coupled = "all joints coupled, by Drake's MultibodyPlant"
    alone = "each axis alone, with the load torque of the reference motion"
    inertia = None if plant.i_eff is None else list(plant.i_eff)
    yield (
        "plant",
        _those(
            "",
            (coupled if plant.kind == "coupled" else alone, True),
            (f"with the inertia {inertia} kg m² on the motors", inertia),
            ("with friction", not plant.friction.is_none),
            ("with elastic joints", not plant.elasticity.is_rigid),
            ("with stops that push back", not plant.stops.is_none),
            ("with deviations", robot is not design.device.nominal),
            ("with a disturbance", scenario.disturbance.amplitude),
        ),
    )
    yield "drives", _those(
        "ideal",
        (f"speed loop every {1e3 * (drive.period or 0):g} ms", drive.period is not None),
        ("encoders with increments", drive.encoder_resolution is not None),
        (f"torque loop of {drive.torque_bandwidth} Hz", drive.torque_bandwidth is not None),
        ("wrong torques", drive.torque_error is not None),
        (f"torque-speed envelope of {getattr(design.envelope, 'source', '')}",
         design.envelope is not None),
        (f"reference {1e3 * drive.reference_delay:g} ms late", drive.reference_delay),
    )  # fmt: skip


def _those(default: str, *clauses: tuple[str, object]) -> str:
    """Join the clauses that hold."""
    return "; ".join(text for text, holds in clauses if holds) or default


def _gains(design: Design) -> doc.Table:
    columns = [
        ("effective inertia [kg m²]", ".4g", design.tuning.inertia.maximum),
        ("K_PS [N m s/rad]", ".6g", design.tuning.gains.kp),
        ("K_IS [N m/rad]", ".6g", design.tuning.gains.ki),
        ("ω_n [rad/s]", ".4g", design.tuning.omega_n),
        ("largest torque [N m]", ".4g", design.device.simulated.motor_torque_limit),
        ("gear ratio", ".4g", design.device.simulated.gear_ratio),
    ]
    if "position_gain" in option_names(type(design.scenario.controller)):
        columns.insert(3, ("K_V [1/s]", ".4g", design.tuning.position_gain))
    return _table(
        design, columns, "Motor side: the largest inertia along the motion, and the gains"
    )


def _table(
    design: Design, columns: Sequence[tuple[str, str, NDArray[Any]]], title: str = ""
) -> doc.Table:
    """Make a table with a row for each joint; columns as in `by_joint`."""
    return doc.Table(*by_joint(design.device.simulated.joint_names, columns), title)


def _loops(design: Design, response: FrequencyResponse | str) -> dict[str, Any]:
    """Return the linear analysis, or why there is none."""
    if isinstance(response, str):
        return {"no_analysis": response, "loops": None, "cut": None}
    more = doc.joined((doc.said("{}.", x.capitalize()) for x in left_out(design, response)), " ")
    table = _table(design, response.columns())
    return {"no_analysis": None, "loops": table, "cut": response.cut, "left_out": more}


def _windings(run: Compared) -> list[doc.Block]:
    """Return whether the motion may be flown back to back, and the temperatures of the windings."""
    robot, windings = run.design.device.simulated, run.design.windings
    if windings is None:
        return []
    heat = heat_of(run.recording, windings)
    columns = [
        ("highest in the run [°C]", ".1f", heat.highest),
        ("back to back for ever [°C]", ".1f", heat.endless),
        ("limit [°C]", ".0f", heat.limit),
        ("time to the limit [s]", ".4g", heat.time_to_limit),
    ]
    answer = doc.said("**The motion {}.**", heat.sentence(robot, run.recording.time[-1]))
    return [answer, _table(run.design, columns)]


# --- plots -----------------------------------------------------------------------------------


def _over_time(run: Compared, joints: Sequence[int], name: str) -> Iterator[doc.Block]:
    """Yield the plots of each joint over time."""
    panels = joint_panels(run.recording, run.design)
    for k in joints:
        title = joint_title(k, run.design.device.simulated.joint_names[k]).capitalize()
        caption = f"{title}: torques are motor side, all else joint side."
        if np.any(run.recording.saturated[:, k] > 0):
            caption += " On grey ground the motor gives less torque than commanded."
        yield doc.said("### {}", title)
        yield doc.Picture(f"{name}_joint_{k + 1}.png", caption, Plots([panels[k]]))


def _probes(recording: Recording, name: str) -> Iterator[doc.Block]:
    """Return a figure of each probe."""
    for i, (probe, panels) in enumerate(probe_panels(recording).items()):
        yield doc.Picture(f"{name}_probe_{i + 1}.png", f"The probe {probe}.", Plots([panels]))


def _over_speed(design: Design) -> str:
    """Return the caption of torque over speed."""
    caption = "Torque of the motors over their speed, motor side, at the ends of the periods."
    if design.scenario.plant.kind == "axis":
        caption += " On this plant the other motors' help widens the limits, which is not drawn."
    if design.springs is not None:
        caption += " The speed of elastic joints is link speed times gear ratio."
    return caption


def _pilot(run: Compared, story: Story, name: str) -> list[doc.Block]:
    """Return the intended feeling of the motion, the predicted illusions, and plots by axis."""
    head = run.head.achieved
    felt: Percept | None = None
    try:
        felt = feel(head, run.design.reference.tracked.period, FELT_MODEL)
        blocks, predicted = _predicted(felt, run, story)
    except InputError as error:
        blocks = [doc.said("There is no prediction of what is felt: {}.", error)]
        predicted = ""
    if story.feels:
        meant = doc.said("To be felt: {}", story.feels)
        blocks.insert(0, doc.joined([meant, predicted], " ") if predicted else meant)
    threshold = doc.Marked(
        "> The last plot of each figure is the error over the threshold of attentive people in "
        "silence and darkness. Below 1 nobody feels it; above, some may."
    )
    illusion = next(iter(felt_true(felt, head, story).values())) if felt else None
    if illusion and illusion.marked is not None:
        caption = f"Felt against true motion of the head; {illusion.marked_label}."
        blocks.append(doc.Picture(f"{name}_pilot_illusion.png", caption, Plots([[illusion]])))
    pictures = [
        doc.Picture(
            f"{name}_pilot_{turn}.png",
            f"{push.capitalize()} force and {turn} of the head, in its own axes.",
            Plots([panels]),
        )
        for turn, push, panels in felt_panels(run.recording.time, run.head, felt)
    ]
    return [*blocks, CAUTION, threshold, *pictures]


def _predicted(felt: Percept, run: Compared, story: Story) -> tuple[list[doc.Block], str]:
    """Return the predicted illusions, and if the intended one is predicted."""
    head, sentence = run.head.achieved, ""
    found = [f"{one}." for one in illusions(felt, head)]
    if story.illusion:
        meant = intended(run.design.scenario.name, story.illusion, head, {FELT_MODEL: felt})
        sentence = meant.sentence(FELT_MODEL)
    if not found:
        return [doc.said("{:code} predicts no illusion.", FELT_MODEL)], sentence
    return [doc.said("Illusions that {:code} predicts:", FELT_MODEL), doc.bullets(found)], sentence
