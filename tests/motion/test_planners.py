"""Both planners: laws for any robot and motion profile, closed forms, and refused motions."""

import dataclasses

import numpy as np
import pytest
from helpers.motions import A_1, INERTIA_1, LIMITS, PERIOD, SWING, alone, falling, knots, sampled
from helpers.robots import ARM, loaded
from helpers.strategies import profiles, robots
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from scipy.spatial import cKDTree

from sdt_drake.io.errors import InputError
from sdt_drake.motion import (
    Command,
    checked_torque,
    command_of,
    commanded_motion,
    load_command,
    plan_motion,
    retime,
)
from sdt_drake.motion.profile import MotionProfile, Track
from sdt_drake.motion.smooth import Spline
from sdt_drake.robot.device import Drive
from sdt_drake.robot.dynamics import inverse_dynamics
from sdt_drake.robot.motors import as_driven

H = 0.01  # s, period of the random motions

# --- any robot -------------------------------------------------------------------------------


def at_gears(robot, q, v, vd):
    """Torques of the motors times the ratios of their gears [N m]."""
    return robot.motor_torque(inverse_dynamics(robot, q, v, vd)) * robot.gear_ratio


@st.composite
def weak_robots(draw, most):
    """A robot, a command, and what it commands; a share of the torque for moving is missing.

    Its motors may turn with two joints, as in wrists.
    """
    robot = draw(robots(st.integers(1, most), coupled=draw(st.booleans())))
    command = command_of(draw(profiles(robot)), robot)
    commanded = commanded_motion(robot, command, H)
    torque = np.abs(at_gears(robot, commanded.q, commanded.v, commanded.vd)).max(axis=0)
    rest = np.zeros_like(commanded.q)
    holding = np.abs(at_gears(robot, commanded.q, rest, rest)).max(axis=0)
    share, speed, acceleration = (draw(st.floats(0.4, 1.2)) for _ in range(3))
    limits = {
        "effort_limit": holding + share * np.maximum(torque - holding, 0) + 1e-2,
        "velocity_limit": speed * np.abs(commanded.v).max(axis=0) + 1e-2,
        "acceleration_limit": acceleration * np.abs(commanded.vd).max(axis=0) + 1e-1,
    }
    robot = dataclasses.replace(robot, **limits)
    if draw(st.booleans()):  # torque falls with the speed of the motors
        fastest = speed * np.abs(robot.of_motors(commanded.v)).max(axis=0) + robot.gear_ratio / 100
        n1, n0 = fastest * np.array([[0.5], [1.5]])
        robot = as_driven(robot, Drive(n1=n1.tolist(), n0=n0.tolist()))
    return robot, command, commanded


def are_kept(robot, plan):
    """Limits of torque, of speed and of acceleration, of joints and of motors."""
    q, v, vd = plan.motion.q, plan.motion.v, plan.motion.vd
    np.testing.assert_allclose(plan.torque, inverse_dynamics(robot, q, v, vd), atol=1e-9)
    lowest, highest = robot.torque_range(v)
    torque = at_gears(robot, q, v, vd)
    assert np.all(torque >= lowest - 2e-6) and np.all(torque <= highest + 2e-6)
    assert np.all(np.abs(v) <= robot.velocity_limit + 2e-6)
    if robot.envelope is not None:
        assert np.all(np.abs(robot.of_motors(v)) <= robot.envelope.n0 * (1 + 1e-6))
    assert np.all(np.abs(vd) <= robot.acceleration_limit + 2e-6)


@settings(max_examples=8)
@given(case=weak_robots(7))
def test_retiming_keeps_limits_and_path(case):
    robot, command, commanded = case
    plan = retime(robot, command, period=H)
    are_kept(robot, plan)
    motion = plan.motion
    later = at_gears(robot, motion.q[1:], motion.v[1:], motion.vd[:-1])
    assert np.all(np.abs(later) <= robot.effort_limit + 2e-6)
    off = np.linalg.norm(motion.vd, axis=1).max() * H**2 / 4
    fine = commanded_motion(robot, command, H / 20)
    assert cKDTree(fine.q).query(motion.q)[0].max() <= off + 5e-4
    np.testing.assert_allclose(motion.q[[0, -1]], commanded.q[[0, -1]], atol=off + 1e-6)
    np.testing.assert_allclose(motion.v[[0, -1]], 0, atol=1e-9)
    assert plan.longer >= 0 and plan.limited[1].all() == (plan.longer > 0)
    if plan.longer == 0:
        np.testing.assert_array_equal(motion.q, commanded.q)


