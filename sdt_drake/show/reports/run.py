"""The report of one run: the answer first, then all details."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sdt_drake.analysis.comparison import Compared
from sdt_drake.analysis.frequency_response import FrequencyResponse, frequency_response, left_out
from sdt_drake.analysis.metrics import COMPARED, METRICS, plain_number
from sdt_drake.analysis.tracking import stops_passed
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError
from sdt_drake.io.files import write_text
from sdt_drake.io.shown import by_joint, joint_count
from sdt_drake.io.versions import versions
from sdt_drake.io.yaml_files import yaml_text
from sdt_drake.motion import story_of
from sdt_drake.pilot.head import has_head
from sdt_drake.pilot.illusions import feel, illusions, intended
from sdt_drake.pilot.orientation import CAUTION
from sdt_drake.pilot.thresholds import CHANNELS
from sdt_drake.run.controllers import controller_class
from sdt_drake.run.design import Design
from sdt_drake.run.kinds import CONTROLLERS
from sdt_drake.run.simulate import Recording
from sdt_drake.show.documents import Report, Table, render
from sdt_drake.show.figures.pilot import head_panels
from sdt_drake.show.figures.scope import joint_columns, position_panels, torque_over_speed
from sdt_drake.show.panels import MAX_SAMPLES, Line, Panel, Plots
from sdt_drake.show.style import PALETTE, Look, joint_title
from sdt_drake.show.view3d.scene import FELT_MODEL
from sdt_drake.show.view3d.viewer import recorded_page


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
        write_text(path, report.page())
        return
    write_text(path, report.markdown)
    for name, file in report.attached.items():
        if isinstance(file, Plots):
            file.save_picture(path.with_name(name))
        else:
            write_text(path.with_name(name), file)


def run_report(design: Design, recording: Recording, path: Path, joints: Sequence[int]) -> Report:
    """Make the report of a run; arguments as in `write_run_report`."""
    scenario, run = design.scenario, Compared(design.scenario.controller.label, design, recording)
    attached: dict[str, Plots | str] = {}

    def attach(name: str, file: Plots | str) -> str:
        attached[f"{path.stem}_{name}"] = file
        return f"{path.stem}_{name}"

    tracked = [(METRICS[name], run.metrics[name]) for name in COMPARED]
    columns = [[torque_over_speed(recording, design, k)] for k in joints]
    values = {
        "title": scenario.summary().title,
        "design": design,
        "scenario": scenario,
        "robot": design.robot,
        "robot_file": Path(scenario.robot),
        "motion": Path(scenario.motion),
        "joint_count": joint_count(design.robot.n),
        "controller_in_words": controller_class(scenario.controller.kind).in_words(design),
        "gains": _gains(design),
        "tracking": _table(design, [(m.label, m.format, m.factor * x) for m, x in tracked]),
        "samples": len(recording.time),
        "max_samples": MAX_SAMPLES,
        "joints": [
            {**joint, "file": attach(f"joint_{k + 1}.png", Plots([panels]))}
            for k, joint, panels in _over_time(run, joints)
        ],
        "torque_file": attach("torque.png", Plots(columns)),
        "yaml": yaml_text(scenario).rstrip(),
        "version_table": Table(["", "version"], list(versions().items())),
    }
    values |= _answer(run) | _loops(design)
    if has_head(design.robot):
        values |= _pilot(run)
        values["axes"] = [
            (turn, push, attach(f"pilot_{turn}.png", plots)) for turn, push, plots in _felt(run)
        ]
    story = story_of(scenario.motion, design.robot, design.motion)
    try:
        page = recorded_page(
            design.robot, recording.time, recording.q, title=scenario.name, story=story
        )
        values |= {"not_shown": "", "page_file": attach("3d.html", page)}
    except InputError as error:
        values["not_shown"] = str(error)
    return Report(render("run.md.j2", **values), path.parent, attached)


# --- numbers ---------------------------------------------------------------------------------


def _answer(run: Compared) -> dict[str, object]:
    """Return the values of the answer: the largest errors, where they are, and saturation."""
    names, recording, tracking = run.design.robot.joint_names, run.recording, run.tracking

    def worst(largest: Array, errors: Array) -> tuple[int, dict[str, Any]]:
        k = int(np.nanargmax(largest))
        time = recording.time[np.abs(errors[:, k]).argmax()]
        return k, {"joint": joint_title(k, names[k]), "error": largest[k], "time": time}

    k, speed = worst(tracking.max_abs_speed_error, recording.speed_error)
    planned = np.abs(recording.v_ref[:, k]).max()
    position_errors = np.degrees(tracking.max_abs_position_error)
    used = int(np.nanargmax(run.motors.peak_share))
    return {
        "speed": {**speed, "share": speed["error"] / planned if planned > 0 else 0},
        "position": worst(position_errors, recording.position_error)[1],
        "used": {"joint": joint_title(used, names[used]), "share": run.motors.peak_share[used]},
        "saturated": [
            f"joint {i} {plain_number(100 * share)} % of the time"
            for i, share in enumerate(tracking.saturated_fraction, 1)
            if share
        ],
        "head": run.head if has_head(run.design.robot) else None,
        "stops": stops_passed(recording, names),
    }


def _gains(design: Design) -> Table:
    columns = [
        ("effective inertia [kg m²]", ".4g", design.inertia.maximum),
        ("K_PS [N m s/rad]", ".6g", design.gains.kp),
        ("K_IS [N m/rad]", ".6g", design.gains.ki),
        ("ω_n [rad/s]", ".4g", design.omega_n),
        ("largest torque [N m]", ".4g", design.robot.motor_torque_limit),
        ("gear ratio", ".4g", design.robot.gear_ratio),
    ]
    if "position_gain" in CONTROLLERS[design.scenario.controller.kind].options:
        columns.insert(3, ("K_V [1/s]", ".4g", design.position_gain))
    return _table(
        design, columns, "Motor side: the largest inertia along the motion, and the gains"
    )


def _table(
    design: Design, columns: Sequence[tuple[str, str, NDArray[Any]]], title: str = ""
) -> Table:
    """Make a table with a row for each joint; columns as in `by_joint`."""
    return Table(*by_joint(design.robot.joint_names, columns), title)


def _loops(design: Design) -> dict[str, object]:
    """Return stability, margins and linear analysis of the loops."""
    try:
        response = frequency_response(design)
    except InputError as error:  # a user's controller that Drake cannot linearise
        return {"response": str(error), "unstable": [], "margins": None}
    names = enumerate(design.robot.joint_names)
    return {
        "response": response,
        "loops": _table(design, response.columns()),
        "left_out": left_out(design, response),
        "unstable": [joint_title(k, name) for k, name in names if not response.stable[k]],
        "margins": _margins(response),
    }


def _margins(response: FrequencyResponse) -> Mapping[str, tuple[int, float] | None]:
    """Return joint and value of each smallest margin; None if all are unlimited."""

    def smallest(values: Array) -> tuple[int, float] | None:
        if np.isnan(values).all():
            return None
        place = int(np.nanargmin(np.abs(values)))
        return place % values.shape[-1] + 1, float(values.flat[place])

    return {
        "damping": (int(response.damping.argmin()) + 1, float(response.damping.min())),
        "phase": smallest(response.phase_margin),
        "gain": smallest(response.gain_margins_db),
    }


# --- plots -----------------------------------------------------------------------------------


def _over_time(
    run: Compared, joints: Sequence[int]
) -> list[tuple[int, dict[str, object], list[Panel]]]:
    """Return each joint with its title, if it saturates, and its panels."""
    design, recording = run.design, run.recording
    positions, others = position_panels(recording), joint_columns(recording, design)
    return [
        (
            k,
            {
                "title": joint_title(k, design.robot.joint_names[k]).capitalize(),
                "marked": bool(np.any(recording.saturated[:, k] > 0)),
            },
            [positions[k], *others[k]],
        )
        for k in joints
    ]


def _pilot(run: Compared) -> dict[str, object]:
    """Return the intended feeling of the motion, and the predicted illusions."""
    design, head = run.design, run.head.achieved
    story = story_of(design.scenario.motion, design.robot, design.wanted)
    predicted, found, not_predicted = "", [], ""
    try:
        felt = feel(head, design.motion.period, FELT_MODEL)
        found = [str(one) for one in illusions(felt, head)]
        if story.illusion:
            meant = intended(design.scenario.name, story.illusion, head, {FELT_MODEL: felt})
            predicted = meant.sentence(FELT_MODEL)
    except InputError as error:
        not_predicted = str(error)
    return {
        "feels": story.feels,
        "predicted": predicted,
        "illusions": found,
        "not_predicted": not_predicted,
        "felt_by": FELT_MODEL,
        "caution": CAUTION,
    }


def _felt(run: Compared) -> list[tuple[str, str, Plots]]:
    """Return rotation and force of each axis of the head by name, and their plots."""
    time, head, felt = run.recording.time, run.head, run.head.felt.multiples
    just = Line("threshold: just felt", Look("0.2"), np.ones_like(time))
    shown = []
    for axis, (turn, push) in enumerate(zip(CHANNELS[:3], CHANNELS[3:], strict=True)):
        lines = [
            Line(f"error of {turn}", Look(PALETTE[3]), felt[:, axis]),
            Line(f"error of {push} force", Look(PALETTE[5]), felt[:, 3 + axis]),
            just,
        ]
        error = Panel("", "time [s]", "error / threshold", time, lines)
        shown.append((turn, push, Plots([[*head_panels(time, head, axis), error]])))
    return shown
