"""Command profiles: each kind by hand, the shipped one, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from sdt_drake.errors import InputError
from sdt_drake.motion import CommandProfile, Knots, Oscillation, Sampled, load_profile

# A swing of 0.1 rad in 4 s: largest speed 0.1 pi / 2 = 0.157... rad/s.
_SWING = 0.1 * np.pi / 2
_HALF = np.sqrt(0.5)


@pytest.mark.parametrize(
    "joint, expected",
    [
        (
            Knots(knots=[[0, 0], [1, 2], [3, -2], [10, 5]]),
            {0: 0, 0.5: 1, 1: 2, 1.5: 1, 2: 0, 3: -2, 6.5: 1.5, 10: 5},
        ),
        (
            Sampled(period=2.5, speeds=[0, 1, -1, 0, 4]),
            {0: 0, 1.25: 0.5, 2.5: 1, 3.75: 0, 5: -1, 7.5: 0, 8.75: 2, 10: 4},
        ),
        (
            Oscillation(amplitude=0.1, period=4, fade=1, end=9),
            {
                0: 0,
                0.5: _SWING * _HALF * 0.5,  # half faded in
                1: 0,
                2: -_SWING,
                4: _SWING,
                8: _SWING,
                8.5: _SWING * _HALF * 0.5,  # half faded out
                9: 0,
                9.5: 0,
                10: 0,
            },
        ),
    ],
    ids=["Knots", "Sampled", "Oscillation"],
)
def test_speed_of_each_kind_is_the_one_computed_by_hand(joint, expected):
    joint.validate(10, "here")
    speed = joint.speed(np.array(list(expected), dtype=float))
    np.testing.assert_allclose(speed, list(expected.values()), atol=1e-15)


def test_the_angle_of_an_oscillation_is_its_amplitude():
    swing = Oscillation(amplitude=0.3, period=2, fade=1e-9, end=10)
    time = np.linspace(0, 0.5, 20001)
    assert np.trapezoid(swing.speed(time), time) == pytest.approx(0.3, rel=1e-4)


def test_speeds_and_start_have_a_column_for_each_joint():
    profile = CommandProfile(
        duration=2, joints=[Knots([[0, 0], [2, 2]]), Sampled(2, [1, 0]), Knots([[0, 5], [2, 5]])]
    )
    profile.validate("here")
    np.testing.assert_array_equal(profile.speeds(np.array([0, 1])), [[0, 1, 5], [1, 0.5, 5]])
    np.testing.assert_array_equal(profile.start(), [0, 0, 0])
    profile.q0 = [1, 2, 3]
    np.testing.assert_array_equal(profile.start(), [1, 2, 3])


def reference_speeds(t: np.ndarray) -> np.ndarray:
    """The reference motion as written in reference_design.md [rad/s], shape (N, 4)."""
    planetary = np.interp(t, [0.5, 5.83333, 20, 25.33333], [0, 2.4, 2.4, 0])
    roll = np.interp(
        t, [2, 2.5, 9, 10, 16.7, 17.7, 26, 26.5], [0, 1.5, 1.5, -1.5, -1.5, 1.5, 1.5, 0]
    )
    pitch = 0.1 * (2 * np.pi / 5) * np.cos(2 * np.pi * t / 5)
    pitch *= np.clip(t / 2, 0, 1) * np.clip((29 - t) / 2, 0, 1)
    # A square wave that flips every 2.5 s, with ramps of 0.5 s.
    times, speeds = [1.0], [0.0]
    for i in range(11):
        times += [max(1.5, 0.5 + 2.5 * i), 2.5 + 2.5 * i]
        speeds += [0.2093 * (-1) ** i] * 2
    yaw = np.interp(t, [*times, 28], [*speeds, 0])
    return np.stack([planetary, roll, pitch, yaw], axis=1)


def test_the_corners_are_where_a_speed_turns(tmp_path):
    swing = Oscillation(amplitude=1, period=1, fade=0.3, end=2)
    np.testing.assert_allclose(np.unique(swing.corners()), [0, 0.3, 0.5, 1, 1.5, 1.7, 2])
    assert Knots([[0, 0], [0.2, 1], [1, 0]]).corners().tolist() == [0, 0.2, 1]
    assert Sampled(0.5, [0, 1, 0]).corners().tolist() == [0, 0.5, 1]


def test_a_profile_without_a_name_has_that_of_its_file(tmp_path):
    assert _load(tmp_path, PROFILE).name == "short"
    assert _load(tmp_path, PROFILE.replace("name: short\n", "")).name == "profile"


def test_the_shipped_profile_is_the_reference_motion():
    profile = load_profile("package://sdt/motions/reference.yaml")
    assert profile.name == "reference"
    assert profile.duration == 30
    np.testing.assert_array_equal(profile.start(), np.zeros(4))
    time = 0.005 * np.arange(6001)
    np.testing.assert_allclose(profile.speeds(time), reference_speeds(time), atol=1e-12)


# --- what is refused -------------------------------------------------------------------------

_KNOTS = "!Knots {knots: [[0, 0], [1, 1], [2, 0]]}"
_SAMPLED = "!Sampled {period: 0.5, speeds: [0, 1, 2, 1, 0]}"
_SWINGING = "!Oscillation {amplitude: 1, period: 1, fade: 0.5, end: 2}"
PROFILE = f"""name: short
duration: 2
q0: [0, 0, 1]
joints:
  - {_KNOTS}
  - {_SAMPLED}
  - {_SWINGING}