@pytest.mark.oracle
@settings(max_examples=4)
@given(case=weak_robots(3))
def test_retiming_takes_least_time(case):
    """One linear program of x = s'^2 at all samples, without friction.

    Of two x within the limits, so is the larger at each sample: the fastest has the largest sum.
    In a cell s'' = (x[i+1] - x[i]) / (2 h); torques and accelerations are limited at both its ends.
    """
    robot, command, motion = case
    count = len(motion.q) - 1
    rest, rows, most = np.zeros_like(motion.q[1:]), [], []
    start, end = np.eye(count, count + 1), np.eye(count, count + 1, 1)  # x at the ends of cells
    limit = np.concatenate([robot.effort_limit, np.minimum(robot.acceleration_limit, 1e9)])
    for j, x in enumerate((start, end)):
        q, v, vd = motion.q[j : count + j], motion.v[j : count + j], motion.vd[:-1]
        gravity = at_gears(robot, q, rest, rest)
        inertia = at_gears(robot, q, rest, v) - gravity
        friction = robot.motor_torque(robot.damping * v) * robot.gear_ratio
        velocity = at_gears(robot, q, v, vd) - gravity - friction
        of_s2, of_x = np.hstack([inertia, v])[..., None], np.hstack([velocity, vd])[..., None]
        row = of_s2 * (end - start)[:, None] / (2 * H) + of_x * x[:, None]
        rows += [row, -row]
        most += [limit - np.hstack([gravity, rest]), limit + np.hstack([gravity, rest])]
    speed = np.max(np.abs(motion.v) / robot.velocity_limit, axis=1)
    top = 1 / np.maximum(speed, 1) ** 2
    top[[0, -1]] = 0
    A = np.reshape(rows, (-1, count + 1))
    x = linprog(-(top**0), A_ub=A, b_ub=np.ravel(most), bounds=np.column_stack([0 * top, top])).x
    s_dot = np.sqrt(np.maximum(x, 0))
    least = np.sum(2 * H / (s_dot[1:] + s_dot[:-1]))
    duration = retime(robot, command, period=H).motion.duration
    assert duration >= 0.99 * least - 3 * H
    if robot.envelope is None and not robot.damping.any():  # the least time has neither
        assert duration <= 1.01 * least + 3 * H


@settings(max_examples=12)
@given(case=weak_robots(7))
def test_limiter_keeps_limits_or_refuses(case):
    robot, command, commanded = case
    robot = dataclasses.replace(robot, velocity_limit=np.full(robot.n, np.inf))
    try:
        plan = plan_motion(robot, command, period=H)
    except InputError as error:
        told = robot.envelope is None and "acceleration" not in str(error)
        assert ("motion refused: joint" if told else "joint") in str(error)
        assert robot.is_coupled or "needs acceleration" not in str(error)
        assume(False)
    are_kept(robot, plan)
    motion, limited = plan.motion, plan.limited
    np.testing.assert_array_equal(motion.q[0], commanded.q[0])
    np.testing.assert_allclose(motion.v[-1], commanded.v[-1], atol=1e-9)
    # A joint is held back by a motor that turns with it or its acceleration limit, and only then.
    torque = at_gears(robot, motion.q, motion.v, motion.vd)
    of_torque = np.minimum(*(np.abs(torque - x) for x in robot.torque_range(motion.v)))
    weak = of_torque / robot.effort_limit < 1e-4
    turned = np.linalg.inv(robot.coupling) != 0
    at_limit = (weak[:, None] & turned).any(axis=2)
    at_limit |= 1 - np.abs(motion.vd) / robot.acceleration_limit < 1e-4
    assert np.all(at_limit[limited])
    if not limited.any():
        np.testing.assert_allclose(motion.v, commanded.v, atol=1e-12)


# --- closed forms ----------------------------------------------------------------------------


