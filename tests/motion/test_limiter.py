"""The limiter: the reference motion, motors at their limit, and the motions that it refuses."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from motions import (
    INERTIA_1,
    LIMITS,
    PERIOD,
    alone,
    falling,
    faster,
    knots,
    reference,
    sampled,
    tough_swing,
)

from sdt_drake.io.errors import InputError
from sdt_drake.motion import Motion, checked_torque, commanded_motion, plan_motion, retime
from sdt_drake.motion.command import Course
from sdt_drake.motion.limiter import limit_accelerations
from sdt_drake.motion.segments import Oscillation
from sdt_drake.motion.spin import spin_geometry
from sdt_drake.robot.dynamics import torque_groups


@pytest.fixture(scope="module")
def plan(robot):
    return plan_motion(robot, reference(robot))


def needed_torque(robot, motion: Motion) -> np.ndarray:
    """Torque of links and motors, joint side [N m]."""
    groups = torque_groups(robot, motion.q, motion.v, motion.vd)
    return groups.total + robot.gear_ratio**2 * robot.rotor_inertia * motion.vd


# --- the reference motion --------------------------------------------------------------------


def test_the_reference_motion_needs_no_limiter_and_follows_its_command(robot, plan):
    assert not plan.limited.any() and plan.loss is None
    np.testing.assert_array_equal(np.round(plan.peak_use(robot), 2), [0.82, 0.93, 0.30, 0.23])
    np.testing.assert_allclose(plan.motion.v, reference(robot).speeds(plan.motion.time), atol=1e-12)
    assert (plan.motion.period, plan.motion.duration) == (PERIOD, 30)
    assert (plan.longer, plan.angle_lost.tolist()) == (0, [0] * 4)
    np.testing.assert_array_equal(plan.motion.vd[-1], 0)
    np.testing.assert_allclose(plan.torque, needed_torque(robot, plan.motion), atol=1e-9)
    # As calculated independently.
    angles = np.rad2deg(plan.motion.q[:, 2:])
    np.testing.assert_array_equal(np.round(np.min(angles, axis=0), 1), [-9.9, -10.5])
    np.testing.assert_array_equal(np.round(np.max(angles, axis=0), 1), [1.6, 18.0])


def test_a_start_angle_shifts_all_angles_and_another_period_takes_other_samples(robot, plan):
    q0 = np.array([3.0, 0.0, 0.0, 0.0])  # the planetary angle has no effect on the torques
    coarse = plan_motion(robot, dataclasses.replace(reference(robot), q0=q0), period=0.05)
    assert coarse.motion.q.shape == (601, 4)
    np.testing.assert_allclose(coarse.motion.v, plan.motion.v[::10], atol=1e-12)
    np.testing.assert_allclose(coarse.motion.q, plan.motion.q[::10] + q0, atol=2e-4)


# --- motors at their limit -------------------------------------------------------------------


def test_a_margin_limits_joint_2_alone_and_it_gets_back_on_its_command(robot):
    plan = plan_motion(robot, reference(robot), torque_margin=0.9)
    assert plan.torque_margin == 0.9
    np.testing.assert_array_equal(plan.limited.any(axis=0), [False, True, False, False])
    torque = needed_torque(robot, plan.motion)
    assert np.all(np.abs(torque) <= 0.9 * LIMITS + 1e-6)
    # It accelerates with all that it may use, and less than commanded.
    limited = plan.limited[:, 1]
    np.testing.assert_allclose(np.abs(torque[limited, 1]), 0.9 * 3950, atol=1e-6)
    off = np.abs(plan.motion.v - plan.commanded.v)
    np.testing.assert_array_equal((off > 1e-9).any(axis=0), [False, True, False, False])
    assert 0.01 < np.max(off) < 0.15
    # A sample later its wish is not what was commanded, but what takes it back.
    last = np.flatnonzero(limited)[-1]
    assert off[last + 2 :].max() < 1e-12


def spin_up(*more):
    """Joint 1 from 0 to 1.6 rad/s in 2 s, from 1 s on; the others stand still."""
    return alone(knots([0, 0], [1, 0], [3, 1.6], *more))


def test_a_joint_that_cannot_accelerate_as_commanded_catches_up_later(robot):
    plan = plan_motion(robot, spin_up([6, 1.6]))
    time, v, limited = plan.motion.time, plan.motion.v[:, 0], plan.limited[:, 0]
    reachable = 13655.04 / INERTIA_1 * (time - 1)
    np.testing.assert_allclose(v, np.clip(reachable, 0, 1.6), atol=1e-9)
    np.testing.assert_allclose(plan.torque[limited, 0], 13655.04, atol=1e-6)
    assert (np.flatnonzero(limited)[0], v[-1]) == (200, 1.6)
    assert np.max(np.clip(0.8 * (time - 1), 0, 1.6) - v) > 0.1
    np.testing.assert_array_equal(plan.motion.v[:, 1:], 0)
    # The areas between the ramps, up to where each is at 1.6 rad/s.
    lost = 1.6**2 / 2 * (INERTIA_1 / 13655.04 - 1 / 0.8)
    assert plan.angle_lost == pytest.approx([lost, 0, 0, 0], rel=1e-3)


def test_torque_that_falls_with_speed_limits_driving_and_not_braking(robot):
    """From n1 = 0.5 rad/s on v' = a (n0 - v) / (n0 - n1): an exponential towards n0 = 1.7."""
    a, apart = 13655.04 / INERTIA_1, 1.7 - 0.5
    slow = falling(robot, 0.5, 1.7)
    plan = plan_motion(slow, alone(knots([0, 0], [1, 0], [3, 1.6], [10, 1.6], [13, 0])))
    time, v = plan.motion.time, plan.motion.v[:, 0]
    corner = 1 + 0.5 / a
    along = np.where(
        time < corner, a * (time - 1), 1.7 - apart * np.exp(-a * (time - corner) / apart)
    )
    np.testing.assert_allclose(v[time < 10], np.clip(along, 0, 1.6)[time < 10], atol=3e-3)
    limited, torque = plan.limited[:, 0], plan.torque[:, 0]
    left = 13655.04 * np.clip((1.7 - v) / apart, 0, 1)
    np.testing.assert_allclose(torque[limited], left[limited], atol=1e-6)
    brakes = np.searchsorted(time, 10.1)  # with nine times what is left to drive with
    assert not limited[brakes:].any() and torque[brakes] < -5 * left[brakes]
    same = plan_motion(falling(robot, 8.0, 9.0), spin_up([6, 1.6]))  # never so fast
    np.testing.assert_array_equal(same.motion.v, plan_motion(robot, spin_up([6, 1.6])).motion.v)
    for planned in (plan_motion, checked_torque):
        what = spin_up([6, 1.6])
        what = commanded_motion(robot, what, PERIOD) if planned is checked_torque else what
        said = r"speed 1\.\S+ rad/s, .* 1\.5 rad/s, the no-load speed"
        with pytest.raises(InputError, match=said):
            planned(falling(robot, 0.5, 1.5), what)


