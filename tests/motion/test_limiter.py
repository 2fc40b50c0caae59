"""The limiter: the reference motion, closed forms at the limits, and refused motions."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from motions import INERTIA_1, LIMITS, PERIOD, alone, falling, faster, knots, reference, sampled

from sdt_drake.io.errors import InputError
from sdt_drake.motion import checked_torque, commanded_motion, plan_motion
from sdt_drake.robot.dynamics import inverse_dynamics

A_1 = LIMITS[0] / INERTIA_1  # rad/s²; what joint 1 can do alone


def spin_up(*more):
    """Joint 1 from 0 to 1.6 rad/s in 2 s, from 1 s on; the others stand still."""
    return alone(knots([0, 0], [1, 0], [3, 1.6], *more))


def test_the_reference_motion_needs_no_limiter(robot):
    plan = plan_motion(robot, reference(robot))
    assert not plan.limited.any() and plan.loss is None
    np.testing.assert_array_equal(np.round(plan.peak_use(robot), 2), [0.82, 0.93, 0.30, 0.23])
    np.testing.assert_allclose(plan.motion.v, reference(robot).speeds(plan.motion.time), atol=1e-12)
    # As calculated independently.
    angles = np.rad2deg(plan.motion.q[:, 2:])
    np.testing.assert_array_equal(np.round(np.min(angles, axis=0), 1), [-9.9, -10.5])
    np.testing.assert_array_equal(np.round(np.max(angles, axis=0), 1), [1.6, 18.0])


@pytest.mark.parametrize("limit", [np.inf, 0.4])
def test_a_joint_that_cannot_accelerate_as_commanded_catches_up_later(robot, limit):
    acceleration = min(limit, A_1)  # rad/s²; A_1 takes all of the torque
    calm = dataclasses.replace(robot, acceleration_limit=np.array([limit, 9, 9, 9]))
    plan = plan_motion(calm, spin_up([6, 1.6]))
    expected = np.clip(acceleration * (plan.motion.time - 1), 0, 1.6)
    np.testing.assert_allclose(plan.motion.v[:, 0], expected, atol=1e-5)
    np.testing.assert_array_equal(plan.motion.v[:, 1:], 0)
    limited = np.flatnonzero(plan.limited[:, 0])
    assert (limited[0], len(limited)) == (200, pytest.approx(320 / acceleration, abs=2))
    lost = 1.6**2 / 2 * (1 / acceleration - 1 / 0.8)  # the area between the ramps
    assert plan.angle_lost == pytest.approx([lost, 0, 0, 0], rel=1e-3)


def test_a_speed_beyond_the_no_load_speed_is_refused(robot):
    slow, what = falling(robot, 0.5, 1.5), spin_up([6, 1.6])
    beyond = pytest.raises(InputError, match=r"speed 1\.\S+ rad/s, .* 1\.5 rad/s, .*no-load")
    with beyond:
        plan_motion(slow, what)
    with beyond:
        checked_torque(slow, commanded_motion(slow, what, PERIOD))


# --- refused motions -------------------------------------------------------------------------


def test_a_motion_that_overpowers_joint_2_is_refused_with_its_torque(robot):
    # Joint 1 is back on its command when joint 2 fails: the command gives the needed torque.
    motion = sampled(faster(robot, 2.95))
    torque = inverse_dynamics(robot, motion.q, motion.v, motion.vd)[:, 1]
    i = np.flatnonzero(np.abs(torque) > 3950)[0]
    needs = rf"{i * PERIOD:.3f} s .*torque {torque[i]:.6g} N m, .* ±3950 N m; .* 0\.031 rad/s"
    with pytest.raises(InputError, match=rf"joint 2 'roll' at {needs}"):
        plan_motion(robot, faster(robot, 2.95))


@pytest.mark.parametrize(
    "acceleration, found",
    [
        (9, rf"at 1\.000 s .*torque {0.8 * INERTIA_1:.6g} N m, .* ±13655 N m; .*{2 * A_1:.4g} rad"),
        (0.3, r".* 0\.6 rad/s, .* 1\.6 rad/s; .*0\.3 rad/s²"),  # where its motor could do more
    ],
    ids=["torque", "acceleration"],
)
def test_a_joint_that_is_not_back_on_its_command_at_the_end_is_refused(robot, acceleration, found):
    calm = dataclasses.replace(robot, acceleration_limit=np.full(4, acceleration))
    with pytest.raises(InputError, match=rf"joint 1 'planetary' {found}"):
        plan_motion(calm, spin_up())
