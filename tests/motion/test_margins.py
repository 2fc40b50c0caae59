"""The margin report, against numbers by hand."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from motions import reference, sampled

from sdt_drake.io.errors import InputError
from sdt_drake.motion import Motion, margins
from sdt_drake.robot.device import Drive
from sdt_drake.robot.motors import as_driven


@pytest.fixture(scope="module")
def motion(robot):
    return sampled(reference(robot))


def test_peak_rms_and_the_tightest_place_of_the_reference_motion(robot, motion):
    report = margins(robot, motion)
    share = report.peak_torque / robot.effort_limit
    np.testing.assert_array_equal(np.round(share, 2), [0.82, 0.93, 0.30, 0.23])
    # The integral of a motion that ends at rest, of the same samples.
    power = np.sum(report.torque[:-1] ** 2, axis=0) * motion.period / motion.duration
    np.testing.assert_allclose(report.rms_torque**2, power, rtol=1e-12)
    place = report.smallest
    assert (place.joint, place.quantity) == (1, "torque")
    assert place.share == share[1] and place.left == 1 - place.share
    assert place.time == 9
    assert [report.tightest(k).quantity for k in range(4)] == ["torque"] * 4
    np.testing.assert_array_equal(report.to_stop, np.inf)
    assert set(report.share) == {"torque", "speed"}


def test_a_limit_of_speed_or_acceleration_can_be_the_tightest(robot, motion):
    limited = dataclasses.replace(
        robot,
        velocity_limit=np.array([2.5, np.inf, np.inf, np.inf]),
        acceleration_limit=np.array([np.inf, 3.1, np.inf, np.inf]),
    )
    report = margins(limited, motion)
    speed, acceleration = report.tightest(0), report.tightest(1)
    assert (speed.quantity, acceleration.quantity) == ("speed", "acceleration")
    assert (speed.share, acceleration.share) == pytest.approx((2.4 / 2.5, 3 / 3.1))
    assert 5.833 <= speed.time <= 20


def test_positions_are_held_against_both_stops_and_a_single_one(robot, motion):
    degrees = np.degrees(motion.q)
    none = np.full(4, np.inf)
    lower, upper = -none.copy(), none.copy()
    lower[2], upper[2] = np.radians([-12, 4])  # the middle is -4, 8 deg to either side
    upper[3] = np.radians(20)  # from the start, at 0
    stopped = dataclasses.replace(robot, position_lower=lower, position_upper=upper)
    report = margins(stopped, motion)
    share = report.share["position"].max(axis=0)
    farthest = max(-4 - degrees[:, 2].min(), degrees[:, 2].max() + 4) / 8
    np.testing.assert_allclose(share, [0, 0, farthest, degrees[:, 3].max() / 20], rtol=1e-9)
    lower[3], upper[3] = np.radians(-20), np.inf  # that alone, from the start
    below = margins(dataclasses.replace(stopped, position_lower=lower), motion)
    share = below.share["position"][:, 3].max()
    assert share == pytest.approx(-degrees[:, 3].min() / 20, rel=1e-9)
    lower[3] = motion.q[0, 3]  # where it starts: nothing is left
    below = margins(dataclasses.replace(stopped, position_lower=lower), motion)
    assert below.share["position"][0, 3] == 1 and below.smallest.left <= 0
    to_stop = min(degrees[:, 2].min() + 12, 4 - degrees[:, 2].max())
    np.testing.assert_allclose(np.degrees(report.to_stop[2:]), [to_stop, 20 - degrees[:, 3].max()])


def test_an_envelope_takes_torque_from_driving_but_not_from_braking(robot):
    # Joint 1 alone: up at 0.5 rad/s², held at 1 rad/s, down again.
    v = np.zeros((1201, 4))
    time = 0.005 * np.arange(1201)
    v[:, 0] = np.interp(time, [0, 2, 4, 6], [0, 1, 1, 0])
    motion = Motion.from_speeds(0.005, np.zeros(4), v)
    drive = Drive(n1=[33.6, 9, 9, 9], n0=[100.8, 99, 99, 99])  # joint 1: 0.5 and 1.5 rad/s
    report = margins(as_driven(robot, drive), motion)
    left = np.clip((1.5 - v[:, 0]) / 1.0, 0, 1)
    np.testing.assert_allclose(report.highest[:, 0], 13655.04 * left)
    np.testing.assert_allclose(report.lowest[:, 0], -13655.04)
    share = report.share["torque at speed"][:, 0]
    plain = report.share["torque"][:, 0]
    driving = report.torque[:, 0] > 0
    np.testing.assert_allclose(share[driving], (plain / left)[driving])
    np.testing.assert_array_equal(share[~driving], plain[~driving])
    assert report.tightest(0).quantity == "torque at speed"
    assert report.tightest(0).time == pytest.approx(1.995)


def test_torque_grows_between_samples_where_gravity_does(robot):
    # Joint 2 turns at constant speed from hanging: gravity grows by m g c (1 - cos) within a
    # period, and the last of them is at the end.
    v = np.zeros((11, 4))
    v[:, 1] = 1.0
    motion = Motion.from_speeds(0.005, np.zeros(4), v)
    report = margins(robot, motion)
    grown = np.abs(report.torque[-1, 1])
    assert report.growth[1] == 0  # the last sample is one too, and has the largest
    assert grown == report.peak_torque[1]
    v[-1, 1] = 1.1  # now the last period accelerates, and the last sample does not
    report = margins(robot, Motion.from_speeds(0.005, np.zeros(4), v))
    assert report.growth[1] > 0


def test_a_robot_of_other_joints_is_refused_and_does_not_end_the_process(robot):
    motion = Motion.from_speeds(0.005, np.zeros(3), np.zeros((4, 3)))
    with pytest.raises(InputError, match="motion: 3 joints, robot 'sdt' has 4"):
        margins(robot, motion)