def spin_up(*more):
    """Joint 1 from 0 to 1.6 rad/s in 2 s, from 1 s on."""
    return alone(knots([0, 0], [1, 0], [3, 1.6], *more))


@pytest.mark.parametrize("limit", [np.inf, 0.4])
def test_limited_joint_catches_up_later(robot, limit):
    acceleration = min(limit, A_1)  # rad/s²; A_1 takes all of the torque
    calm = dataclasses.replace(robot, acceleration_limit=np.array([limit, 9, 9, 9]))
    plan = plan_motion(calm, spin_up([6, 1.6]))
    expected = np.clip(acceleration * (plan.motion.time - 1), 0, 1.6)
    np.testing.assert_allclose(plan.motion.v[:, 0], expected, atol=1e-5)
    limited = np.flatnonzero(plan.limited[:, 0])
    assert (limited[0], len(limited)) == (200, pytest.approx(320 / acceleration, abs=2))
    summary = plan.summary()
    told = summary.rows[0][list(summary.header).index("held back [s]")]
    assert float(told) == pytest.approx(len(limited) * PERIOD, abs=1e-3)
    lost = 1.6**2 / 2 * (1 / acceleration - 1 / 0.8)  # the area between the ramps
    assert plan.angle_lost == pytest.approx([lost, 0, 0, 0], rel=1e-3)


def test_limiter_counts_both_joints_of_a_coupled_motor():
    """Upright axes 0.8 m apart, the second through its link's centre: M is constant.

    Motor 2 turns at 4 (v_2 - v_1), so motor 1 carries tau_1 + tau_2. Joint 1 is to reach 2 rad/s in
    0.1 s. Motor 2 does as commanded, -20 rad/s² at its gear, while motor 1 is too weak.
    """
    text = ARM.replace("0 1 0</xyz>", "0 0 1</xyz>").replace("<sdf ", '<sdf xmlns:sdt="urn:s" ')
    text = text.replace("<pose>0.3 0 0", "<pose>0 0 0").replace("g>0.7", "g>0")
    turns = (
        '<sdt:turns_with joint="shoulder">-4</sdt:turns_with><drake:gear_ratio>4</drake:gear_ratio>'
    )
    arm = loaded(text.replace("40</effort></limit></axis>", f"40</effort></limit></axis>{turns}"))
    one, two = 0.6 + 4 * 0.5**2 + 2 * 0.8**2 + 10**2 * 0.01, 0.25
    own = one + two + 2 * two + two  # of motor 1: M_11 + 2 M_12 + M_22
    limit = (one + two) * 20 * 0.9
    arm = dataclasses.replace(arm, effort_limit=np.array([limit, 1e3]))
    plan = plan_motion(arm, alone(knots([0, 0], [0.1, 2], [0.5, 2]), joints=2))
    slow = (limit + 2 * two * 20) / own  # rad/s², of joint 1 in the ramp
    time = plan.motion.time
    late = np.minimum(slow * 0.1 + limit / own * (time - 0.1), 2)
    first = np.where(time < 0.1, slow * time, late)
    np.testing.assert_allclose(plan.motion.v[:, 0], first, atol=1e-6)
    np.testing.assert_allclose(plan.motion.v[:, 1], first - np.minimum(20 * time, 2), atol=1e-6)
    assert plan.peak_use(arm)[0] == pytest.approx(1, abs=1e-6)


def test_falling_torque_makes_retiming_an_exponential(robot):
    """Of a path from rest to rest: v' = a (n0 - v) / (n0 - n1) up, and braking with all of a."""
    n1, n0, angle, h = 0.5, 1.7, 5.0, 1e-5
    v, q, up = 0.0, 0.0, 0.0
    while q + v**2 / (2 * A_1) < angle:
        v += h * A_1 * min(1, (n0 - v) / (n0 - n1))
        q, up = q + h * v, up + h
    least = up + v / A_1
    plan = retime(falling(robot, n1, n0), alone(knots([0, 0], [1, 2.5], [2, 2.5], [3, 0])))
    assert least <= plan.motion.duration <= 1.005 * least + 3 * PERIOD
    left = LIMITS[0] * np.clip((n0 - plan.motion.v[:, 0]) / (n0 - n1), 0, 1)
    driving = plan.torque[:, 0] > 0
    assert np.quantile((plan.torque[:, 0] / left)[driving], 0.1) > 0.99


