"""Motions of published experiments, by what people without errors would feel of them."""

from itertools import accumulate

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sdt_drake.pilot.head import GRAVITY
from sdt_drake.pilot.orientation import Percept
from sdt_drake.pilot.reported import _judged, _texts
from sdt_drake.pilot.reported_motions import MOTIONS

SHORT, LONG = (np.degrees(np.sqrt(GRAVITY * np.sqrt(3) / arm)) for arm in (7.25, 9.1))
JET = np.degrees(GRAVITY * np.sqrt(3) / 150)
LIGHT, GENTLE = (
    np.degrees(GRAVITY / 80),
    np.degrees(np.sqrt(GRAVITY * np.tan(np.radians(50)) / 7.25)),
)
PLAYED = [  # duration [s], largest force [G], rate at the end [deg/s], speed gained along x [m/s]
    (242, 1, 0, 0),  # yaw
    (60, np.hypot(1, 0.3), 0, 0.3 * GRAVITY * 60),
    (127, 1 / np.cos(np.radians(50)), GENTLE, 7.25 * np.radians(GENTLE)),
    (130, 2, SHORT, 7.25 * np.radians(SHORT)),
    (10, 2, SHORT, -7.25 * np.radians(SHORT)),  # facing backward
    (130, 2, LONG, 9.1 * np.radians(LONG)),
    (132.5, 2, LONG, 9.1 * np.radians(LONG)),
    (12.5, 2, LONG, np.nan),  # supine, with the force along x
    (135, np.sqrt(2), LIGHT, 0),
    (130, 2, JET, 0),
    (40, 1.5, 0, 0),
    (40, 2, 0, 0),
    (80, 2, 10 * 2 * np.pi * 0.0625, 0),
    (69.5, 1, np.hypot(90, 20), 0),
]


def by_rotation(played, lasting=np.inf):
    """A pilot who knows down from rates alone; felt rates fade with a time constant [s]."""

    def feel(time, force, rate):
        played.append((time, force, rate))
        steps, change = np.diff(time)[:, None], np.diff(rate, axis=0)
        turned = Rotation.from_rotvec((rate[1:] + rate[:-1]) / 2 * steps).as_matrix()
        poses = np.array([*accumulate([np.eye(3), *turned], np.matmul)])
        start = np.round(-force[0] / np.linalg.norm(force[0]))
        kept = np.exp(-steps / lasting)
        grown = change if lasting == np.inf else change * (1 - kept) * lasting / steps
        felt = [*accumulate(zip(kept, grown, strict=True), lambda x, own: own[0] * x + own[1],
                            initial=rate[0])]  # fmt: skip
        return Percept(None, time, force, rate, start @ poses, np.array(felt), 0 * rate)

    return feel


def by_force(settled):
    """A pilot to whom the force is down from a time on [s], and the feet before it."""

    def feel(time, force, rate):
        down = np.where(time[:, None] < settled, [0, 0, -1], -force)
        down /= np.linalg.norm(down, axis=1, keepdims=True)
        return Percept(None, time, force, rate, down, rate, 0 * rate)

    return feel


def predicted(feel, *without):
    motions = [x for x in MOTIONS if x.__name__ not in ("_yaw", *without)]
    return {id_: value for motion in motions for id_, value in motion(feel)}


def test_motions_have_the_rotation_that_their_stimulus_tells():
    played = []
    yaw = dict(MOTIONS[0](by_rotation(played, 10.0)))
    assert yaw == pytest.approx(dict.fromkeys(yaw, 10 * np.log(1 / 0.37)), rel=1e-3)
    assert np.trapezoid(played[0][2][:, 2], played[0][0]) == pytest.approx(121 * np.radians(60))
    found = predicted(by_rotation(played))
    angles = {"turn_1.56": 50, "turn_2": 60, "turn_9.1m": 60, "turn_slower": 60, "aircraft_1.4": 45}
    angles |= {"aircraft_2": 60, "forward": 0, "coriolis": 45, "tilt": 1}
    for id_, value in found.items():
        (expected,) = (angle for name, angle in angles.items() if id_.startswith(name))
        expected = np.nan if "fading" in id_ else expected
        assert value == pytest.approx(expected, abs=0.15, nan_ok=True), id_
    for (time, force, rate), (duration, most, turning, speed) in zip(played, PLAYED, strict=True):
        assert time[-1] == pytest.approx(duration)
        assert np.linalg.norm(force, axis=1).max() == pytest.approx(most * GRAVITY, rel=1e-3)
        assert np.degrees(np.linalg.norm(rate[-1])) == pytest.approx(turning, abs=0.01)
        gained = np.trapezoid(force[:, 0], time)
        assert np.isnan(speed) or gained == pytest.approx(speed, rel=3e-3, abs=1e-9)


@pytest.mark.parametrize("settled", [0, 32])
def test_motions_have_the_force_that_their_stimulus_tells(settled):
    found = predicted(by_force(settled), "_turn_slower")  # what is not felt cannot fade
    tilts = {"tilt_1.5": 1, "tilt_2": 1, "tilting_2": 1, "forward": np.degrees(np.arctan(0.3))}
    for id_, value in found.items():
        if id_ != "coriolis":
            assert value == pytest.approx(tilts.get(id_, 0), abs=1e-9), id_


def test_a_range_of_reports_is_told_as_it_was_read():
    ranges = [text for text in _texts() if "range" in text]
    for text in ranges:
        assert _judged(text, {}).reported == "{} to {}".format(*text["range"])
    assert ranges