def test_the_limiter_counts_gravity_and_viscous_friction(tmp_path):
    arm, swing = tough_swing(tmp_path)
    plan = plan_motion(arm, swing)
    torque, limited = needed_torque(arm, plan.motion)[:, 0], plan.limited[:, 0]
    assert np.sum(limited) > 5
    np.testing.assert_allclose(torque[limited], 45, atol=1e-6)
    assert np.max(np.abs(torque)) <= 45 + 1e-6


@pytest.mark.parametrize("condition", [1, 10, 1e2, 1e3])
def test_limited_accelerations_are_the_optimum(condition):
    # Strictly convex: the conditions hold in one point only. Each joint has its wish, or its motor
    # pulls it there with all it has.
    rng = np.random.default_rng(4)
    seen = set()
    for i in range(60):
        n = 1 + i % 7
        basis, _ = np.linalg.qr(rng.normal(size=(n, n)))
        M = basis * np.geomspace(1, condition, n) @ basis.T
        M = (M + M.T) / 2
        bias = rng.normal(size=n) * np.sqrt(condition)
        wanted = rng.normal(size=n) * 5
        available = rng.uniform(0.5, 6, size=n) * np.sqrt(condition)
        vd = limit_accelerations(M, bias, wanted.copy(), -available, available)
        torque = M @ vd + bias
        assert np.all(np.abs(torque) <= available + 1e-6)
        pull = np.sign(wanted - vd)
        seen |= set(pull)
        np.testing.assert_allclose(torque[pull != 0], (pull * available)[pull != 0], atol=1e-6)
    assert seen == {0, -1, 1}


