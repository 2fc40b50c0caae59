"""Sentences, tables and report of a replay."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sdt_drake.analysis.metrics import Metric
from sdt_drake.io.arrays import Array
from sdt_drake.io.files import replacing_files
from sdt_drake.io.shown import numbered
from sdt_drake.machine.diagnose import constants as c
from sdt_drake.machine.diagnose.recording import check_recording
from sdt_drake.machine.diagnose.replay import check_replay
from sdt_drake.machine.replay import (
    ALONE,
    FED,
    QUANTITIES,
    Replay,
)
from sdt_drake.run.options import in_print
from sdt_drake.show import sections as doc
from sdt_drake.show.documents import MARKDOWN, REPORT, written
from sdt_drake.show.figures.replay import replay_figure, replay_title
from sdt_drake.show.style import pictures

FIGURE, TABLE = "replay", "replay.csv"
FILES = (*pictures(FIGURE), TABLE, MARKDOWN, REPORT)
"""Names of all files of a replay."""

_SHARE = Metric("explained", "%", 100, ".1f")


def tables(replay: Replay) -> list[doc.Table]:
    """Make the tables of a replay.

    The first has the share that the simulation explains. The others have the difference of each
    quantity, with a row for each change of the simulation.
    """
    joints = numbered(replay.design.device.simulated.joint_names)
    rows = [(QUANTITIES[x].title, *_explained(replay, x)) for x in replay.measured]
    due = replay.due_to_model
    if due is not None:
        rest = (
            "controller, drives, springs" if replay.recorded.of_links else "controller and drives"
        )
        rows += [
            ("of the difference, the plant's model [%]", *_texts(_SHARE, due)),
            (f"of the difference, {rest} [%]", *_texts(_SHARE, 1 - due)),
        ]
    made = [doc.Table((f"of the mean square, {_SHARE.label}", *joints), rows)]
    for name in replay.measured:
        metric = QUANTITIES[name]
        recorded = replay.recorded_rms(name)
        rows = [("recorded", *_texts(metric, recorded))]
        for case in (case for case, course in replay.courses.items() if name in course):
            off = replay.difference(name, case)
            shown = np.where(off < c.ROUND_OFF * recorded, 0.0, off)
            rows.append((f"difference {case}", *_texts(metric, shown)))
        made.append(doc.Table((f"RMS, {metric.label}", *joints), rows))
    return made


def replay_findings(replay: Replay) -> list[str]:
    """Return the result of a replay as sentences: first the answer, then causes and notes."""
    is_beside = np.abs(replay.start).max() > 1e-6
    recorded = replay.recorded
    findings = [_explained_in_words(replay, name) for name in replay.measured]
    findings += [f"{doc.capital(str(found))}." for found in check_replay(replay)]
    findings += _of_the_reference(replay)
    if is_beside:
        offsets = " ".join(f"{x:.4f}" for x in np.degrees(replay.start))
        findings.append(
            f"The recording starts {offsets} deg away from its reference; this offset is removed."
        )
    if gaps := recorded.gaps_in_words:
        findings.append(
            f"The recording has {gaps}, filled by straight lines; differences there are not the "
            "machine's."
        )
    checked = check_recording(replay.design.device.simulated, recorded)
    findings += [f"Note: {recorded.path.name}: {note}." for note in recorded.notes]
    return findings + [f"Warning: {found}" for found in checked]


def _of_the_reference(replay: Replay) -> Iterator[str]:
    """Return sentences on the simulated loop, and on what was not recorded."""
    design, signals = replay.design, replay.recorded.signals
    replaced = design.tuning.feedforward.along is not None and design.tuning.feedforward.law is None
    yield doc.said(
        "The reference has {:g} s, sampled every {:g} ms, on the {} plant with {}{}.",
        design.reference.tracked.duration,
        1e3 * design.reference.tracked.period,
        design.scenario.plant.kind,
        in_print(design.scenario.controller.label),
        "; the recorded torque feedforward replaces the controller's own" if replaced else "",
    )
    if "tau_ff" in signals and not design.scenario.controller.takes_feedforward:
        yield (
            "The recorded torque feedforward is left out, as this controller has no input for it."
        )
    if "q" not in signals and "q_ref" not in signals:
        yield "No positions were recorded: all joints are assumed to start at the angle 0."


def _explained(replay: Replay, quantity: str) -> Sequence[str]:
    """Return the shares that the simulation explains.

    A dash stands for a negative share, and for a joint without recorded values.
    """
    share = replay.explained(quantity)
    return _texts(_SHARE, np.where(share < 0, np.nan, share))


def _explained_in_words(replay: Replay, quantity: str) -> str:
    """Return the explained shares of a quantity, and the joints that have dashes."""
    apart = replay.apart(quantity)
    shares, title = " ".join(_explained(replay, quantity)), QUANTITIES[quantity].title
    text = f"The simulation explains {shares} % of the {title}"
    if (apart > 1).any():
        times = ", ".join(f"{x:.4g}" for x in apart[apart > 1])
        text += (
            f"; nothing of joint {_joints(apart > 1)}, where the difference is {times} times the "
            "recorded value (RMS)"
        )
    if np.isnan(apart).any():
        text += f"; of joint {_joints(np.isnan(apart))} nothing was recorded"
    return f"{text}."


def _joints(where: NDArray[np.bool_]) -> str:
    """Return the joints for which a condition holds, counted from 1, as text."""
    return ", ".join(str(k + 1) for k in np.flatnonzero(where))


def write_replay(replay: Replay, folder: Path) -> Path:
    """Write figure, table and report into a folder, all or none, and return the page's path.

    Raises:
        InputError: if a file cannot be written.
    """
    explained, *differences = tables(replay)
    report = written("replay", {
        "title": replay_title(replay), "findings": doc.bullets(replay_findings(replay)),
        "explained": explained, f"{FIGURE}.png": replay_figure(replay),
        "differences": differences, "fed": FED, "alone": ALONE,
    })  # fmt: skip
    with replacing_files(folder) as new:
        replay.to_csv(new / TABLE)
        report.write(new)
    return folder / REPORT


def _texts(metric: Metric, values: Array) -> Sequence[str]:
    return [metric.text(x) for x in values.tolist()]