def test_viscous_friction_slows_only_where_torque_is_short():
    # About a vertical axis: J v' = tau - d v, with v = tau / d at most and 2 rad/s commanded.
    turned = loaded(ARM.replace("0 1 0</xyz>", "0 0 1</xyz>").replace("g>0.7", "g>20"))
    limits = {"effort_limit": np.array([30, 40]), "position_upper": np.full(2, np.inf)}
    arm = dataclasses.replace(turned, **limits)
    J, tau, d = 0.6 + 4 * 0.5**2 + 0.25 + 2 * 1.1**2 + 10**2 * 0.01, 30, 20
    plan = retime(arm, alone(knots([0, 0], [0.1, 2], [3.1, 2], [3.2, 0]), joints=2))
    # Up and down with all the torque: the times and ways of both are closed forms.
    v = 0.999 * tau / d
    up, down = -J / d * np.log(1 - d * v / tau), J / d * np.log(1 + d * v / tau)
    ways = (tau * up - J * v) / d + (J * v - tau * down) / d
    expected = up + down + (6.2 - ways) / v
    assert plan.motion.duration == pytest.approx(expected, rel=0.015)


def test_retiming_spins_a_joint_up_with_all_its_torque_and_ends_at_speed(robot):
    """v = a (t - 1) up to 1.6 rad/s; what is left of the path of 6.4 rad at that speed."""
    duration = 1 + 1.6 / A_1 + (6.4 - 1.6**2 / (2 * A_1)) / 1.6
    motion = retime(robot, spin_up([6, 1.6])).motion
    # A period of rest at the start, another to make the duration whole, a third for the grid.
    assert duration <= motion.duration <= duration + 3 * PERIOD
    start = 1 + motion.duration - duration
    expected = np.clip(A_1 * (motion.time - start), 0, 1.6)
    np.testing.assert_allclose(motion.v[:, 0], expected, atol=A_1 * 2 * PERIOD)
    assert motion.v[-1, 0] == pytest.approx(1.6, abs=1e-6)
    # At the end of the path it is where the command would be a little later, at its speed.
    assert 6.4 - 1e-6 <= motion.q[-1, 0] <= 6.4 + 1.6 * (motion.duration - duration)


# --- refused motions -------------------------------------------------------------------------


def test_speed_beyond_no_load_speed_is_refused(robot):
    slow, what = falling(robot, 0.5, 1.5), spin_up([6, 1.6])
    for use in (plan_motion, lambda *_: checked_torque(slow, sampled(what))):
        with pytest.raises(InputError, match=r"speed 1\.\S+ rad/s, .* 1\.5 rad/s, .*no-load"):
            use(slow, what)


def test_motion_beyond_torque_of_joint_2_is_refused_with_its_torque(robot):
    weak = dataclasses.replace(robot, effort_limit=LIMITS * [1, 0.8, 1, 1])
    command = load_command("reference", robot)
    motion = sampled(command)
    torque = inverse_dynamics(robot, motion.q, motion.v, motion.vd)[:, 1]
    i = np.flatnonzero(np.abs(torque) > 3160)[0]
    needs = rf"{i * PERIOD:.3f} s .*torque {torque[i]:.6g} N m, .* ±3160 N m; .* 0\.031 rad/s"
    with pytest.raises(InputError, match=rf"joint 2 'roll' at {needs}"):
        plan_motion(weak, command)


@pytest.mark.parametrize("planner", [plan_motion, retime])
def test_motor_that_cannot_hold_its_link_is_refused(planner):
    arm = loaded(ARM.replace("<effort>40", "<effort>3"))
    needed = -2 * 9.81 * 0.3  # N m: 2 kg at 0.3 m
    with pytest.raises(InputError, match=rf"joint 2 'elbow'.* 0\.000 s.* {needed:g} N m.*±3 N m"):
        planner(arm, alone(knots([0, 0], [1, 0]), joints=2))


