"""A replay in words, tables and a figure; as a page, and on the command line."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sdt_drake.analysis.metrics import Metric
from sdt_drake.io.arrays import Array
from sdt_drake.io.files import replacing_files
from sdt_drake.io.shown import listed, numbered
from sdt_drake.machine.recordings import check_recording
from sdt_drake.machine.replay import (
    ALONE,
    EXPLAINED_SHARE,
    FED,
    FEEDFORWARD,
    QUANTITIES,
    ROUND_OFF,
    UNFED,
    Replay,
)
from sdt_drake.show import documents as doc
from sdt_drake.show.figures.replay import replay_figure, replay_title
from sdt_drake.show.style import pictures, save_both

FIGURE, TABLE = "replay", "replay.csv"
FILES = (*pictures(FIGURE), TABLE, doc.MARKDOWN, doc.REPORT)
"""Files of a replay."""

_SHARE = Metric("explained", "%", 100, ".1f")


def tables(replay: Replay) -> list[doc.Table]:
    """What the simulation explains, and for each quantity how far it is off, by what is changed."""
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
            shown = np.where(off < ROUND_OFF * recorded, 0.0, off)
            rows.append((f"difference {case}", *_texts(metric, shown)))
        made.append(doc.Table((f"RMS, {metric.label}", *joints), rows))
    return made


def replay_findings(replay: Replay) -> list[str]:
    """What the numbers of a replay say, a sentence each."""
    wrong: list[int] = []
    if ALONE in replay.courses:
        off = replay.difference("torque", ALONE) > replay.recorded_rms("torque")
        unexplained = replay.explained("torque") < EXPLAINED_SHARE  # nor of joints without a torque
        wrong = _joints(off & unexplained)
    is_beside = np.abs(replay.start).max() > 1e-6
    recorded = replay.recorded
    said = doc.bullets(
        "replay_findings.md.j2",
        replay=replay,
        offsets=[f"{x:.4f}" for x in np.degrees(replay.start)] if is_beside else [],
        explained=[_explained_in_words(replay, name) for name in replay.measured],
        wrong=wrong,
        better=[
            _compared(replay, name, case, joints)
            for name in replay.measured
            for case, joints in replay.better(name).items()
        ],
    )
    checked = check_recording(replay.design.robot, recorded)
    return said + [f"Warning: {recorded.path.name}: {found}" for found in checked]


def _compared(
    replay: Replay, quantity: str, case: str, joints: NDArray[np.bool_]
) -> dict[str, str]:
    """Joints of which a case explains more, how much, and what the scenario as it is does."""
    share, own = (
        np.where(x < 0, np.nan, x)[joints]
        for x in (replay.explained(quantity, case), replay.explained(quantity))
    )
    return {
        "title": QUANTITIES[quantity].title,
        "case": f"The {case}" if case == FEEDFORWARD else f"The simulation {case}",
        "joints": listed(list(map(str, _joints(joints)))),
        "share": " ".join(_texts(_SHARE, share)),
        "own": " ".join(_texts(_SHARE, own)),
        "why": _WHY[case],
    }


_WHY = {
    FEEDFORWARD: "Links, friction or payload of the scenario are not those of the machine: "
    "sdt-drake identify finds them.",
    UNFED: "The machine does not add it as this controller does, or its unit or side is another "
    "(torque_factor, --side).",
    "without friction": "Friction of the scenario is not that of the machine: "
    "sdt-drake identify --only friction finds it.",
    "with rigid joints": "Springs of the scenario are not those of the machine.",
    "with ideal drives": "Drives of the scenario are not those of the machine.",
    "with the nominal links": "The deviation of the scenario is not that of the machine.",
}
"""What it means that a case explains more than the scenario as it is."""


def _explained(replay: Replay, quantity: str) -> Sequence[str]:
    """Shares that the simulation explains; a dash where it is worse than none, or there is nothing
    to explain."""
    share = replay.explained(quantity)
    return _texts(_SHARE, np.where(share < 0, np.nan, share))


def _explained_in_words(replay: Replay, quantity: str) -> dict[str, object]:
    """The same, with the joints that have dashes."""
    apart = replay.apart(quantity)
    return {
        "title": QUANTITIES[quantity].title,
        "shares": _explained(replay, quantity),
        "worse": _joints(apart > 1),
        "times": [f"{x:.4g}" for x in apart[apart > 1]],
        "still": _joints(np.isnan(apart)),
    }


def _joints(where: NDArray[np.bool_]) -> list[int]:
    """Those where this holds, from 1."""
    return [k + 1 for k in np.flatnonzero(where).tolist()]


def write_replay(replay: Replay, folder: Path) -> Path:
    """Write figure, table and report into a folder, all or none; the path of the page.

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
