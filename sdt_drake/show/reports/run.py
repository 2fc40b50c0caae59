"""The report of one run, to hand to whoever asked for it: the answer first, then all of it."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.common.yaml import yaml_dump_typed

from sdt_drake.analysis.comparison import Compared
from sdt_drake.analysis.frequency_response import FrequencyResponse, frequency_response, left_out
from sdt_drake.analysis.metrics import COMPARED, METRICS, plain_number
from sdt_drake.analysis.perception import CHANNELS
from sdt_drake.analysis.tracking import stops_passed
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.files import write_text
from sdt_drake.io.shown import by_joint, joint_count
from sdt_drake.io.versions import versions
from sdt_drake.motion import story_of
from sdt_drake.robot.head import has_head
from sdt_drake.run.controllers import controller_class
from sdt_drake.run.design import Design
from sdt_drake.run.kinds import CONTROLLERS
from sdt_drake.run.scenario import Scenario
from sdt_drake.run.simulate import Recording
from sdt_drake.show import documents as doc
from sdt_drake.show.figures.pilot import head_panels
from sdt_drake.show.figures.scope import joint_columns, position_panels, torque_over_speed
from sdt_drake.show.panels import MOST, Line, Panel, Plots
from sdt_drake.show.style import PALETTE, Look, joint_title
from sdt_drake.show.view3d.viewer import recorded_page


def write_run_report(
    design: Design, recording: Recording, path: Path, joints: Sequence[int]
) -> None:
    """Write the report of a run: one page (.html), or Markdown with what it shows beside it (.md).

    Args:
        design: of the run.
        recording: of all its joints.
        path: ends in .html or .md.
        joints: those to show over time, from 0.

    Raises:
        InputError: if it cannot be written.
    """
    report = run_report(design, recording, path, joints)
    if path.suffix == ".html":
        write_text(path, report.html())
        return
    write_text(path, report.markdown())
    for block in (block for section in report.sections for block in section.blocks):
        if isinstance(block, Plots):
            block.save_picture()
        elif isinstance(block, doc.EmbeddedPage):
            write_text(block.path, block.text or "")


def run_report(
    design: Design, recording: Recording, path: Path, joints: Sequence[int]
) -> doc.Document:
    """The report of a run; arguments as in `write_run_report`."""
    scenario, run = design.scenario, Compared(design.scenario.controller.label, design, recording)
    response = _response(design)
    has_pilot = has_head(design.robot)
    sections = [
        doc.Section("In short", [doc.Bullets(_answer(run, response))]),
        doc.Section("What was run", _setup(design)),
        doc.Section("Loops", _loops(design, response)),
        doc.Section("Tracking", _tracking(run)),
        doc.Section("Over time", _over_time(run, path, joints)),
        doc.Section("Torque over speed", _over_speed(run, path, joints)),
        doc.Section("What the pilot feels", _felt(run, path) if has_pilot else []),
        doc.Section("In 3D", _in_3d(run, path)),
        doc.Section("Scenario and versions", _provenance(scenario)),
    ]
    lead = f"{design.robot.name} on {Path(scenario.motion).stem}, {design.wanted.duration:g} s."
    return doc.Document(scenario.summary().title, lead, sections)


# --- in short --------------------------------------------------------------------------------


def _answer(run: Compared, response: FrequencyResponse | InputError) -> list[str]:
    names, recording, tracking = run.design.robot.joint_names, run.recording, run.tracking

    def worst(values: Array) -> tuple[int, str]:
        k = int(np.nanargmax(values))
        return k, joint_title(k, names[k])

    def when(errors: Array) -> str:
        return f"at {recording.time[np.abs(errors).argmax()]:.3f} s"

    k, name = worst(tracking.max_abs_speed_error)
    error, largest = tracking.max_abs_speed_error[k], np.abs(recording.v_ref[:, k]).max()
    share = f", {100 * error / largest:.1f} % of its largest speed" if largest > 0 else ""
    at = when(recording.speed_error[:, k])
    lines = [f"**Speed:** {name}, strays most, by {error:.4g} rad/s {at}{share}."]

    k, name = worst(tracking.max_abs_position_error)
    lost = np.degrees(tracking.max_abs_position_error[k])
    at = when(recording.position_error[:, k])
    lines.append(f"**Position:** {name}, strays most, by {lost:.4g} deg {at}.")

    k, name = worst(run.motors.peak_share)
    at_limit = [
        f"joint {i} for {plain_number(100 * share)} % of the time"
        for i, share in enumerate(tracking.saturated_fraction, 1)
        if share
    ]
    lines.append(
        f"**Motors:** that of {name}, is used most, up to {100 * run.motors.peak_share[k]:.1f} % "
        f"of its torque. Saturated: {', '.join(at_limit) or 'none at any time'}."
    )
    if has_head(run.design.robot):
        felt, angles = (100 * f.share for f in (run.head.felt, run.head.felt_from_angles))
        lines.append(
            f"**Pilot:** the error could be felt {felt:.1f} % of the time, by the wrong joint "
            f"angles alone {angles:.1f} %."
        )
    if isinstance(response, FrequencyResponse):
        lines.append(f"**Loops:** {_judged(response, names)}.")
    return lines + [f"**Note:** {line}." for line in stops_passed(recording, names)]


def _judged(response: FrequencyResponse, names: Sequence[str]) -> str:
    """Whether the loops are stable, and how nearly they are not."""
    unstable = [joint_title(k, name) for k, name in enumerate(names) if not response.stable[k]]
    if unstable:
        return f"unstable in linear analysis: {'; '.join(unstable)}"
    k = int(response.damping.argmin())
    text = f"all are stable. Least damped is joint {k + 1}, with a damping ratio of "
    text += f"{response.damping[k]:.2g}"
    if not np.isnan(response.phase_margin).all():
        k = int(np.nanargmin(response.phase_margin))
        of = " of a position loop" if response.at_positions else ""
        text += f"; smallest phase margin{of}: joint {k + 1}, {response.phase_margin[k]:.0f} deg"
    decibel = response.gain_margins_db
    if not np.isnan(decibel).all():
        way, k = divmod(int(np.nanargmin(np.abs(decibel))), len(names))
        text += f"; smallest gain margin: joint {k + 1}, {decibel[way, k]:.1f} dB"
    return text


# --- what was run ----------------------------------------------------------------------------


def _setup(design: Design) -> list[doc.Block]:
    scenario, motion, choice = design.scenario, design.wanted, design.scenario.controller
    learned = "" if design.motion is motion else "; its flights have taught the reference"
    exact = "exact" if design.model.sdf == design.robot.sdf else "differs from the plant"
    duration = f"{motion.duration:g} s at {motion.period:g} s{learned}"
    rows = [
        (
            "robot",
            f"{design.robot.name}, {joint_count(design.robot.n)} (`{Path(scenario.robot).name}`)",
        ),
        ("motion", f"`{Path(scenario.motion).name}`, {duration}"),
        ("controller", f"`{choice.label}`: {controller_class(choice.kind).in_words(design)}"),
        ("torque feedforward", _fed(design)),
        ("its model of the robot", exact),
        ("plant", _plant(design)),
        ("drives", _drives(design)),
    ]
    columns = [
        ("effective inertia [kg m²]", ".4g", design.inertia.maximum),
        ("K_PS [N m s/rad]", ".6g", design.gains.kp),
        ("K_IS [N m/rad]", ".6g", design.gains.ki),
        ("ω_n [rad/s]", ".4g", design.omega_n),
        ("largest torque [N m]", ".4g", design.robot.motor_torque_limit),
        ("gear ratio", ".4g", design.robot.gear_ratio),
    ]
    if "position_gain" in CONTROLLERS[choice.kind].options:
        columns.insert(3, ("K_V [1/s]", ".4g", design.position_gain))
    return [
        doc.Table(["", ""], rows, look="words"),
        _by_joint(
            design, columns, "Motor side: the largest inertia along the motion, and the gains"
        ),
    ]


def _fed(design: Design) -> str:
    choice = design.scenario.controller
    gain = choice.feedforward_gain
    parts = {
        f"{choice.feedforward_in_use}{f' times {gain}' if gain else ''}": (
            choice.feedforward_in_use != "none"
        ),
        "friction at the speed of the reference": choice.friction_compensation,
        "what flights have taught": design.learned_torque is not None,
    }
    return _listed(parts, "none")


def _plant(design: Design) -> str:
    plant = design.scenario.plant
    parts = {
        f"the inertia {plant.i_eff} kg m² on the motors": plant.i_eff is not None,
        "friction": not plant.friction.is_none,
        "elastic joints": not plant.elasticity.is_rigid,
        "masses other than planned with": design.robot is not design.nominal,
        "a disturbance": design.scenario.disturbance.amplitude != 0,
    }
    joints = {
        "coupled": "all joints at once, by Drake's MultibodyPlant",
        "axis": "each axis alone, loaded as the reference motion loads it",
    }
    also = [f"with {part}" for part, is_there in parts.items() if is_there]
    return "; ".join([joints[plant.kind], *also])


def _drives(design: Design) -> str:
    drive, envelope = design.scenario.drive, design.envelope
    parts = {
        f"speed loop every {1e3 * (drive.period or 0):g} ms": drive.period is not None,
        "encoders with increments": drive.encoder_resolution is not None,
        f"torque loop of {drive.torque_bandwidth or 0:g} Hz": drive.torque_bandwidth is not None,
        "wrong torques": drive.torque_error is not None,
        f"torque-speed envelope of {envelope.source if envelope else ''}": envelope is not None,
        f"reference {1e3 * drive.reference_delay:g} ms late": drive.reference_delay > 0,
    }
    return _listed(parts, "ideal")


def _listed(parts: Mapping[str, bool], nothing: str) -> str:
    """Those that are there."""
    return "; ".join(part for part, is_there in parts.items() if is_there) or nothing


def _by_joint(
    design: Design, columns: Sequence[tuple[str, str, NDArray[Any]]], title: str = ""
) -> doc.Table:
    """A row for each joint; columns as in `by_joint`."""
    header, rows = by_joint(design.robot.joint_names, columns)
    return doc.Table([_whole_units(name) for name in header], rows, title, "wrapped")


def _whole_units(header: str) -> str:
    """With short units that no line breaks."""
    return re.sub(r"\[.{,9}\]", lambda unit: unit[0].replace(" ", "\u00a0"), header)


# --- loops -----------------------------------------------------------------------------------


def _response(design: Design) -> FrequencyResponse | InputError:
    try:
        return frequency_response(design)
    except InputError as error:  # a controller of one's own that Drake cannot linearise
        return error


def _loops(design: Design, response: FrequencyResponse | InputError) -> list[doc.Block]:
    if isinstance(response, InputError):
        return [doc.Text(f"There is no linear analysis: {response}.")]
    notes = [
        "Speed of the link over its reference, without feedforward; the loop cut at "
        f"{response.cut}, the others closed. Gain margins: how much more, or less, of its gain "
        "that joint could have; a dash where no amount matters. Each joint where its inertia is "
        "largest, at rest.",
        *(f"{clause.capitalize()}." for clause in left_out(design, response)),
    ]
    return [_by_joint(design, response.columns()), doc.Text(" ".join(notes), "soft")]


# --- the run ---------------------------------------------------------------------------------


def _tracking(run: Compared) -> list[doc.Block]:
    shown = ((METRICS[name], run.metrics[name]) for name in COMPARED)
    return [_by_joint(run.design, [(m.label, m.format, m.factor * x) for m, x in shown])]


def _over_time(run: Compared, path: Path, joints: Sequence[int]) -> list[doc.Block]:
    design, recording, n = run.design, run.recording, len(run.recording.time)
    shown = (
        f"Of {n} samples those are shown at which a line is least or largest."
        if n > MOST
        else f"All {n} samples are shown."
    )
    blocks: list[doc.Block] = [doc.Text(shown, "soft")]
    positions, others = position_panels(recording), joint_columns(recording, design)
    for k in joints:
        title = joint_title(k, design.robot.joint_names[k])
        panels = [positions[k], *others[k]]
        marked = (
            " On grey ground the motor gives less than is asked."
            if np.any(recording.saturated[:, k] > 0)
            else ""
        )
        caption = f"{title.capitalize()}: torques are motor side, all else joint side.{marked}"
        blocks += [
            doc.Heading(title.capitalize()),
            _plots(caption, [panels], path, f"joint_{k + 1}"),
        ]
    return blocks


def _over_speed(run: Compared, path: Path, joints: Sequence[int]) -> list[doc.Block]:
    caption = "Torque of the motors over their speed, motor side, at the ends of the periods."
    if run.design.scenario.plant.kind == "axis":
        caption += " On this plant the other motors' help widens the limits, which is not drawn."
    if run.design.springs is not None:
        caption += " Of elastic joints, the speed is that of the link times the gear ratio."
    columns = [[torque_over_speed(run.recording, run.design, k)] for k in joints]
    return [_plots(caption, columns, path, "torque")]


def _plots(caption: str, columns: Sequence[Sequence[Panel]], path: Path, name: str) -> Plots:
    return Plots(caption, columns, path.with_name(f"{path.stem}_{name}.png"))


# --- the pilot and the device ----------------------------------------------------------------


def _felt(run: Compared, path: Path) -> list[doc.Block]:
    design, time, head = run.design, run.recording.time, run.head
    felt, just = head.felt.multiples, Line("just felt", Look("0.2"), np.ones_like(time))
    blocks: list[doc.Block] = []
    for axis, (turn, push) in enumerate(zip(CHANNELS[:3], CHANNELS[3:], strict=True)):
        lines = [
            Line(f"error of {turn}", Look(PALETTE[3]), felt[:, axis]),
            Line(f"error of {push} force", Look(PALETTE[5]), felt[:, 3 + axis]),
            just,
        ]
        error = Panel("", "time [s]", "error / just felt", time, lines)
        caption = f"{push.capitalize()} force and {turn} of the head, in its own axes."
        columns = [[*head_panels(time, head, axis), error]]
        blocks.append(_plots(caption, columns, path, f"pilot_{turn}"))
    feels = story_of(design.scenario.motion, design.robot, design.wanted).feels
    text = (
        "The last plot of each is the error in multiples of what attentive people in silence and "
        "dark just feel: below 1 it is not felt."
    )
    wanted: list[doc.Block] = [doc.Text(f"To be felt: {feels}")] if feels else []
    return [*wanted, doc.Text(text, "soft"), *blocks]


def _in_3d(run: Compared, path: Path) -> list[doc.Block]:
    robot, scenario, shown = run.design.robot, run.design.scenario, run.recording
    story = story_of(scenario.motion, robot, run.design.motion)
    try:
        page = recorded_page(robot, shown.time, shown.q, title=scenario.name, story=story)
    except InputError as error:
        return [doc.Text(f"It is not shown: {error}.")]
    page_path = path.with_name(f"{path.stem}_3d.html")
    return [
        doc.Text("The run in 3D; drag to look from elsewhere."),
        doc.EmbeddedPage("Play", page_path, page),
    ]


def _provenance(scenario: Scenario) -> list[doc.Block]:
    text = yaml_dump_typed(scenario, schema=Scenario).rstrip()
    return [
        doc.Details("The scenario, every field of it, as YAML", [doc.Code(text)]),
        doc.Table(["", "version"], [[name, version] for name, version in versions().items()]),
    ]
