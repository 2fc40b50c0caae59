"""Tracking metrics on recordings whose answers are known."""

from types import SimpleNamespace

import numpy as np
import pytest
from variants import recorded

from sdt_drake.analysis.tracking import (
    constant_speed_segments,
    motor_use,
    stops_passed,
    track,
    track_head,
)
from sdt_drake.motion import Motion

PERIOD = 0.01


def make_motion(*knots):
    """A motion through knots (time, speed, speed, ...), linear between them, from q = 0."""
    times, *speeds = np.transpose(np.array(knots, dtype=float))
    t = np.arange(round(times[-1] / PERIOD) + 1) * PERIOD
    # Rounded, so that a constant speed is one number.
    v = np.stack([np.round(np.interp(t, times, joint), 9) for joint in speeds], axis=1)
    return Motion.from_speeds(PERIOD, np.zeros(len(speeds)), v)


def at(t):
    return round(t / PERIOD)


# Joint 1: rest, ramp, constant for 3 s, ramp, rest. Joint 2 rests. Joint 3 always accelerates.
# Joint 4: constant for 0.9 s only. Joint 5: constant from the first sample to the last.
MOTION = make_motion(
    (0, 0, 0, 0.0, 0, -0.3),
    (1, 0, 0, 0.1, 0, -0.3),
    (2, 0.5, 0, 0.3, 1, -0.3),
    (2.9, 0.5, 0, 0.6, 1, -0.3),
    (5, 0.5, 0, 1.0, 0, -0.3),
    (6, 0, 0, 1.5, 0, -0.3),
)


def test_perfect_tracking_is_zero():
    tracking = track(recorded(MOTION), MOTION)

    for name in (
        "max_abs_speed_error",
        "rms_speed_error",
        "saturated_fraction",
        "max_abs_position_error",
    ):
        np.testing.assert_array_equal(getattr(tracking, name), np.zeros(5), err_msg=name)
    np.testing.assert_array_equal(tracking.constant_speed_error, [0, np.nan, np.nan, np.nan, 0])


def test_largest_and_rms_speed_error():
    t = MOTION.time
    error = np.zeros_like(MOTION.v)
    error[:, 0] = -0.25  # slower than asked for
    error[:, 1] = 0.2 * np.sin(2 * np.pi * t / 6)  # one whole period
    error[at(3), 2] = 0.7  # a single sample
    tracking = track(recorded(MOTION, v=MOTION.v + error), MOTION)

    np.testing.assert_allclose(tracking.max_abs_speed_error, [0.25, 0.2, 0.7, 0, 0], atol=1e-12)
    expected = [0.25, 0.2 / np.sqrt(2), 0.7 / np.sqrt(601), 0, 0]
    np.testing.assert_allclose(tracking.rms_speed_error, expected, rtol=2e-3, atol=1e-12)


def test_constant_speed_error_counts_only_settled_samples():
    # Joint 1 has constant speed from 2 s on, and decelerates from 5 s on; 1 s is for settling.
    error = np.zeros_like(MOTION.v)
    error[: at(3.0), 0] = 9.0
    error[at(3.0) :, 0] = 0.03
    error[at(4.2), 0] = -0.04
    error[at(5.0) :, 0] = 9.0
    tracking = track(recorded(MOTION, v=MOTION.v + error), MOTION)

    assert tracking.constant_speed_error[0] == pytest.approx(0.04)
    assert tracking.max_abs_speed_error[0] == pytest.approx(9.0)


def test_constant_speed_starts_exactly_one_second_after_the_speed_became_constant():
    steady = constant_speed_segments(MOTION)

    assert steady.shape == MOTION.v.shape
    first, last = np.flatnonzero(steady[:, 0])[[0, -1]]
    assert MOTION.time[first] == pytest.approx(3.0)
    assert MOTION.time[last] == pytest.approx(5.0 - PERIOD)
    assert steady[first : last + 1, 0].all()