def test_an_acceleration_limit_is_a_limit_of_the_limiter_too(robot):
    # Joint 1 at 0.4 rad/s² instead of 0.8 from 1 s on, so it is at 1.6 rad/s after 4 s.
    calm = dataclasses.replace(robot, acceleration_limit=np.array([0.4, 9, 9, 9]))
    plan = plan_motion(calm, spin_up([6, 1.6]))
    expected = np.clip(0.4 * (plan.motion.time - 1), 0, 1.6)
    np.testing.assert_allclose(plan.motion.v[:, 0], expected, atol=1e-5)
    assert plan.limited[:, 0].sum() == pytest.approx(800, abs=2)
    # What is exactly at the limit is not limited.
    exact = dataclasses.replace(robot, acceleration_limit=np.array([0.45, 3, 9, 9]))
    assert not plan_motion(exact, reference(robot)).limited[:, 1:].any()


# --- motions that are refused ----------------------------------------------------------------


def test_a_motion_that_overpowers_joint_2_is_refused_with_its_torque(robot):
    # Joint 1 is back on its command when joint 2 fails, so the command tells what is needed.
    fast = faster(robot, 2.95)
    torque = needed_torque(robot, sampled(fast))[:, 1]
    i = np.flatnonzero(np.abs(torque) > 3950)[0]
    with pytest.raises(
        InputError,
        match=rf"joint 2 'roll' at {i * PERIOD:.3f} s needs torque {torque[i]:.6g} N m, "
        r"available ±3950 N m; .* rad/s away from its command",
    ):
        plan_motion(robot, fast)


def test_a_joint_that_is_not_back_on_its_command_at_the_end_is_refused(robot):
    needed, reached = 0.8 * INERTIA_1, 2 * 13655.04 / INERTIA_1
    with pytest.raises(
        InputError,
        match=rf"joint 1 'planetary' at 1\.000 s needs torque {needed:.6g} N m, available ±13655 "
        rf"N m; .*ends at {reached:.4g} rad/s, commanded is 1\.6 rad/s",
    ):
        plan_motion(robot, spin_up())
    # 0.3 rad/s² from 1 to 3 s, where its motor could do more.
    calm = dataclasses.replace(robot, acceleration_limit=np.array([0.3, 9, 9, 9]))
    with pytest.raises(
        InputError,
        match=r"joint 1 'planetary' ends at 0\.6 rad/s, commanded is 1\.6 rad/s; its acceleration "
        r"limit, 0\.3 rad/s²",
    ):
        plan_motion(calm, spin_up())


@pytest.mark.parametrize(
    "field, limits, message",
    [
        # Joint 2 goes from 0 at 2 s to 1.5 rad/s at 2.5 s: 1.4 at 2.4667 s.
        ("velocity_limit", [9, 1.4, 9, 9], "joint 2 'roll' at 2.470 s: needs speed 1.41 rad/s, "
         "available -1.4 to 1.4 rad/s"),
        ("acceleration_limit", [9, 2.0, 9, 9], "joint 2 'roll' at 2.000 s: needs acceleration 3 "
         "rad/s², available -2 to 2 rad/s²"),
        ("position_lower", [-9, -9, -0.1, -9], "joint 3 'pitch' at "),
        ("position_upper", [99, 99, 0.02, 99], "joint 3 'pitch' at "),
        ("effort_limit", [2e4, 3600, 2e4, 2e4], "joint 2 'roll' at 9.000 s: needs torque "),
    ],
)  # fmt: skip
def test_each_limit_of_the_robot_is_checked(robot, plan, field, limits, message):
    limited = dataclasses.replace(robot, **{field: np.array(limits)})
    with pytest.raises(InputError) as error:
        checked_torque(limited, plan.motion)
    assert str(error.value).startswith(message)
    if field.startswith("position"):
        q = plan.motion.q[:, 2]
        i = np.flatnonzero((q < limited.position_lower[2]) | (q > limited.position_upper[2]))[0]
        told = f"at {i * PERIOD:.3f} s: needs position {q[i]:.6g} rad, available "
        assert told in str(error.value)


