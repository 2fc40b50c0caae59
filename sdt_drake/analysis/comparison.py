"""Controllers side by side on one scenario: errors, motors, and what each has to know."""

from __future__ import annotations

import copy
import csv
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sdt_drake.analysis.threads import threads
from sdt_drake.analysis.tracking import (
    HeadTracking,
    MotorUse,
    Tracking,
    motor_use,
    track,
    track_head,
)
from sdt_drake.control import FEEDFORWARDS
from sdt_drake.controllers import CONTROLLERS, Controller
from sdt_drake.design import Design
from sdt_drake.errors import InputError, checked_choice, replacing
from sdt_drake.loops import blocks_of, make_loop
from sdt_drake.pilot import has_head
from sdt_drake.scenario import ControllerChoice, Scenario
from sdt_drake.simulate import Recording, simulate

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Compared:
    """One controller of a comparison.

    Attributes:
        label: as in the comparison, "p_pi+id".
        design: what was run.
        recording: of the run.
        tracking: how well the joints follow.
        motors: what it takes of the motors.
        blocks: number of Drake systems in the loop, those in sub-diagrams one by one.
        needs: what must be known to commission it.
    """

    label: str
    design: Design
    recording: Recording
    tracking: Tracking
    motors: MotorUse
    blocks: int
    needs: tuple[str, ...]

    @cached_property
    def head(self) -> HeadTracking | None:
        """How well the pilot's head follows; None for a robot without one."""
        robot = self.design.robot
        return track_head(self.recording, robot) if has_head(robot) else None


def compare(design: Design, labels: Sequence[str]) -> list[Compared]:
    """Run the scenario of a design with other controllers; everything else stays.

    Args:
        design: gives scenario, robot and motion.
        labels: kinds of controllers, with a feedforward where the kind leaves it open: "pi",
            "p_pi+id".

    Raises:
        InputError: for a label that is unknown or twice there, or a kind that the plant rules out.
    """
    check_labels(labels)
    designs = [design_with(design, label) for label in labels]
    # One at a time where Python runs in the loop: two would wait for each other.
    online = design.scenario.inverse_dynamics == "online"
    with threads(1 if online else 2) as pool:
        return list(pool.map(run_of, labels, designs))


def design_with(design: Design, label: str) -> Design:
    """The design of the same scenario with another controller.

    Raises:
        InputError: for an unknown label, or a kind that the plant rules out.
    """
    return design.variant(with_controller(design.scenario, label))


def with_controller(scenario: Scenario, label: str) -> Scenario:
    """A copy with another controller; options that it would not use are left out.

    Raises:
        InputError: for an unknown label.
    """
    kind, feedforward = _parsed(label, "controllers")
    scenario = copy.deepcopy(scenario)
    choice = scenario.controller
    choice.kind = kind
    choice.feedforward = feedforward
    for name in set(Controller.OPTIONS) - set(CONTROLLERS[kind].options):
        setattr(choice, name, getattr(ControllerChoice(), name))
    if choice.feedforward_in_use == "none":
        choice.feedforward_gain = None
    return scenario


def check_labels(labels: Sequence[str], where: str = "controllers") -> None:
    """Refuse labels that name no controller, or one twice.

    Raises:
        InputError: naming `where` and what would be right.
    """
    if not labels:
        raise InputError(f"{where}: none given, expected some of {', '.join(CONTROLLERS)}")
    seen = set()
    for label in labels:
        kind, feedforward = _parsed(label, where)
        if (kind, feedforward or "none") in seen:
            raise InputError(f"{where}: '{label}' is given twice")
        seen.add((kind, feedforward or "none"))


def _parsed(label: str, where: str) -> tuple[str, str | None]:
    """Kind and feedforward of "p_pi+id"; no feedforward where none is given."""
    kind, plus, feedforward = label.partition("+")
    checked_choice(kind, tuple(CONTROLLERS), where)
    if not plus:
        return kind, None
    if "feedforward" not in CONTROLLERS[kind].options:
        raise InputError(f"{where}: '{label}', but {kind} has its own feedforward")
    return kind, checked_choice(feedforward, FEEDFORWARDS, f"{where}: feedforward of {kind}")


