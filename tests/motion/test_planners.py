"""Both planners, for any robot and any motion profile."""

from __future__ import annotations

import dataclasses

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from motions import least_time
from scipy.spatial import cKDTree
from strategies import profiles, robots

from sdt_drake.io.errors import InputError
from sdt_drake.motion import command_of, commanded_motion, plan_motion, retime
from sdt_drake.robot.device import Drive
from sdt_drake.robot.dynamics import inverse_dynamics
from sdt_drake.robot.motors import as_driven

PERIOD = 0.01


@st.composite
def weak_robots(draw, most, **options):
    """A robot, a command, and what it commands; a share of the torque for moving is missing."""
    falls = draw(st.booleans())  # torque, with the speed of the motors
    robot = draw(robots(st.integers(1, most), **options))
    command = command_of(draw(profiles(robot)), robot)
    commanded = commanded_motion(robot, command, PERIOD)
    torque = np.abs(inverse_dynamics(robot, commanded.q, commanded.v, commanded.vd)).max(axis=0)
    rest = np.zeros_like(commanded.q)
    holding = np.abs(inverse_dynamics(robot, commanded.q, rest, rest)).max(axis=0)
    share, speed, acceleration = (draw(st.floats(0.4, 1.2)) for _ in range(3))
    limits = {
        "effort_limit": holding + share * np.maximum(torque - holding, 0) + 1e-2,
        "velocity_limit": speed * np.abs(commanded.v).max(axis=0) + 1e-2,
        "acceleration_limit": acceleration * np.abs(commanded.vd).max(axis=0) + 1e-1,
    }
    robot = dataclasses.replace(robot, **limits)
    if falls:
        n1, n0 = robot.gear_ratio * limits["velocity_limit"] * np.array([[0.5], [1.5]])
        robot = as_driven(robot, Drive(n1=n1.tolist(), n0=n0.tolist()))
    return robot, command, commanded


def are_kept(robot, plan):
    """Limits of torque at both ends of each period, of speed and of acceleration."""
    q, v, vd = plan.motion.q, plan.motion.v, plan.motion.vd
    np.testing.assert_allclose(plan.torque, inverse_dynamics(robot, q, v, vd), atol=1e-9)
    lowest, highest = robot.torque_range(v)
    assert np.all(plan.torque >= lowest - 2e-6) and np.all(plan.torque <= highest + 2e-6)
    assert np.all(np.abs(v) <= robot.velocity_limit + 2e-6)
    assert np.all(np.abs(vd) <= robot.acceleration_limit + 2e-6)


@settings(max_examples=12)
@given(case=weak_robots(7))
def test_retiming_keeps_all_limits_and_the_path(case):
    robot, command, commanded = case
    plan = retime(robot, command, period=PERIOD)
    are_kept(robot, plan)
    motion = plan.motion
    later = inverse_dynamics(robot, motion.q[1:], motion.v[1:], motion.vd[:-1])
    assert np.all(np.abs(later) <= robot.effort_limit + 2e-6)
    off = np.linalg.norm(motion.vd, axis=1).max() * PERIOD**2 / 4
    fine = commanded_motion(robot, command, PERIOD / 50)
    assert cKDTree(fine.q).query(motion.q)[0].max() <= off + 5e-4
    for end in (0, -1):
        np.testing.assert_allclose(motion.q[end], commanded.q[end], atol=off + 1e-6)
        np.testing.assert_allclose(motion.v[end], 0, atol=1e-9)
    assert plan.longer >= 0 and plan.limited[1].all() == (plan.longer > 0)
    if plan.longer == 0:
        np.testing.assert_array_equal(motion.q, commanded.q)


@settings(max_examples=6)
@given(case=weak_robots(3))
def test_retiming_takes_the_least_time(case):
    robot, command, commanded = case
    plan = retime(robot, command, period=PERIOD)
    least = least_time(robot, commanded)
    assert plan.motion.duration >= 0.99 * least - 3 * PERIOD
    if robot.envelope is None and not robot.damping.any():  # the least time has neither
        assert plan.motion.duration <= 1.01 * least + 3 * PERIOD


@settings(max_examples=20)
@given(case=weak_robots(7))
def test_the_limiter_keeps_all_limits_or_refuses_the_motion(case):
    robot, command, commanded = case
    robot = dataclasses.replace(robot, velocity_limit=np.full(robot.n, np.inf))
    try:
        plan = plan_motion(robot, command, period=PERIOD)
    except InputError as error:
        text = "motion refused: joint" if robot.envelope is None else "joint"
        assert text in str(error) and "\n" not in str(error)
        assume(False)
    are_kept(robot, plan)
    motion, limited = plan.motion, plan.limited
    np.testing.assert_array_equal(motion.q[0], commanded.q[0])
    np.testing.assert_allclose(motion.v[-1], commanded.v[-1], atol=1e-9)
    # A joint is held back by its motor or its acceleration limit, and only then.
    of_torque = np.minimum(*(np.abs(plan.torque - x) for x in robot.torque_range(motion.v)))
    of_acceleration = 1 - np.abs(motion.vd) / robot.acceleration_limit
    left = np.minimum(of_torque / robot.effort_limit, of_acceleration)
    assert np.all(left[limited] < 1e-4)
    if not limited.any():
        np.testing.assert_allclose(motion.v, commanded.v, atol=1e-12)
