"""The two sheets of an acceptance test: verdicts first, what is worst, what is left out."""

import csv
import re

import numpy as np
import pytest

from sdt_drake.machine.accept.results import QUANTITIES, Accepted, Characteristic
from sdt_drake.machine.accept.spec import Acceptance
from sdt_drake.show.reports.accept import accept_findings, accept_tables, write_accepted

INF = np.inf


def number(kind, place, quantity, at, value, half=0.0, least=-INF, most=INF):
    joint = int(place[0]) if place[0].isdigit() else 0
    return Characteristic(
        kind, place, joint, quantity, at, value, value - half, value + half, least, most
    )


@pytest.fixture(scope="module")
def accepted(robot):
    numbers = [
        number("sine", "1 planetary", "gain", 0.5, 0.1, 0.05, -1, 1),
        number("sine", "1 planetary", "gain", 2.0, 1.5, 0.1, -1, 1),
        number("sine", "2 roll", "gain", 2.0, -1.0, 0.2, -1, 1),
        number("sine", "2 roll", "phase", 2.0, -0.1),
        number("sine", "head sway, 2 roll", "gain", 2.0, -0.5, 0.2, -1, 1),
        number("sine", "2 roll", "noise", 0.5, 0.02, 0.004, most=0.1),
        number("sine", "2 roll", "noise", 2.0, 0.06, 0.004, most=0.1),
        number("step", "2 roll", "threshold", 0.1, INF, most=0.2),
        number("step", "2 roll", "threshold", 1.0, 0.05, most=0.2),
        number("hysteresis", "1 planetary", "hysteresis", np.nan, 0.001, 0.0002, most=0.0011),
        number("chain", "roll", "gain", 0.016, 0.2, least=-1, most=1),
        number("chain", "roll", "phase", 0.016, -0.2),
        number("poses", "head", "pose_repeatability", np.nan, 0.001),
    ]
    return Accepted(robot, Acceptance(), tuple(numbers), ("3 pitch, excursion: no stops",))


def test_findings_name_what_fails_and_what_cannot_be_judged(accepted):
    first, failed, open_ = accept_findings(accepted)
    assert first.startswith("Of 10 limited characteristics 6 pass, 2 fail, and 2 are not judged")
    assert "gain, 1 planetary at 2 Hz, 1.500 ± 0.100 dB, allowed -1.000 to 1.000 dB" in failed
    assert "dynamic threshold, 2 roll at 0.1 rad/s², ∞ ms, allowed ≤ 200.0 ms" in failed
    assert open_.startswith("Not judged: hysteresis, 1 planetary, 0.0573 ± 0.0115 deg")
    nothing = Accepted(accepted.robot, accepted.spec, (), ())
    assert accept_findings(nothing) == ["No limits were given, so nothing is judged."]
    assert not accepted.is_passed and not nothing.is_passed


def test_tables_have_the_worst_of_each_limit_and_the_largest_of_each_joint(accepted):
    tables = accept_tables(accepted)
    limits = {row[0]: row[2:] for row in tables["limits"].rows}
    assert limits["acceleration noise"] == ("2 roll at 2 Hz", "6.00 ± 0.40 %", "pass")
    assert limits["gain of the chain"] == ("roll at 0.016 Hz", "0.200 dB", "pass")
    order = "gain", "acceleration noise", "hysteresis", "dynamic threshold", "pose repeatability"
    assert [*limits] == [x for x in order if x in limits] + ["gain of the chain"]
    joints = {row[0]: row[1:] for row in tables["joints"].rows}
    assert joints["acceleration noise [%]"] == ("–", "6.00 ± 0.40", "–", "–")
    assert joints["dynamic threshold [ms]"] == ("–", "∞", "–", "–")
    assert tables["sines"].rows == [
        ("0.5", "0.100 ± 0.050", "–", "–", "–"),
        ("2", "1.500 ± 0.100", "–", "-1.000 ± 0.200", "-5.73"),
    ]


def test_two_sheets_and_a_table_of_all_numbers_are_written(accepted, tmp_path):
    page = write_accepted(accepted, "a <machine>", tmp_path / "out")
    text = page.read_text(encoding="utf-8")
    assert "Acceptance test of a &lt;machine&gt;" in text and 'class="sheet"' in text
    assert (
        text.index("Sheet 1") < text.index("3 pitch, excursion: no stops") < text.index("<figure")
    )
    form = text[text.index("accepted by") : text.index("Sheet 1")]
    assert len(re.findall("…{10,}", form)) == 4  # lines to write on
    with (page.parent / "acceptance.csv").open(encoding="utf-8", newline="") as file:
        rows = [*csv.DictReader(file)]
    assert len(rows) == len(accepted.characteristics)
    assert [row["verdict"] for row in rows] == [x.verdict for x in accepted.characteristics]
    assert rows[1]["value"] == "1.5" and rows[1]["unit"] == "dB"
    assert {row["quantity"] for row in rows} <= {*QUANTITIES}


def test_each_joint_and_channel_of_the_figure_has_a_colour_of_its_own(robot):
    joints = [f"{k} joint" for k in (1, 2, 3, 4)]
    numbers = [
        number("sine", place, "gain", 0.5, 0.1) for x in joints for place in (x, f"head sway, {x}")
    ]
    numbers += [number("chain", x, "gain", 0.3, 0.1) for x in ("surge", "roll", "pitch", "yaw")]
    axes = Accepted(robot, Acceptance(), tuple(numbers), ()).plot().axes[:2]
    colours = [bars.lines[0].get_color() for ax in axes for bars in ax.containers]
    assert len(colours) == len({*colours}) == 8
    for ax in axes:  # in less than a decade, too
        low, high = ax.get_xlim()
        assert any(low <= x <= high for x in ax.get_xticks())
