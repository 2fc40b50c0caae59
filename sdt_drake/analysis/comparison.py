"""Comparison of controllers on one scenario: errors, motor torques, and required model data."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from sdt_drake.analysis.metrics import COMPARED, METRICS
from sdt_drake.analysis.tracking import (
    HeadTracking,
    MotorUse,
    Tracking,
    motor_use,
    track,
    track_head,
)
from sdt_drake.io.arguments import one_of
from sdt_drake.io.arrays import Array
from sdt_drake.io.errors import InputError, needing, one_line
from sdt_drake.io.files import write_csv
from sdt_drake.io.progress import with_progress
from sdt_drake.io.shown import DataFrame, Figure, Shown, Summary, higher
from sdt_drake.pilot.head import has_head
from sdt_drake.run.controllers import CONTROLLERS, ChosenFeedforward
from sdt_drake.run.design import Design, as_design
from sdt_drake.run.options import canonical
from sdt_drake.run.recording import Recording
from sdt_drake.run.scenario import Scenario
from sdt_drake.run.simulate import simulate
from sdt_drake.run.threads import threads
from sdt_drake.systems.gains import FEEDFORWARDS


@dataclass(frozen=True, eq=False)
class Compared:
    """The run of one controller and its metrics."""

    label: str
    """Label of the controller, e.g. "p_pi+id"."""
    design: Design
    """Design of the run."""
    recording: Recording
    """Recording of the run."""

    @cached_property
    def tracking(self) -> Tracking:
        """Tracking errors of the joints."""
        return track(self.recording)

    @cached_property
    def motors(self) -> MotorUse:
        """Motor torques of the run."""
        return motor_use(self.recording, self.design.device.simulated)

    @cached_property
    def head(self) -> HeadTracking:
        """Tracking errors of the pilot's head.

        Raises:
            InputError: the robot has no head.
        """
        return track_head(self.recording, self.design.device.simulated)

    @cached_property
    def metrics(self) -> dict[str, Array]:
        """Values of METRICS for each joint by name, in computed units (SI), shape (n,)."""
        return asdict(self.tracking) | {
            "rms_torque_share": self.motors.rms_share,
            "peak_torque_share": self.motors.peak_share,
        }

    @property
    def needs(self) -> tuple[str, ...]:
        """Model data that the controller requires for commissioning."""
        return self.design.scenario.controller.all_needs


class Comparison(list[Compared], Shown):
    """Runs of one scenario with several controllers, in the order of the labels."""

    def summary(self) -> Summary:
        scenario = self[0].design.scenario
        return Summary(
            f"of {len(self)} controllers on {scenario.name}, {scenario.plant.kind} plant",
            *comparison_rows(self),
            keys=2,
        )

    __repr__ = Shown.__repr__  # not that of a list

    def plot(self, *, over_time: bool = False) -> Figure:
        """Return a figure of errors and torques by controller, side by side.

        Args:
            over_time: draw speed errors over each other, as in the paper's Figure 8.
        """
        title = f"Comparison {self.summary().title}"
        if over_time:
            return higher("show.figures.compared:overlays")(title, self)
        return higher("show.figures.compared:comparison")(title, self)

    def page(self, path: str | Path) -> None:
        """Write a page (.html) with errors and torques over time, to zoom, and both tables.

        Raises:
            InputError: the file cannot be written.
        """
        higher("show.reports.compare:write_comparison_page")(self, Path(path))

    def to_pandas(self) -> DataFrame:
        """Return METRICS in their computed units (SI), a row for each controller and joint.

        Raises:
            InputError: pandas is not installed.
        """
        with needing("to_pandas needs pandas", "sdt_drake[exchange]"):
            import pandas as pd
        frames = {
            c.label: pd.DataFrame(c.metrics, index=c.design.device.simulated.joint_names)
            for c in self
        }
        return pd.concat(frames, names=["controller", "joint"])


def compare(design: Design | Scenario, labels: Sequence[str]) -> Comparison:
    """Run the scenario of a design with each of several controllers.

    Robot, motion, a learned reference and all other settings stay the same.

        >>> import sdt_drake as sdt
        >>> scenario = sdt.load("package://sdt/scenarios/coupled_pi.yaml")
        >>> short = sdt.Motion.from_speeds(0.005, [0] * 4, [[0.001 * i] * 4 for i in range(20)])
        >>> compared = sdt.compare(sdt.design(scenario, motion=short), ["pi", "p_pi+id"])
        >>> [f"{run.label}: {run.tracking.max_abs_speed_error[1]:.4f} rad/s" for run in compared]
        ['pi: 0.0111 rad/s', 'p_pi+id: 0.0005 rad/s']

    Args:
        design: the design, or a scenario.
        labels: kinds of controllers, with "+" and a feedforward where the kind takes that option:
            "pi", "p_pi+id".

    Raises:
        InputError: a label is unknown or repeated, the plant excludes its kind, or the design has
            another feedforward than its controller's own.
    """
    check_labels(labels)
    design = as_design(design)
    if design.feedforward_override is not None:
        text = "has another torque feedforward, which replaces those of the compared controllers"
        raise InputError(f"{text}; expected a design with its controller's own", place="design")
    labels = list(map(canonical, labels))
    designs = [design_with(design, label) for label in labels]
    # One at a time where Python runs in the loop: two would wait for each other.
    online = design.scenario.inverse_dynamics == "online"
    with threads(1 if online else 2) as pool:
        return Comparison(with_progress(pool.map(run_of, labels, designs), len(labels)))


def design_with(design: Design, label: str) -> Design:
    """Return the design of the same scenario with another controller.

    Raises:
        InputError: the label is unknown, or the plant excludes its kind.
    """
    return design.variant(with_controller(design.scenario, label))


def with_controller(scenario: Scenario, label: str) -> Scenario:
    """Return a copy of a scenario with another controller, without options that it does not take.

    Raises:
        InputError: the label is unknown.
    """
    return scenario.changed(controller_changes(label))


def controller_changes(label: str) -> dict[str, Any]:
    """Return the fields of a scenario that choose a controller, without options of other kinds.

    Raises:
        InputError: the label is unknown.
    """
    kind, feedforward = _parsed(label, "controllers")
    options = CONTROLLERS[kind]
    taken = {field.name for field in fields(options)}
    known = {x.name: x.default for c in CONTROLLERS.values() for x in fields(c)}
    changes = {name: default for name, default in known.items() if name not in taken}
    changes |= {"kind": kind, "feedforward": feedforward}
    if (feedforward or options().feedforward_in_use) == "none":
        changes["feedforward_gain"] = None
    return {f"controller.{name}": value for name, value in changes.items()}


def check_labels(labels: Sequence[str], where: str = "controllers") -> None:
    """Check that each label names a controller and none is repeated.

    Raises:
        InputError: `where`, the label that was found, and the accepted ones.
    """
    if isinstance(labels, str):
        raise InputError(f"'{labels}', expected a list of labels: ['{labels}']", place=where)
    if labels and not (isinstance(labels, Sequence) and all(isinstance(x, str) for x in labels)):
        raise InputError(
            f"{one_line(labels)}, expected a list of labels: ['pi', 'pi_id']", place=where
        )
    if not labels:
        raise InputError(
            f"none given, expected at least one of {', '.join(CONTROLLERS)}", place=where
        )
    seen = set()
    for label in labels:
        kind, feedforward = _parsed(label, where)
        if (kind, feedforward or "none") in seen:
            raise InputError(f"'{label}' is given twice", place=where)
        seen.add((kind, feedforward or "none"))


def _parsed(label: str, where: str) -> tuple[str, str | None]:
    """Return kind and feedforward of a label "p_pi+id"; the feedforward is None without "+"."""
    kind, plus, feedforward = canonical(label).partition("+")
    one_of(kind, where, tuple(CONTROLLERS))
    if not plus:
        return kind, None
    if not issubclass(CONTROLLERS[kind], ChosenFeedforward):
        raise InputError(f"'{label}', but {kind} has its own feedforward", place=where)
    return kind, one_of(feedforward, f"{where}: feedforward of {kind}", FEEDFORWARDS)


def run_of(label: str, design: Design) -> Compared:
    """Run a design and return its entry of a comparison."""
    return Compared(label, design, simulate(design))


# --- tables ----------------------------------------------------------------------------------

_HEADER = [METRICS[name].column for name in COMPARED]
_FELT = [
    METRICS["felt_share"].column,
    "largest rotation", "rotation about", "largest force", "force along",
]  # fmt: skip


def comparison_rows(compared: Sequence[Compared]) -> tuple[list[str], list[list[str]]]:
    """Return header and rows of the table of errors: a row for each controller and joint."""
    rows = []
    for c in compared:
        for k, name in enumerate(c.design.device.simulated.joint_names):
            cells = [METRICS[metric].text(c.metrics[metric][k]) for metric in COMPARED]
            rows.append([c.label if k == 0 else "", f"{k + 1} {name}", *cells])
    return ["controller", "joint", *_HEADER], rows


def felt_rows(compared: Sequence[Compared]) -> tuple[list[str], list[list[str]]]:
    """Return header and rows of the table of felt errors.

    The largest errors are multiples of their threshold, about and along the axes of the head. Only
    robots with a head have a row.
    """
    rows = []
    for c in compared:
        if has_head(c.design.device.simulated):
            share, rotation, about, force, along = _felt(c)
            rows.append([c.label, f"{share:.1f}", f"{rotation:.2f}", about, f"{force:.2f}", along])
    return ["controller", *_FELT], rows


def _felt(compared: Compared) -> tuple[float, float, str, float, str]:
    """Return the values of the columns _FELT."""
    felt = compared.head.felt
    (about, rotation), (along, force) = felt.worst_rotation, felt.worst_force
    return 100 * felt.share, rotation, about, force, along


def write_comparison(compared: Sequence[Compared], path: str | Path) -> None:
    """Write both tables as one CSV: a row for each controller and joint, full precision.

    Raises:
        InputError: the file cannot be written.
    """
    has_heads = all(has_head(c.design.device.simulated) for c in compared)
    felt_header = _FELT if has_heads else []
    rows = []
    for c in compared:
        felt = _felt(c) if has_heads else ()
        for k in range(c.design.device.simulated.n):
            values = [METRICS[name].factor * c.metrics[name][k] for name in COMPARED]
            cells = ["" if np.isnan(value) else repr(float(value)) for value in values]
            rows.append([c.label, k + 1, *cells, ", ".join(c.needs), *felt])
    header = ["controller", "joint", *_HEADER, "needs", *felt_header]
    write_csv(Path(path), header, rows)
