"""Motion profiles that are refused: the file, the field, and what would be right."""

from __future__ import annotations

import pytest
from motions import ALIGNED, BACK, PLANETARY, ROLL, SPIN, YAW, profile_text

from sdt_drake.io.errors import InputError
from sdt_drake.motion import load_command

END = "!Ramp {to_deg_s: 0, duration: 1}"
GO = "!Ramp {to_deg_s: 5, duration: 1}"
BAD = [
    ([("joint: rol", END)], "tracks[1].joint: 'rol', expected a joint of 'sdt': planetary, roll,"),
    ([("resultant: {spin: arm}", BACK)], "tracks[1].resultant.spin: 'arm', expected a joint"),
    ([("resultant: {spin: planetary, align: bank}", BACK)], "resultant.align: 'bank', expected"),
    ([("joint:", END)], "tracks[1]: neither, expected either joint or resultant"),
    ([(ROLL,)], "tracks[1].segments: "),
    ([(YAW, END), (ROLL, END), (YAW, END)], "tracks[3]: joint 'yaw' is already moved by tracks[1]"),
    (
        [(PLANETARY, "!Turn {by_deg: 5, duration: 5}"), (SPIN, BACK)],
        "tracks[2]: joint 'planetary' is already moved",
    ),
    ([(SPIN, BACK), ("resultant: {spin: yaw}", BACK)], "tracks[2].resultant: a second one after"),
    ([("resultant: {spin: pitch}", BACK)], "resultant.spin: the axis of 'pitch' is not vertical"),
    ([("resultant: {spin: yaw, align: roll}", BACK)], "align: 'roll' is not on an arm of 'yaw'"),
    ([("resultant: {spin: yaw}", BACK)], "resultant.spin: 'yaw' is not on an arm"),
    ([("resultant: {spin: planetary, align: pitch}", BACK)], "align: the axis of 'pitch' is not"),
    # When.
    ([(YAW, "!Ramp {at: 1, to_deg_s: 5, duration: 4}", "!Hold {at: 3, duration: 1}")],
     "tracks[1].segments[2].at: 3 s, expected at least 5 s"),
    ([(YAW, "!Hold {at: 1}")], "segments[1].duration: missing, expected a number > 0"),
    ([(YAW, "!Hold {at: 18, duration: 3}")], "segments[1]: ends at 21 s, expected at most 20"),
    # Ramps.
    ([(YAW, "!Ramp {to_deg_s: 5, duration: -4}")], "tracks[1].segments[1].duration: -4"),
    ([(YAW, "!Ramp {to_deg_s: 5, duration: 4, acceleration_deg_s2: 1}")],
     "segments[1]: duration and acceleration_deg_s2, expected either duration or accel"),
    ([(YAW, "!Ramp {to_deg_s: 5}")], "segments[1]: neither, expected either duration or a"),
    ([(YAW, "!Ramp {to_deg_s: 5, acceleration_deg_s2: -3}")], "acceleration_deg_s2: -3, expect"),
    ([(YAW, "!Ramp {to_deg_s: .nan, duration: 1}")], "segments[1].to_deg_s: nan"),
    ([(YAW, "!Ramp {to_deg_s: 5, duration: 1, blend: cubic}")], "segments[1].blend: 'cubic', exp"),
    ([(YAW, "!Jump {to_deg_s: 5}")], "segments[1]: unknown kind !Jump, expected !Ramp, "),
    ([(YAW, "!Ramp {to_deg: 5}")], "segments[1].to_deg: no such field, did you mean 'to_deg_s'"),
    ([(YAW, "!Ramp {duration: 5}")], "segments[1]: neither, expected either to_deg_s or to_g"),
    ([(YAW, "!Ramp {to_g: 1.5, duration: 4}")], "segments[1].to_g: given in a track of a joint"),
    ([(YAW, "!Ramp {to_deg_s: 0, acceleration_deg_s2: 5}")], "segments[1]: the segment"),
    ([(YAW, "!Ramp {to_deg_s: -5, duration: 1}")], "[1]: 'yaw' ends at -5 deg/s, expected rest"),
    # Turns.
    ([(YAW, "!Turn {to_deg: 0, speed_deg_s: 5}")], "segments[1]: the segment changes nothing"),
    ([(YAW, "!Turn {by_deg: 3, to_deg: 4, duration: 5}")], "by_deg and to_deg, expected either by"),
    ([(YAW, "!Turn {duration: 5}")], "segments[1]: neither, expected either by_deg or to_deg"),
    ([(YAW, GO, "!Turn {by_deg: 5, duration: 1}")],
     "segments[2]: !Turn starts at a speed of 5 deg/s, expected rest"),
    # G.
    # hypot(1, 3.1167² 2.6 / 9.81)
    ([(SPIN, "!Ramp {to_g: 3, duration: 4}", BACK)], "[1].to_g: 3 G, expected at most 2.762 G"),
    ([(SPIN, "!Ramp {to_deg_s: 15, duration: 4}")], "segments[1].to_deg_s: given in a track of"),
    ([(SPIN, "!Turn {by_deg: 15, duration: 4}")], "segments[1]: !Turn in a track of the resultant"),
    ([(ALIGNED, "!Ramp {to_g: 2, duration: 4, blend: linear}", BACK)],
     "segments[1].blend: 'linear', expected cosine: the aligned joint 'roll' would"),
    # Knots and samples.
    ([(YAW, "!Knots {knots: [[0, 0]]}")], "segments[1].knots: expected at least two pairs"),
    ([(YAW, "!Knots {knots: [[0, 0], [20, 0, 1]]}")], "segments[1].knots: expected at least two"),
    ([(YAW, "!Knots {knots: [[0, 0], [9, 1], [9, 2], [20, 0]]}")], "knots: time 9 s after 9 s"),
    ([(YAW, "!Knots {knots: [[0.1, 0], [20, 0]]}")], "segments[1].knots: start at 0.1 s, expected"),
    ([(YAW, "!Knots {knots: [[0, 0], [19, 0]]}")], "segments[1]: ends at 19 s, expected exactly"),
    ([(YAW, "!Knots {knots: [[0, 0], [20.0000001, 0]]}")], "[1]: ends at 20.0000001 s, expected e"),
    ([(YAW, GO, "!Knots {knots: [[0, 0], [19, 0]]}")], "!Knots starts at a speed of 5 deg/s"),
    ([(YAW, "!Sampled {period: 1, speeds: [1]}")], "segments[1].speeds: 1 value(s), expected at"),
    # Swings.
    ([(YAW, "!Oscillation {amplitude: 1, period: 1, fade: 1, end: 21}")], "[1]: ends at 21 s, exp"),
    ([(YAW, "!Fourier {period: 2, sine: [1, -0.5], cosine: [0, 1], end: 3}")], "end: 3 s"),
    ([(YAW, "!Fourier {period: 2, sine: [1, 0.5], cosine: [0, 1], end: 4}")], "starts at"),
    ([(YAW, "!Fourier {period: 2, sine: [1, -0.5], cosine: [0], end: 4}")], "1 value(s)"),
    ([(YAW, "!Oscillation {amplitude: 1, period: 1e-9, fade: 1, end: 2}")],
     "period: 1e-09 s, expected at least 2e-05 s"),
    ([(YAW, GO, "!Oscillation {amplitude: 1, period: 1, fade: 1, end: 2}")],
     "segments[2]: !Oscillation starts at a speed of 5 deg/s, expected rest"),
]  # fmt: skip


@pytest.mark.parametrize("tracks, message", BAD, ids=[case[1] for case in BAD])
def test_bad_tracks_are_refused(loaded, tmp_path, tracks, message):
    with pytest.raises(InputError) as error:
        loaded(*tracks)
    told = str(error.value)
    assert told.startswith(f"{tmp_path / 'test.yaml'}: ") and message in told and "\n" not in told


@pytest.mark.parametrize(
    "text, message",
    [
        ("duration: 3\ntracks: []\n", "tracks: expected segments"),
        (
            "duration: 3\njoints: [!Knots {knots: [[0, 0], [3, 0]]}]\n",
            "joints: 1 value(s), expected 4",
        ),
        (profile_text((YAW, END), more="start_deg: [0, 0]"), "start_deg: 2 value(s), expected 4"),
        (profile_text((YAW, END), more="q0: [0, 0, 0, .nan]"), "q0[4]: nan"),
    ],
)
def test_bad_heads_are_refused(tmp_path, robot, text, message):
    (tmp_path / "bad.yaml").write_text(text)
    with pytest.raises(InputError) as error:
        load_command(tmp_path / "bad.yaml", robot)
    assert f"bad.yaml: {message}" in str(error.value)
