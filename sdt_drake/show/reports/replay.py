"""A replay in words, tables and a figure; as a page, and on the command line."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sdt_drake.analysis.metrics import Metric
from sdt_drake.io.arrays import Array
from sdt_drake.io.files import replacing_files
from sdt_drake.machine.replay import ALONE, ENOUGH, FED, QUANTITIES, ROUND_OFF, Replay
from sdt_drake.show import documents as doc
from sdt_drake.show.figures.replay import replay_figure, replay_title
from sdt_drake.show.style import pictures, save_both
from sdt_drake.show.template import from_template
from sdt_drake.show.texts import page_text

FIGURE, TABLE = "replay", "replay.csv"
FILES = (*pictures(FIGURE), TABLE, doc.MARKDOWN, doc.REPORT)
"""Files of a replay."""

_SHARE = Metric("explained", "%", 100, ".1f")


def tables(replay: Replay) -> list[doc.Table]:
    """What the simulation explains, and for each quantity how far it is off, by what is changed."""
    rows = [(QUANTITIES[x].title, _explained(replay, x)) for x in replay.measured]
    due = replay.due_to_model
    if due is not None:
        rest = (
            "controller, drives, springs" if replay.recorded.of_links else "controller and drives"
        )
        rows += [
            ("of the difference, the plant's model [%]", _texts(_SHARE, due)),
            (f"of the difference, {rest} [%]", _texts(_SHARE, 1 - due)),
        ]
    made = [doc.Table(("of the mean square", _SHARE.label), rows)]
    for name in replay.measured:
        metric = QUANTITIES[name]
        recorded = replay.recorded_rms(name)
        rows = [("recorded", _texts(metric, recorded))]
        for case in (case for case, course in replay.courses.items() if name in course):
            off = replay.difference(name, case)
            shown = np.where(off < ROUND_OFF * recorded, 0.0, off)
            rows.append((f"difference {case}", _texts(metric, shown)))
        made.append(doc.Table(("RMS", metric.label), rows))
    return made


def replay_findings(replay: Replay) -> list[str]:
    """What the numbers of a replay say, a sentence each."""
    design, said = replay.design, []
    scenario, motion = design.scenario, design.motion
    said.append(
        f"{motion.duration:g} s of reference, every {1e3 * motion.period:g} ms, on the "
        f"{scenario.plant.kind} plant with `{scenario.controller.label}`"
        + (
            ", and the recorded torque feedforward in place of its own."
            if design.tau_ff is not None and design.feedforward is None
            else "."
        )
    )
    if "tau_ff" in replay.recorded.signals and not design.scenario.controller.takes_feedforward:
        said.append("This controller has no place for the recorded torque feedforward: left out.")
    if not {"q", "q_ref"} & set(replay.recorded.signals):
        said.append("No positions were recorded: all joints are taken to start at the angle 0.")
    if np.abs(replay.start).max() > 1e-6:
        offsets = " ".join(f"{x:.4f}" for x in np.degrees(replay.start))
        said.append(f"The recording starts {offsets} deg beside its reference; that is left out.")
    if gaps := replay.recorded.gaps_in_words:
        said.append(
            f"The recording has {gaps}: straight lines are in their place, and what differs there "
            "is not the machine's."
        )
    for name in replay.measured:
        said.append(_explained_in_words(replay, name))
    if ALONE in replay.courses:
        off = replay.difference("torque", ALONE) > replay.recorded_rms("torque")
        unexplained = replay.explained("torque") < ENOUGH  # nor of joints without a torque
        wrong = [str(k + 1) for k in np.flatnonzero(off & unexplained)]
        if wrong:
            said.append(
                f"On the recorded motion the controller would ask joint {', '.join(wrong)} for a "
                "torque that is off by more than all that was recorded: its law or its gains are "
                "not those of the machine."
            )
    return said


def _explained(replay: Replay, quantity: str) -> Sequence[str]:
    """Shares that the simulation explains; a dash where it is worse than none, or there is nothing
    to explain."""
    share = replay.explained(quantity)
    return _texts(_SHARE, np.where(share < 0, np.nan, share))


def _explained_in_words(replay: Replay, quantity: str) -> str:
    """The same in a sentence, and why there are dashes."""
    title, apart = QUANTITIES[quantity].title, replay.apart(quantity)
    shares = _explained(replay, quantity)
    text = f"Of the {title} the simulation explains {' '.join(shares)} %"
    worse, still = np.flatnonzero(apart > 1), np.flatnonzero(np.isnan(apart))
    if worse.size:
        times = ", ".join(f"{x:.4g}" for x in apart[worse])
        text += f"; nothing of joint {_numbers(worse)}, where it is {times} times as far off"
        text += " as all that was recorded (RMS)"
    if still.size:
        text += f"; of joint {_numbers(still)} nothing was recorded to explain"
    return f"{text}."


def _numbers(joints: NDArray[np.int_]) -> str:
    return ", ".join(str(k + 1) for k in joints)


def write_replay(replay: Replay, folder: Path) -> Path:
    """Write figure, table and report into a folder, all or none; the path of the page.

    Raises:
        InputError: if a file cannot be written.
    """
    explained, *differences = tables(replay)
    blocks: dict[str, Sequence[doc.Block]] = {
        "in_short": [doc.Bullets(replay_findings(replay)), explained],
        "differences": differences,
    }
    words = {"title": replay_title(replay), "fed": FED, "alone": ALONE}
    with replacing_files(folder) as new:
        save_both(replay_figure(replay), new / FIGURE)
        replay.to_csv(new / TABLE)
        from_template(page_text("replay.md"), blocks, words, new).write(new)
    return folder / doc.REPORT


def _texts(metric: Metric, values: Array) -> Sequence[str]:
    return [metric.text(x) for x in values.tolist()]
