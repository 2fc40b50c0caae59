"""`sdt-drake motions` as a user meets it."""

from __future__ import annotations

import re

import pytest
from command_line import ARM, refused

from sdt_drake.analysis.orientation import CAUTION
from sdt_drake.motion import load_profile, shipped_motions

MINE = """\
title: Mine
feels: Nothing much.
duration: 10
start_deg: [0, 0, 0, 90]
tracks:
  - joint: yaw
    segments:
      - !Turn {at: 1, by_deg: -30, duration: 2}
      - !Turn {at: 5, to_deg: 90, speed_deg_s: 20, blend: linear}
"""


@pytest.fixture
def desk(tmp_path, monkeypatch):
    """A working directory with a profile, a bad one, and another robot."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.yaml").write_text(MINE, encoding="utf-8")
    (tmp_path / "bad.yaml").write_text(MINE.replace("at: 5", "at: 2"), encoding="utf-8")
    for name, old, new in (
        ("odd", "duration: 10", "duration: 10.0003"),
        ("long", "duration: 10", "duration: 1e6"),
        ("short", "duration: 2", "duration: 1e-3"),
        ("fast", "to_deg: 90, speed_deg_s: 20", "to_deg: 1.0e305, duration: 2"),
    ):
        assert old in MINE
        (tmp_path / f"{name}.yaml").write_text(MINE.replace(old, new, 1), encoding="utf-8")
    (tmp_path / "folder.yaml").mkdir()
    (tmp_path / "empty.yaml").write_text("", encoding="utf-8")
    (tmp_path / "folder.yaml" / "table.csv").write_text(
        "time,v_ref_1\n0,0\n1,0\n", encoding="utf-8"
    )
    (tmp_path / "arm.sdf").write_text(ARM, encoding="utf-8")
    return tmp_path


def words(text):
    return " ".join(text.split())


def test_the_list_has_every_motion_and_what_it_feels_like(good, desk):
    out = good("motions").out
    table, sentences = out.split("\n\n")
    rows = [re.split(r"\s{2,}", line.strip()) for line in table.splitlines()]
    assert rows[0] == ["motion", "illusion", "duration [s]", "joints", "largest G"]
    assert [row[0] for row in rows[1:-1]] == shipped_motions()
    for name in shipped_motions():
        profile = load_profile(name)
        assert f"{name}: {words(profile.feels)}" in words(sentences)
        (row,) = (row for row in rows if row[0] == name)
        assert row[1:3] == [profile.title, f"{profile.duration:g}"]
    joints = {row[0]: row[3] for row in rows[1:-1]}
    assert joints["g_excess"] == "planetary, roll, pitch" and joints["post_roll"] == "roll"
    largest = {row[0]: float(row[4]) for row in rows[1:-1]}
    assert largest["graveyard_spin"] == 1.0
    # The head: 0.13 m behind and 0.33 m above where the axes meet, on an arm of 2.6 m.
    omega_squared = 9.81 / 2.6 * (1.25**0.5)
    radius = 2.6 - 0.33 * (1.25**0.5 / 1.5)
    centripetal = ((radius**2 + 0.13**2) ** 0.5) * omega_squared
    assert largest["graveyard_spiral"] == pytest.approx(
        (1 + (centripetal / 9.81) ** 2) ** 0.5, abs=0.006
    )
    assert max(map(len, out.splitlines())) <= 100
    assert not list(desk.glob("*.csv"))


def test_one_motion_in_full(good, desk):
    out = good("motions", "graveyard_spiral").out
    profile = load_profile("graveyard_spiral")
    assert out.startswith("Graveyard spiral: 88 s, largest G at the head 1.42\n")
    assert f"feels: {words(profile.feels)}" in words(out)
    assert "slow_yaw predicts it: roll felt +49.2 deg off." in words(out) and CAUTION in words(out)
    assert "irmak2023 does not predict it: roll felt at" in words(good("motions", "g_excess").out)
    assert f"notes: {words(profile.notes)}" in words(out)
    assert re.search(r"^planetary \+ roll: to 1.5 G, cosine +2\.000 +12\.000$", out, re.M)
    assert re.search(r"^planetary \+ roll: hold +12\.000 +54\.000$", out, re.M)
    assert "starts at 0 deg" in out


def test_a_file_of_ones_own(good, desk):
    out = good("motions", "mine.yaml").out
    assert out.startswith("Mine: 10 s, largest G at the head 1.00\n")
    assert re.search(r"^yaw: turn by -30 deg, cosine +1\.000 +3\.000$", out, re.M)
    # 30 deg at a mean of two thirds of 20 deg/s
    assert re.search(r"^yaw: turn to 90 deg, linear +5\.000 +7\.250$", out, re.M)
    assert "starts at yaw 90 deg" in out
    assert "notes" not in out


def test_a_duration_that_is_no_multiple_of_the_period_is_shown_too(good, desk):
    assert good("motions", "odd.yaml").out.startswith("Mine: 10.0003 s, largest G at the head 1.00")


def test_a_robot_without_these_joints_gets_the_reason_for_each(good, desk):
    out = good("motions", "--robot", "arm.sdf").out
    for name in shipped_motions():
        assert f"{name}: not with 'two_links' (motion '{name}': " in words(out)
    assert "shoulder, elbow" in words(out)


@pytest.mark.parametrize(
    "arguments, parts",
    [
        (["graveyrd_spin"], ["graveyrd_spin: no such motion", "graveyard_spin"]),
        (["nowhere.yaml"], ["nowhere.yaml: no such file"]),
        (["bad.yaml"], ["bad.yaml: tracks[1].segments[2].at: 2 s, expected at least 3 s", "3 s"]),
        (["leans", "--robot", "arm.sdf"], ["leans.yaml: tracks[1].resultant.spin: ", "elbow"]),
        (["folder.yaml/table.csv"], ["table.csv: is a table, expected a motion"]),
        (["empty.yaml"], ["empty.yaml: empty, expected a mapping with", "tracks"]),
        (["folder.yaml"], ["folder.yaml: is a folder, expected a file"]),
        (["long.yaml"], ["long.yaml: ", "duration: 1e+06 s, expected at most 3600 s"]),
        (["short.yaml"], ["short.yaml: ", "joint 4 'yaw'", "a period of 0.005 s loses 30 deg"]),
        (["fast.yaml"], ["fast.yaml: ", "joint 4 'yaw'", "rad/s, expected at most 10000"]),
        (["--robot", "nowhere.sdf"], ["nowhere.sdf: no such file"]),
    ],
)
def test_mistakes_are_one_line(call, desk, arguments, parts):
    refused(call("motions", *arguments), *parts)