def run_of(label: str, design: Design, recording: Recording | None = None) -> Compared:
    """One controller of a comparison; run here if there is no recording of it yet."""
    loop = make_loop(design)
    if recording is None:
        recording = simulate(design, loop)
    choice = design.scenario.controller
    return Compared(
        label=label,
        design=design,
        recording=recording,
        tracking=track(recording, design.motion),
        motors=motor_use(recording, design.robot),
        blocks=len(list(blocks_of(loop))),
        needs=CONTROLLERS[choice.kind].needs_with(choice.feedforward_in_use),
    )


_COLUMNS = (
    ("largest error [rad/s]", ".4f", lambda c: c.tracking.max_abs_speed_error),
    ("RMS [rad/s]", ".5f", lambda c: c.tracking.rms_speed_error),
    ("constant speed [rad/s]", ".4f", lambda c: c.tracking.constant_speed_error),
    ("position [deg]", ".3f", lambda c: np.degrees(c.tracking.max_abs_position_error)),
    ("torque RMS [%]", ".1f", lambda c: 100 * c.motors.rms_share),
    ("torque peak [%]", ".1f", lambda c: 100 * c.motors.peak_share),
    ("saturated [%]", ".2f", lambda c: 100 * c.tracking.saturated_fraction),
)
"""Of the table: header, format, and values of shape (n,) of one controller."""


_FELT = (
    ("felt [% of time]", ".1f", lambda felt: 100 * felt.share),
    ("largest rotation", ".2f", lambda felt: felt.worst_rotation[1]),
    ("rotation about", "", lambda felt: felt.worst_rotation[0]),
    ("largest force", ".2f", lambda felt: felt.worst_force[1]),
    ("force along", "", lambda felt: felt.worst_force[0]),
)
"""What the pilot could feel of the error: header, format, and value of one controller; the largest
as multiples of what is just felt."""


def felt_rows(compared: Sequence[Compared]) -> tuple[list[str], list[list[str]]]:
    """Header and rows of the second table, a row for each controller; none without a head."""
    header = ["controller", *(name for name, _, _ in _FELT)]
    rows = [
        [c.label, *(format(value(c.head.felt), spec) for _, spec, value in _FELT)]
        for c in compared
        if c.head is not None
    ]
    return header, rows


def comparison_rows(compared: Sequence[Compared]) -> tuple[list[str], list[list[str]]]:
    """Header and rows of the table: a row for each controller and joint."""
    header = ["controller", "joint", *(name for name, _, _ in _COLUMNS)]
    rows = []
    for c in compared:
        values = [(value(c), spec) for _, spec, value in _COLUMNS]
        for k, name in enumerate(c.design.robot.joint_names):
            cells = [format(v[k], spec).replace("nan", "–") for v, spec in values]
            rows.append([c.label if k == 0 else "", f"{k + 1} {name}", *cells])
    return header, rows


def write_comparison(compared: Sequence[Compared], path: str | Path) -> None:
    """Write the tables as CSV: a row for each controller and joint, full precision.

    Raises:
        InputError: if the file cannot be written.
    """
    with replacing(Path(path)) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        has_heads = all(c.head is not None for c in compared)
        felt_columns = _FELT if has_heads else ()
        header = ["controller", "joint", *(name for name, _, _ in _COLUMNS), "blocks", "needs"]
        table.writerow([*header, *(name for name, _, _ in felt_columns)])
        for c in compared:
            values = [value(c) for _, _, value in _COLUMNS]
            felt = [value(c.head.felt) for _, _, value in felt_columns]
            for k in range(c.design.robot.n):
                cells = ["" if np.isnan(v[k]) else repr(float(v[k])) for v in values]
                table.writerow([c.label, k + 1, *cells, c.blocks, ", ".join(c.needs), *felt])