@pytest.mark.parametrize("when, speeds", [("start", (1.0, -1.0)), ("end", (0.0, 1.0))])
def test_end_in_motion_beyond_torque_is_refused_with_its_torque(robot, when, speeds):
    needed = (speeds[1] - speeds[0]) * INERTIA_1  # N m, in 1 s
    told = rf"joint 1 'planetary' needs torque {needed:.6g} N m, available ±682\.752 N m"
    with pytest.raises(InputError, match=rf"'alone' refused: at its {when}, in motion, {told}"):
        retime(robot, alone(knots([0, speeds[0]], [1, speeds[1]])), torque_margin=0.05)


def test_end_in_motion_names_the_joint_that_lacks_most(robot):
    speeds = (knots([0, 1], [0.2, 0.9]), knots([0, 0.1], [0.2, 0]), *[knots([0, 0], [0.2, 0])] * 2)
    command = Command("both", 0.2, np.zeros(4), speeds)
    motion = sampled(command)
    needed = np.abs(at_gears(robot, motion.q, motion.v, motion.vd)[0])
    weak = dataclasses.replace(robot, effort_limit=(needed + 1) / [1.2, 1.8, 0.1, 0.1])
    with pytest.raises(InputError, match="at its start, in motion, joint 2 'roll' needs"):
        retime(weak, command)


# 45000 rad at the speed limit; nothing but inertia: times go with the root of the torque.
@pytest.mark.parametrize("speed, margin", [(9000, 1), (1, 1e-300)])
def test_retiming_beyond_100_times_the_duration_is_refused(robot, speed, margin):
    with pytest.raises(InputError, match=r"'alone' refused: .* most 100 times as long"):
        retime(robot, alone(knots([0, 0], [5, speed], [10, 0])), torque_margin=margin)


@pytest.mark.parametrize(
    "rest, acceleration, found",
    [
        (1, 9, rf".*torque {0.8 * INERTIA_1:.6g} N m, .* ±13655 N m; .*{2 * A_1:.4g} rad"),
        (0, 9, rf".*torque {0.8 * INERTIA_1:.6g} N m, .* ±13655 N m; .*{2 * A_1:.4g} rad"),
        (1, 0.3, r".* 0\.6 rad/s, .* 1\.6 rad/s; .*0\.3 rad/s²"),  # where its motor could do more
    ],
    ids=["torque", "torque at once", "acceleration"],
)
def test_joint_off_its_command_at_the_end_is_refused(robot, rest, acceleration, found):
    calm = dataclasses.replace(robot, acceleration_limit=np.full(4, acceleration))
    at = rf"at {rest}\.000 s" if acceleration == 9 else ""
    with pytest.raises(InputError, match=rf"joint 1 'planetary' {at}{found}"):
        plan_motion(calm, alone(knots([0, 0], [max(rest, 1e-9), 0], [rest + 2, 1.6])))


def test_retimed_motion_of_too_many_periods_is_refused(robot):
    slow = retime(robot, SWING, torque_margin=0.65, max_periods=840)
    assert 4 < slow.motion.duration < 4.2 and slow.limited[:, 0].all()
    with pytest.raises(InputError, match=r"'alone' refused: .* 1\.05 times as long .*, 4 s"):
        retime(robot, SWING, torque_margin=0.5, max_periods=840)


def test_retiming_goes_through_waypoints_without_stopping():
    """Times that are far too short: both joints are as fast as the torques of one of them allow."""
    robot, points = loaded(ARM), np.array([[0, 0, 0], [0.1, 20, -30], [0.2, 30, 20], [0.3, -9, 70]])
    tracks = [
        Track(joint=name, segments=[Spline(points=points[:, [0, k]])])
        for k, name in enumerate(robot.joint_names, 1)
    ]
    command = command_of(MotionProfile(duration=0.3, tracks=tracks), robot)
    plan = retime(robot, command, period=PERIOD)
    assert plan.motion.duration > 1.5 * command.duration
    tree = cKDTree(np.degrees(plan.motion.q))
    apart, at = tree.query(points[:, 1:])
    assert apart.max() < 0.5 and np.all(np.diff(at) > 0)
    speed = np.abs(plan.motion.v).max(axis=1)
    assert speed[at[0] + 5 : at[-1] - 5].min() > 0.1  # rad/s, nowhere at rest
    use = np.abs(plan.torque).max(axis=0) / robot.effort_limit
    assert 0.98 < use.max() <= 1 + 1e-9