def test_saturated_fraction_is_the_share_of_the_time():
    saturated = np.zeros_like(MOTION.v)
    saturated[1:151, 0] = 0.5  # half of a quarter of the periods
    saturated[:, 1] = 1.0
    tracking = track(recorded(MOTION, saturated=saturated), MOTION)
    np.testing.assert_allclose(tracking.saturated_fraction, [0.125, 1, 0, 0, 0])


def test_stops_that_are_passed_are_told_by_joint_time_and_angle():
    q, beyond = MOTION.q.copy(), np.zeros_like(MOTION.q)
    beyond[at(2) : at(3), 3] = np.linspace(0.01, 0.02, 100)
    run = recorded(MOTION, q=q, beyond_stop=beyond)
    [line] = stops_passed(run, ["a", "b", "c", "roll", "e"])
    assert f"joint 4 roll passes its stop at 2.000 s, at {q[200, 3]:.4g} rad" in line
    assert "0.02 rad beyond it" in line and "do not act" in line


def test_position_error_does_not_come_from_speed_error():
    q = MOTION.q.copy()
    q[:, 1] -= 0.4
    q[at(2.5), 3] += 0.05
    tracking = track(recorded(MOTION, q=q), MOTION)

    np.testing.assert_allclose(tracking.max_abs_position_error, [0, 0.4, 0, 0.05, 0], atol=1e-12)
    np.testing.assert_array_equal(tracking.max_abs_speed_error, np.zeros(5))


# --- head ---------------------------------------------------------------------------------------


def test_head_of_a_perfect_run_feels_nothing(robot, design):
    head = track_head(recorded(design.motion), robot)
    assert not head.felt.multiples.any() and not head.felt_from_angles.multiples.any()
    np.testing.assert_array_equal(head.reference.specific_force, head.achieved.specific_force)


def test_angles_alone_tilt_the_head(robot, design):
    """At rest with joint 2 off by 1 deg: gravity from the side, at once and for ever."""
    rest = Motion(PERIOD, *np.zeros((3, 101, 4)))
    off = np.radians([0, 1.0, 0, 0])
    head = track_head(recorded(rest, q=rest.q + off), robot)
    for felt in (head.felt, head.felt_from_angles):
        np.testing.assert_allclose(felt.largest[4], 9.81 * np.sin(np.radians(1)) / 0.057)
        assert felt.share == 1 and felt.worst_rotation[1] == 0


def test_speeds_alone_are_not_of_the_angles(robot):
    rest = Motion(PERIOD, *np.zeros((3, 101, 4)))
    v = 0 * rest.v
    v[50:, 3] = np.radians(2)
    head = track_head(recorded(rest, v=v), robot)
    assert not head.felt_from_angles.multiples.any()
    assert head.felt.largest[2] > 2 and 0.4 < head.felt.share < 0.6


# --- motors -------------------------------------------------------------------------------------

LIMITS = SimpleNamespace(motor_torque_limit=np.array([10.0, 20, 5, 8, 1]))


def torques():
    t = MOTION.time
    tau = np.zeros_like(MOTION.v)
    tau[:, 0] = -3.0
    tau[:, 1] = 12 * np.sin(2 * np.pi * t / 6)  # one whole period
    tau[at(2), 2] = -5.0  # a single sample
    tau[:, 3] = np.where(t < 3, 4.0, -8.0)
    return tau


def constant(tau):
    """A run with torque that stays what it is over each period."""
    return recorded(MOTION, tau_peak=np.abs(tau), tau_rms=np.abs(tau))


def test_peak_and_rms_torque():
    use = motor_use(constant(torques()), LIMITS)

    np.testing.assert_allclose(use.peak_torque, [3, 12, 5, 8, 0])
    expected = [3, 12 / np.sqrt(2), 5 / np.sqrt(600), np.sqrt((299 * 16 + 301 * 64) / 600), 0]
    np.testing.assert_allclose(use.rms_torque, expected, rtol=1e-12)


def test_shares_are_of_the_motors_largest_torque():
    use = motor_use(constant(torques()), LIMITS)

    np.testing.assert_allclose(use.peak_share, [0.3, 0.6, 1.0, 1.0, 0.0])
    np.testing.assert_allclose(use.rms_share * [10, 20, 5, 8, 1], use.rms_torque)
