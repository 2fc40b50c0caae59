"""Motions of published experiments, by what people without errors would feel of them."""

from itertools import accumulate

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sdt_drake.pilot.head import GRAVITY
from sdt_drake.pilot.orientation import Percept
from sdt_drake.pilot.reported import _judged, _texts
from sdt_drake.pilot.reported_motions import MOTIONS

ARMS = 7.25, 9.1  # m


def played_turns():
    """Duration [s], largest force [G], rate at the end [deg/s], speed gained along x [m/s]."""
    for duration, angle, arm in ((127, 50, 0), (130, 60, 0), (-10, 60, 0), (130, 60, 1),
                                 (132.5, 60, 1), (12.5, 60, 1)):  # fmt: skip
        omega = np.sqrt(GRAVITY * np.tan(np.radians(angle)) / ARMS[arm])
        gained = np.sign(duration) * ARMS[arm] * omega  # negative facing backward
        yield abs(duration), 1 / np.cos(np.radians(angle)), np.degrees(omega), gained
    for duration, angle, speed in ((135, 45, 80), (130, 60, 150)):
        omega = GRAVITY * np.tan(np.radians(angle)) / speed
        yield duration, 1 / np.cos(np.radians(angle)), np.degrees(omega), 0


YAW, FORWARD = (242, 1, 0, 0), (60, np.hypot(1, 0.3), 0, 0.3 * GRAVITY * 60)
TILTS = (40, 1.5, 0, 0), (40, 2, 0, 0), (80, 2, 10 * 2 * np.pi * 0.0625, 0)
PLAYED = [YAW, FORWARD, *played_turns(), *TILTS, (69.5, 1, np.hypot(90, 20), 0)]


def by_rotation(played):
    """A pilot who knows down from rates alone; a yaw fades within 10 s after 1 s and 122 s."""

    def feel(time, force, rate):
        played.append((time, force, rate))
        turns = (rate[1:] + rate[:-1]) / 2 * np.diff(time)[:, None]
        poses = [np.eye(3), *Rotation.from_rotvec(turns).as_matrix()]
        start = np.round(-force[0] / np.linalg.norm(force[0]))
        down = start @ np.array([*accumulate(poses, np.matmul)])
        yaw = np.exp(np.where(time < 122, 1 - time, 122 - time) / 10)
        return Percept(None, time, force, rate, down, np.column_stack([rate[:, :2], yaw]), rate)

    return feel


def by_force(settled):
    """A pilot to whom the force is down from a time on [s], and the feet before it."""

    def feel(time, force, rate):
        down = np.where(time[:, None] < settled, [0, 0, -1], -force)
        down /= np.linalg.norm(down, axis=1, keepdims=True)
        return Percept(None, time, force, rate, down, rate, 0 * rate)

    return feel


def predicted(feel, *without):
    motions = [x for x in MOTIONS if x.__name__ not in without]
    return {id_: value for motion in motions for id_, value in motion(feel)}


def test_motions_have_the_rotation_that_their_stimulus_tells():
    found = predicted(by_rotation(played := []))
    angles = {"turn_1.56": 50, "turn_2": 60, "turn_9.1m": 60, "turn_slower": 60, "aircraft_1.4": 45}
    angles |= {"aircraft_2": 60, "forward": 0, "coriolis": 45, "tilt": 1, "yaw": 9.94}
    assert np.trapezoid(played[0][2][:, 2], played[0][0]) == pytest.approx(121 * np.radians(60))
    for id_, value in found.items():
        (expected,) = (angle for name, angle in angles.items() if id_.startswith(name))
        expected = np.nan if "fading" in id_ else expected
        assert value == pytest.approx(expected, abs=0.15, nan_ok=True), id_
    for (time, force, rate), (duration, most, turning, speed) in zip(played, PLAYED, strict=True):
        assert time[-1] == pytest.approx(duration)
        assert np.linalg.norm(force, axis=1).max() == pytest.approx(most * GRAVITY, rel=1e-3)
        assert np.degrees(np.linalg.norm(rate[-1])) == pytest.approx(turning, abs=0.01)
        if duration != 12.5:  # supine, where the force is along x
            assert np.trapezoid(force[:, 0], time) == pytest.approx(speed, rel=3e-3, abs=1e-9)


@pytest.mark.parametrize("settled", [0, 32])
def test_motions_have_the_force_that_their_stimulus_tells(settled):
    found = predicted(by_force(settled), "_yaw", "_turn_slower")  # what is not felt cannot fade
    tilts = {"tilt_1.5": 1, "tilt_2": 1, "tilting_2": 1, "forward": np.degrees(np.arctan(0.3))}
    for id_, value in found.items():
        if id_ != "coriolis":
            assert value == pytest.approx(tilts.get(id_, 0), abs=1e-9), id_


def test_a_range_of_reports_is_told_as_it_was_read():
    ranges = [text for text in _texts() if "range" in text]
    for text in ranges:
        assert _judged(text, {}).reported == "{} to {}".format(*text["range"])
    assert ranges