"""


def _load(tmp_path, text):
    path = tmp_path / "profile.yaml"
    path.write_text(text, encoding="utf-8")
    return load_profile(path)


def test_the_profile_of_the_refusals_is_sound_as_it_stands(tmp_path):
    profile = _load(tmp_path, PROFILE)
    assert [type(joint) for joint in profile.joints] == [Knots, Sampled, Oscillation]
    np.testing.assert_array_equal(profile.speeds(np.array([0.5]))[0, :2], [0.5, 1])


BAD = [
    ("duration: 2", "duration: 0", r"duration: 0\.0, expected a finite number > 0"),
    ("duration: 2", "duration: -2", r"duration: -2\.0, "),
    ("duration: 2", "duration: .nan", "duration: nan, "),
    ("duration: 2", "duration: .inf", "duration: inf, "),
    ("duration: 2\n", "", r"duration: 0\.0, "),
    ("q0: [0, 0, 1]", "q0: [0, 1]", r"q0: 2 value\(s\), expected 3"),
    ("q0: [0, 0, 1]", "q0: [0, 0, .nan]", "q0.*finite"),
    (PROFILE[PROFILE.index("joints") :], "joints: []", "joints: empty"),
    (PROFILE[PROFILE.index("joints") :], "", "joints: empty"),
    # Knots.
    ("[[0, 0], [1, 1], [2, 0]]", "[[0, 0]]", r"joints\[1\]\.knots: .*at least two pairs"),
    ("[[0, 0], [1, 1], [2, 0]]", "[]", r"joints\[1\]\.knots: .*at least two pairs"),
    ("[1, 1]", "[1]", r"joints\[1\]\.knots: .*pairs"),
    ("[1, 1]", "[1, 1, 1]", r"joints\[1\]\.knots: .*pairs"),
    ("[1, 1]", "[1, .nan]", r"joints\[1\]\.knots.*finite"),
    ("[1, 1]", "[.inf, 1]", r"joints\[1\]\.knots.*finite"),
    ("[1, 1]", "[0, 1]", r"joints\[1\]\.knots: time 0 s after 0 s"),
    ("[1, 1]", "[2.5, 1]", r"joints\[1\]\.knots: time 2 s after 2\.5 s"),
    ("[[0, 0], [1", "[[0.1, 0], [1", r"joints\[1\]\.knots: from 0\.1 to 2 s, expected 0 to 2"),
    ("[2, 0]", "[1.9, 0]", r"joints\[1\]\.knots: from 0 to 1\.9 s, expected 0 to 2"),
    ("[2, 0]", "[2.0000001, 0]", r"joints\[1\]\.knots: .*2\.0000001 s, expected 0 to 2 s"),
    # Samples.
    ("period: 0.5, s", "period: 0, s", r"joints\[2\]\.period: 0\.0, .* > 0"),
    ("period: 0.5, s", "period: -0.5, s", r"joints\[2\]\.period: -0\.5, "),
    ("period: 0.5, s", "period: .nan, s", r"joints\[2\]\.period: nan, "),
    ("period: 0.5, s", "period: 0.3, s", r"joints\[2\].*2 s is not a whole multiple .*0\.3 s"),
    ("period: 0.5, s", "period: 1e-310, s", r"joints\[2\]"),
    ("[0, 1, 2, 1, 0]", "[0, 1, 0]", r"joints\[2\]\.speeds: 3 samples, expected 5"),
    ("[0, 1, 2, 1, 0]", "[0, 1, .nan, 1, 0]", r"joints\[2\]\.speeds.*finite"),
    # Oscillations.
    ("amplitude: 1", "amplitude: .nan", r"joints\[3\]\.amplitude: nan"),
    ("period: 1", "period: 0", r"joints\[3\]\.period: 0\.0"),
    ("period: 1", "period: .inf", r"joints\[3\]\.period: inf"),
    ("fade: 0.5", "fade: 0", r"joints\[3\]\.fade: 0\.0"),
    ("end: 2", "end: 0", r"joints\[3\]\.end: 0\.0"),
    ("period: 1", "period: 1e-9", r"joints\[3\]\.period: 1e-09 s, expected at least 2e-05 s"),
    ("end: 2", "end: 2.1", r"joints\[3\]\.end: 2\.1 s, expected <= duration 2 s"),
]


@pytest.mark.parametrize("old, new, message", BAD, ids=[case[-1] for case in BAD])
def test_a_bad_profile_is_refused_with_file_field_and_value(tmp_path, old, new, message):
    assert old in PROFILE
    with pytest.raises(InputError, match=rf"profile\.yaml: {message}"):
        _load(tmp_path, PROFILE.replace(old, new, 1))
