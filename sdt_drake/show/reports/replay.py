"""Sentences, tables and report of a replay."""

from __future__ import annotations

from collections.abc import Sequence
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
from sdt_drake.show import documents as doc
from sdt_drake.show.figures.replay import replay_figure, replay_title
from sdt_drake.show.style import pictures, save_both

FIGURE, TABLE = "replay", "replay.csv"
FILES = (*pictures(FIGURE), TABLE, doc.MARKDOWN, doc.REPORT)
"""Names of all files of a replay."""

_SHARE = Metric("explained", "%", 100, ".1f")


def tables(replay: Replay) -> list[doc.Table]:
    """Make the tables of a replay.

    The first has the share that the simulation explains. The others have the difference of each
    quantity, with a row for each change of the simulation.
    """
    joints = numbered(replay.design.robot.joint_names)
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
    findings = doc.bullets(
        "replay_findings.md.j2",
        replay=replay,
        offsets=[f"{x:.4f}" for x in np.degrees(replay.start)] if is_beside else [],
        explained=[_explained_in_words(replay, name) for name in replay.measured],
        checked=list(check_replay(replay)),
    )
    checked = check_recording(replay.design.robot, recorded)
    findings += [f"Note: {recorded.path.name}: {note}." for note in recorded.notes]
    return findings + [f"Warning: {found}" for found in checked]


def _explained(replay: Replay, quantity: str) -> Sequence[str]:
    """Return the shares that the simulation explains.

    A dash stands for a negative share, and for a joint without recorded values.
    """
    share = replay.explained(quantity)
    return _texts(_SHARE, np.where(share < 0, np.nan, share))


def _explained_in_words(replay: Replay, quantity: str) -> dict[str, object]:
    """Return the explained shares of a quantity, and the joints that have dashes."""
    apart = replay.apart(quantity)
    return {
        "title": QUANTITIES[quantity].title,
        "shares": _explained(replay, quantity),
        "worse": _joints(apart > 1),
        "times": [f"{x:.4g}" for x in apart[apart > 1]],
        "still": _joints(np.isnan(apart)),
    }


def _joints(where: NDArray[np.bool_]) -> list[int]:
    """Return the joints for which a condition holds, counted from 1."""
    return [k + 1 for k in np.flatnonzero(where).tolist()]


def write_replay(replay: Replay, folder: Path) -> Path:
    """Write figure, table and report into a folder, all or none, and return the page's path.

    Raises:
        InputError: if a file cannot be written.
    """
    explained, *differences = tables(replay)
    text = doc.render(
        "replay.md.j2",
        title=replay_title(replay),
        findings=replay_findings(replay),
        explained=explained,
        differences=differences,
        fed=FED,
        alone=ALONE,
    )
    with replacing_files(folder) as new:
        save_both(replay_figure(replay), new / FIGURE)
        replay.to_csv(new / TABLE)
        doc.Report(text, new).write()
    return folder / doc.REPORT


def _texts(metric: Metric, values: Array) -> Sequence[str]:
    return [metric.text(x) for x in values.tolist()]
