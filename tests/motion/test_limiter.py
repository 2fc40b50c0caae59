"""The limiter: the reference motion, closed forms at the limits, and refused motions."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motions import INERTIA_1, LIMITS, PERIOD, alone, falling, faster, knots, reference, sampled
from strategies import GENERATORS

from sdt_drake.io.errors import InputError
from sdt_drake.motion import checked_torque, commanded_motion, plan_motion
from sdt_drake.motion.limiter import limit_accelerations
from sdt_drake.robot.dynamics import torque_groups

A_1 = LIMITS[0] / INERTIA_1  # rad/s²; what joint 1 can do alone


def needed_torque(robot, motion) -> np.ndarray:
    """Torque of links and motors, joint side [N m]."""
    groups = torque_groups(robot, motion.q, motion.v, motion.vd)
    return groups.total + robot.gear_ratio**2 * robot.rotor_inertia * motion.vd


def spin_up(*more):
    """Joint 1 from 0 to 1.6 rad/s in 2 s, from 1 s on; the others stand still."""
    return alone(knots([0, 0], [1, 0], [3, 1.6], *more))


def test_the_reference_motion_needs_no_limiter(robot):
    plan = plan_motion(robot, reference(robot))
    assert not plan.limited.any() and plan.loss is None
    np.testing.assert_array_equal(np.round(plan.peak_use(robot), 2), [0.82, 0.93, 0.30, 0.23])
    np.testing.assert_allclose(plan.motion.v, reference(robot).speeds(plan.motion.time), atol=1e-12)
    assert (plan.motion.period, plan.motion.duration, plan.longer) == (PERIOD, 30, 0)
    np.testing.assert_allclose(plan.torque, needed_torque(robot, plan.motion), atol=1e-9)
    # As calculated independently.
    angles = np.rad2deg(plan.motion.q[:, 2:])
    np.testing.assert_array_equal(np.round(np.min(angles, axis=0), 1), [-9.9, -10.5])
    np.testing.assert_array_equal(np.round(np.max(angles, axis=0), 1), [1.6, 18.0])


def test_a_joint_that_cannot_accelerate_as_commanded_catches_up_later(robot):
    plan = plan_motion(robot, spin_up([6, 1.6]))
    time, v, limited = plan.motion.time, plan.motion.v[:, 0], plan.limited[:, 0]
    np.testing.assert_allclose(v, np.clip(A_1 * (time - 1), 0, 1.6), atol=1e-9)
    np.testing.assert_allclose(plan.torque[limited, 0], 13655.04, atol=1e-6)
    assert (np.flatnonzero(limited)[0], v[-1]) == (200, 1.6)
    np.testing.assert_array_equal(plan.motion.v[:, 1:], 0)
    lost = 1.6**2 / 2 * (1 / A_1 - 1 / 0.8)  # the area between the ramps
    assert plan.angle_lost == pytest.approx([lost, 0, 0, 0], rel=1e-3)
    # An acceleration limit of 0.4 rad/s²: at 1.6 rad/s after 4 s.
    calm = dataclasses.replace(robot, acceleration_limit=np.array([0.4, 9, 9, 9]))
    plan = plan_motion(calm, spin_up([6, 1.6]))
    expected = np.clip(0.4 * (time - 1), 0, 1.6)
    np.testing.assert_allclose(plan.motion.v[:, 0], expected, atol=1e-5)
    assert plan.limited[:, 0].sum() == pytest.approx(800, abs=2)


def test_torque_that_falls_with_speed_limits_driving_and_not_braking(robot):
    """From n1 = 0.5 rad/s on v' = a (n0 - v) / (n0 - n1): an exponential towards n0 = 1.7."""
    apart, corner = 1.7 - 0.5, 1 + 0.5 / A_1
    what = alone(knots([0, 0], [1, 0], [3, 1.6], [10, 1.6], [13, 0]))
    plan = plan_motion(falling(robot, 0.5, 1.7), what)
    time, v = plan.motion.time, plan.motion.v[:, 0]
    falls = 1.7 - apart * np.exp(-A_1 * (time - corner) / apart)
    along = np.clip(np.where(time < corner, A_1 * (time - 1), falls), 0, 1.6)
    np.testing.assert_allclose(v[time < 10], along[time < 10], atol=3e-3)
    limited, torque = plan.limited[:, 0], plan.torque[:, 0]
    left = 13655.04 * np.clip((1.7 - v) / apart, 0, 1)
    np.testing.assert_allclose(torque[limited], left[limited], atol=1e-6)
    brakes = np.searchsorted(time, 10.1)  # with nine times what is left to drive with
    assert not limited[brakes:].any() and torque[brakes] < -5 * left[brakes]
    slow, what = falling(robot, 0.5, 1.5), spin_up([6, 1.6])
    for planned in (
        lambda: plan_motion(slow, what),
        lambda: checked_torque(slow, commanded_motion(slow, what, PERIOD)),
    ):
        with pytest.raises(InputError, match=r"speed 1\.\S+ rad/s, .* 1\.5 rad/s, .*no-load"):
            planned()


@given(n=st.integers(1, 7), condition=st.sampled_from([1, 10, 1e2, 1e3]), rng=GENERATORS)
def test_limited_accelerations_are_the_optimum(n, condition, rng):
    """Strictly convex: in one point each joint has its target or its motor pulls with its limit."""
    basis, _ = np.linalg.qr(rng.normal(size=(n, n)))
    M = basis * np.geomspace(1, condition, n) @ basis.T
    M, bias = (M + M.T) / 2, rng.normal(size=n) * np.sqrt(condition)
    target = rng.normal(size=n) * 5
    available = rng.uniform(0.5, 6, size=n) * np.sqrt(condition)
    vd = limit_accelerations(M, bias, target.copy(), -available, available)
    torque, pull = M @ vd + bias, np.sign(target - vd)
    assert np.all(np.abs(torque) <= available + 1e-6)
    np.testing.assert_allclose(torque[pull != 0], (pull * available)[pull != 0], atol=1e-6)


# --- refused motions -------------------------------------------------------------------------


def test_a_motion_that_overpowers_joint_2_is_refused_with_its_torque(robot):
    # Joint 1 is back on its command when joint 2 fails: the command gives the needed torque.
    fast = faster(robot, 2.95)
    torque = needed_torque(robot, sampled(fast))[:, 1]
    i = np.flatnonzero(np.abs(torque) > 3950)[0]
    with pytest.raises(
        InputError,
        match=rf"joint 2 'roll' at {i * PERIOD:.3f} s .*torque {torque[i]:.6g} N m, .* ±3950 N m; "
        r".* rad/s away .* 0\.031 rad/s",
    ):
        plan_motion(robot, fast)


def test_a_joint_that_is_not_back_on_its_command_at_the_end_is_refused(robot):
    with pytest.raises(
        InputError,
        match=rf"joint 1 'planetary' at 1\.000 s .*torque {0.8 * INERTIA_1:.6g} N m, .* ±13655 N m;"
        rf" .*{2 * A_1:.4g} rad/s, commanded is 1\.6 rad/s",
    ):
        plan_motion(robot, spin_up())
    # 0.3 rad/s² from 1 to 3 s, where its motor could do more.
    calm = dataclasses.replace(robot, acceleration_limit=np.array([0.3, 9, 9, 9]))
    with pytest.raises(InputError, match=r"joint 1 .* 0\.6 rad/s, .* 1\.6 rad/s; .*0\.3 rad/s²"):
        plan_motion(calm, spin_up())