def test_the_torques_are_given_or_refused_by_the_margin(robot, plan):
    np.testing.assert_allclose(checked_torque(robot, plan.motion), plan.torque, rtol=1e-12)
    i = np.flatnonzero(np.abs(plan.torque[:, 1]) > 0.9 * 3950)[0]
    with pytest.raises(
        InputError,
        match=rf"joint 2 'roll' at {i * PERIOD:.3f} s: needs torque {plan.torque[i, 1]:.6g} N m, "
        "available -3555 to 3555 N m",
    ):
        checked_torque(robot, plan.motion, torque_margin=0.9)


@pytest.mark.parametrize("planner", [plan_motion, retime])
def test_another_number_of_joints_is_refused(robot, planner):
    with pytest.raises(InputError, match="motion 'alone': 3 joints, robot 'sdt' has 4"):
        planner(robot, alone(knots([0, 0], [1, 0]), joints=3))
    with pytest.raises(InputError, match="3 joints, robot 'sdt' has 4"):
        checked_torque(robot, Motion.from_speeds(PERIOD, np.zeros(3), np.zeros((5, 3))))


# --- what a period can show ------------------------------------------------------------------


@pytest.mark.parametrize("period", [0.007, 31.0, -0.005, 0.0, np.nan, np.inf, 1e-310])
def test_a_period_that_does_not_divide_the_duration_is_refused(robot, period):
    with pytest.raises(InputError, match=rf"'reference': duration: .*{period:g} s"):
        commanded_motion(robot, reference(robot), period)


def swing(amplitude, period):
    """10 s of it."""
    rest = knots([0, 0], [10, 0])
    oscillation = Oscillation(amplitude=amplitude, period=period, fade=1, end=9)
    return dataclasses.replace(rest, swings=((0.0, oscillation),))


@pytest.mark.parametrize(
    "joint, lost",
    [
        # Up to 20 rad/s and back within a period: an area of 0.02 rad.
        (knots([0, 0], [1.001, 0], [1.002, 20], [1.003, 0], [10, 0]), 0.02),
        # At every sample the same phase of the swing: what is seen is a steady speed.
        (swing(1e-4, PERIOD), 1e-4 * 2 * np.pi / PERIOD * 8),
        # Four samples of each swing see a triangle of the same speed.
        (swing(0.01, 4 * PERIOD), 0.01 * (1 - np.pi / 4)),
        # A millisecond of noise, of which every fifth value is taken.
        (
            Course.linear(1e-3 * np.arange(10001), [0.0, *([1.0, 0, 0, 0, 0] * 1999), *[0.0] * 5]),
            1999 * 0.001,
        ),
    ],
    ids=["short", "fast swing", "swing of few samples", "fine samples"],
)
def test_what_is_too_short_for_the_period_is_refused_with_the_angle_that_is_lost(
    robot, joint, lost
):
    with pytest.raises(
        InputError, match=r"'alone': joint 2 'roll' at .* a period of 0\.005 s loses .* deg"
    ) as error:
        commanded_motion(robot, alone(joint, 2), PERIOD)
    told = float(str(error.value).partition("loses ")[2].split()[0])
    assert told == pytest.approx(np.degrees(lost), rel=0.02)


def test_a_short_alignment_is_refused_though_its_speed_is_0_at_both_ends(robot):
    ramp = Course(np.array([0, 1.001, 1.004, 2]), np.array([0, 0, 1.0, 1.0]), np.array([True] * 3))
    geometry = spin_geometry(robot, "planetary", "roll", "here")
    with pytest.raises(InputError, match=r"joint 2 'roll' .* loses"):
        whole = dataclasses.replace(alone(ramp), alignment=(1, ramp, geometry))
        commanded_motion(robot, whole, PERIOD)


@pytest.mark.parametrize(
    "joint, told",
    [
        (knots([0, 0], [5, 1e300], [10, 0]), "e\\+297 rad/s, expected at most 10000 rad/s"),
        (knots([0, 0], [5, 0], [5.005, 9e3], [10, 0]), "1.8e\\+06 rad/s², expected at most 1e"),
        (knots([0, 9e3], [200, 9e3]), "1e\\+06 rad, expected at most 1e\\+06 rad"),
        (swing(1e308, 0.001), "nan rad/s, expected"),
    ],
    ids=["speed", "acceleration", "angle", "no number"],
)
def test_a_command_beyond_any_machine_is_refused(robot, joint, told):
    with pytest.raises(InputError, match=rf"'alone': joint 2 'roll' at .* commanded .*{told}"):
        commanded_motion(robot, alone(joint, 2), PERIOD)
