"""The planner that slows down, against paths, torques and times computed another way."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from motions import (
    INERTIA_1,
    LIMITS,
    PERIOD,
    SHORT,
    alone,
    command,
    falling,
    faster,
    knots,
    tough_swing,
    write_robot,
)
from scipy.optimize import linprog
from scipy.sparse import csr_array
from test_robot import ARM, chain_sdf

from sdt_drake.io.errors import InputError
from sdt_drake.motion import Command, Motion, commanded_motion, plan_motion, retime, retiming
from sdt_drake.robot.dynamics import inverse_dynamics


def torque_of(robot, q, v, vd) -> np.ndarray:
    """Joint torques of one sample [N m]."""
    return inverse_dynamics(robot, *(np.array([x]) for x in (q, v, vd)))[0]


def torques(robot, motion: Motion, later: int = 0) -> np.ndarray:
    """At the start (0) or the end (1) of every period [N m]."""
    end = len(motion.q) - 1 + later
    return inverse_dynamics(robot, motion.q[later:end], motion.v[later:end], motion.vd[:-1])


def dense_path(whole, step: float = 5e-4) -> np.ndarray:
    """The commanded path, integrated finely."""
    time = step * np.arange(round(whole.duration / step) + 1)
    v = whole.speeds(time)
    steps = np.cumsum((v[1:] + v[:-1]) * step / 2, axis=0)
    return whole.q0 + np.vstack([np.zeros_like(v[:1]), steps])


def distance(points: np.ndarray, path: np.ndarray) -> float:
    """Largest distance of points to a polyline [rad]; both go one way."""
    worst, at = 0.0, 0
    for point in points:
        first = max(at - 20, 0)
        near = slice(first, at + 2000)
        start, end = path[near][:-1], path[near][1:]
        along = end - start
        length = np.maximum(np.sum(along**2, axis=1), 1e-30)
        share = np.clip(np.sum((point - start) * along, axis=1) / length, 0, 1)
        off = np.linalg.norm(start + share[:, None] * along - point, axis=1)
        at = first + int(np.flatnonzero(off <= off.min() + 1e-12)[-1])  # it may have rested
        worst = max(worst, off.min())
    return worst


# --- what the limiter refuses ----------------------------------------------------------------


def test_a_motion_that_the_limiter_refuses_keeps_its_path_within_the_torques(robot):
    margin = 0.7 * plan_motion(robot, SHORT).peak_use(robot).max()
    with pytest.raises(InputError, match=r"motion refused: joint \d .* needs torque"):
        plan_motion(robot, SHORT, torque_margin=margin)
    plan = retime(robot, SHORT, torque_margin=margin)
    motion, path = plan.motion, dense_path(SHORT)
    assert distance(motion.q, path) < 1e-4
    for ends in (0, -1):
        np.testing.assert_allclose(motion.q[ends], path[ends], atol=1e-4)
        np.testing.assert_allclose(motion.v[ends], 0, atol=1e-9)
    for later in (0, 1):
        assert np.all(np.abs(torques(robot, motion, later)) <= margin * LIMITS + 1e-6)
    np.testing.assert_allclose(plan.torque[:-1], torques(robot, motion), atol=1e-6)
    # It is not slower than it must be: where it is held back, a motor gives all that it may.
    busiest = np.max(np.abs(plan.torque) / (margin * LIMITS), axis=1)
    held = plan.limited[:, 0]
    assert np.quantile(busiest[held], 0.1) > 0.99
    assert 0.1 < plan.longer < 3
    assert np.all(np.abs(motion.v).max(axis=0) <= np.array([0.45, 1.5, 0.1, 0.2]) + 1e-6)


def test_a_feasible_command_comes_back_as_it_is(robot):
    plan, limiter = (planner(robot, SHORT) for planner in (retime, plan_motion))
    for name in ("q", "v", "vd"):
        np.testing.assert_array_equal(getattr(plan.motion, name), getattr(limiter.motion, name))
    np.testing.assert_array_equal(plan.torque, limiter.torque)
    assert not plan.limited.any() and plan.longer == 0


# --- closed forms ----------------------------------------------------------------------------


def test_torque_that_falls_with_speed_makes_the_fastest_timing_an_exponential(robot):
    """Of a path from rest to rest: v' = a (n0 - v) / (n0 - n1) up, and braking with all of a."""
    a, n1, n0 = 13655.04 / INERTIA_1, 0.5, 1.7
    tau, angle, h = (n0 - n1) / a, 5.0, 1e-5
    v, q, up = 0.0, 0.0, 0.0
    while q + v**2 / (2 * a) < angle:
        v += h * min(a, (n0 - v) / tau)
        q, up = q + h * v, up + h
    plan = retime(falling(robot, n1, n0), alone(knots([0, 0], [1, 2.5], [2, 2.5], [3, 0])))
    assert plan.motion.q[-1, 0] == pytest.approx(angle, abs=1e-4)
    assert up + v / a <= plan.motion.duration <= 1.005 * (up + v / a) + 3 * PERIOD
    left = 13655.04 * np.clip((n0 - plan.motion.v[:, 0]) / (n0 - n1), 0, 1)
    driving = plan.torque[:, 0] > 0
    assert np.all((plan.torque[:, 0] <= left + 1e-6)[driving])
    assert np.quantile((plan.torque[:, 0] / left)[driving], 0.1) > 0.99


def test_a_single_joint_spins_up_with_all_its_motor_has_and_ends_at_speed(robot):
    # v = a (t - 1) up to 1.6 rad/s; the path of 6.4 rad takes what is left of it at that speed.
    a = 13655.04 / INERTIA_1
    duration = 1 + 1.6 / a + (1.6 + 4.8 - 1.6**2 / (2 * a)) / 1.6
    plan = retime(robot, alone(knots([0, 0], [1, 0], [3, 1.6], [6, 1.6])))
    motion = plan.motion
    # A period of rest at the start, another to make the duration whole, a third for the grid.
    assert duration <= motion.duration <= duration + 3 * PERIOD
    assert motion.v[-1, 0] == pytest.approx(1.6, abs=1e-6)
    expected = np.clip(a * (motion.time - (motion.duration - duration) - 1), 0, 1.6)
    np.testing.assert_allclose(motion.v[:, 0], expected, atol=a * 2 * PERIOD)
    # At the end of the path it is where the command would be a little later, at its speed.
    at_end = 6.4 + 1.6 * (motion.duration - duration)
    assert 6.4 - 1e-6 <= motion.q[-1, 0] <= at_end


def test_a_motion_k_times_as_fast_needs_gravity_and_k_squared_of_the_rest(robot):
    # From the equations of motion: M q'' and C(q, q') q' scale with k², g(q) does not. A speed
    # limit of half the planetary speed makes k = 0.5 exactly while that speed is held.
    slow = dataclasses.replace(robot, velocity_limit=np.array([0.225, 9, 9, 9]))
    plan, command = retime(slow, SHORT), plan_motion(robot, SHORT)
    # The planetary angle tells where on the path a sample is; it has its speed from 1 to 3 s.
    s = np.interp(plan.motion.q[:, 0], command.motion.q[:, 0], command.motion.time)
    held = np.flatnonzero((s > 1.1) & (s < 2.9))
    s = s[held]
    k = np.mean(np.diff(s)) / PERIOD
    assert k == pytest.approx(0.5, abs=1e-3)
    np.testing.assert_allclose(np.diff(s), k * PERIOD, atol=1e-8)
    v, vd = (np.array([np.interp(s, command.motion.time, x) for x in xs.T]).T
             for xs in (command.motion.v, command.motion.vd))  # fmt: skip
    smooth = np.all(np.abs(plan.motion.vd[held] - k**2 * vd) < 1e-3, axis=1)  # corners aside
    assert smooth.mean() > 0.9
    for i, v_i, vd_i in zip(held[smooth][::97], v[smooth][::97], vd[smooth][::97], strict=True):
        q = plan.motion.q[i]
        gravity = torque_of(robot, q, np.zeros(4), np.zeros(4))
        whole = torque_of(robot, q, v_i, vd_i)
        np.testing.assert_allclose(plan.torque[i], gravity + k**2 * (whole - gravity), atol=15)


# --- the optimum, where holding takes much of the torque ---------------------------------------


def least_time(robot, motion: Motion, margin: float) -> float:
    """Of the path, without friction: one linear program in x = s'^2 at all samples together.

    Of two x that keep the limits, so does the larger at each sample. So the fastest is the one
    with the largest sum. Torques of a cell: at both its ends, s'' = (x[i+1] - x[i]) / (2 h).
    """
    h, count = motion.period, len(motion.q) - 1
    rest, rows, columns, values, most = np.zeros(robot.n), [], [], [], []
    for i in range(count):
        for j in (i, i + 1):
            q, v, vd = motion.q[j], motion.v[j], motion.vd[i]
            gravity = torque_of(robot, q, rest, rest)
            inertia = (torque_of(robot, q, rest, v) - gravity) / (2 * h)
            velocity = torque_of(robot, q, v, vd) - gravity - robot.damping * v
            start, end = (velocity, 0) if j == i else (0, velocity)
            for k, sign in np.ndindex(robot.n, 2):
                row, sign = len(most), 2 * sign - 1
                rows += [row, row]
                columns += [i, i + 1]
                values += [sign * (start - inertia)[k], sign * (end + inertia)[k]]
                most.append(margin * robot.effort_limit[k] - sign * gravity[k])
    x = linprog(
        -np.ones(count + 1),
        A_ub=csr_array((values, (rows, columns)), shape=(len(most), count + 1)),
        b_ub=most,
        bounds=[(0, 0), *[(0, 1)] * (count - 1), (0, 0)],
    ).x
    speed = np.sqrt(np.maximum(x, 0))
    return float(np.sum(2 * h / (speed[1:] + speed[:-1])))


def test_a_link_that_others_swing_outwards_is_held_in_the_least_time(robot):
    # Holding the roll axis takes 99 % of its motor while joint 1 turns: s'' has no share in its
    # torque.
    tilted, rest = np.array([0, 0.5, 0, 0]), np.zeros(4)
    spin = alone(knots([0, 0], [1, 1], [2, 1], [3, 0]))
    spin = dataclasses.replace(spin, q0=tilted)
    margin = abs(torque_of(robot, tilted, rest, rest)[1]) / LIMITS[1] / 0.99
    plan = retime(robot, spin, torque_margin=margin)
    expected = least_time(robot, commanded_motion(robot, spin, 0.02), margin)
    assert plan.motion.duration == pytest.approx(expected, rel=0.01)


# A swing from where the arm is stretched out level, down, and back up; the elbow rests.
HEAVY = alone(knots([0, 0], [0.4, 2], [0.8, 0], [1, 0], [1.4, -2], [1.8, 0], [2, 0]), joints=2)
HOLDING = 9.81 * (4 * 0.5 + 2 * (0.8 + 0.3))  # N m: the arm stretched out level


@pytest.mark.parametrize("share", [0.8, 0.999])
def test_a_start_where_holding_takes_most_of_the_torque_takes_the_least_time(tmp_path, share):
    arm = write_robot(tmp_path, ARM, ("<damping>0.7", "<damping>0"))
    arm = dataclasses.replace(arm, effort_limit=np.array([HOLDING / share, 40]))
    plan = retime(arm, HEAVY)
    expected = least_time(arm, commanded_motion(arm, HEAVY, 0.005), 1)
    assert plan.motion.duration == pytest.approx(expected, rel=0.01)


# --- other limits, other robots --------------------------------------------------------------


@pytest.mark.parametrize(
    "field, name, largest", [("velocity", "v", 1.2), ("acceleration", "vd", 2)]
)
def test_speed_and_acceleration_limits_are_kept_by_slowing_down(robot, field, name, largest):
    limits = np.array([9, largest, 9, 9])
    plan = retime(dataclasses.replace(robot, **{f"{field}_limit": limits}), SHORT)
    assert np.abs(getattr(plan.motion, name)[:, 1]).max() == pytest.approx(largest, rel=5e-3)
    assert distance(plan.motion.q, dense_path(SHORT)) < 1e-4
    assert 0.05 < plan.longer < 2


def test_viscous_friction_is_within_the_torques(tmp_path):
    arm, swing = tough_swing(tmp_path)
    plan = retime(arm, swing)
    torque = torques(arm, plan.motion)
    assert np.all(np.abs(torque) <= arm.effort_limit + 1e-6)
    assert np.abs(torque[:, 0]).max() > 0.8 * 45
    assert distance(plan.motion.q, dense_path(swing)) < 1e-4
    assert plan.longer > 0


def test_viscous_friction_slows_down_only_where_it_takes_the_torque(tmp_path):
    # About a vertical axis: J v' = tau - d v, with v = tau / d at most and 2 rad/s commanded.
    changes = ("<damping>0.7", "<damping>20"), ("<effort>90", "<effort>30")
    turned = write_robot(tmp_path, ARM.replace("0 1 0</xyz>", "0 0 1</xyz>"), *changes)
    arm = dataclasses.replace(turned, position_upper=np.full(2, np.inf))
    J, tau, d = 0.6 + 4 * 0.5**2 + 0.25 + 2 * 1.1**2 + 10**2 * 0.01, 30, 20
    plan = retime(arm, alone(knots([0, 0], [0.1, 2], [3.1, 2], [3.2, 0]), joints=2))
    # Up and down with all that the motor has: the times and ways of both are closed forms.
    v = 0.999 * tau / d
    up, down = -J / d * np.log(1 - d * v / tau), J / d * np.log(1 + d * v / tau)
    ways = (tau * up - J * v) / d + (J * v - tau * down) / d
    expected = up + down + (6.2 - ways) / v
    assert plan.motion.duration == pytest.approx(expected, rel=0.015)


def test_a_chain_of_7_is_retimed(tmp_path):
    robot = write_robot(tmp_path, chain_sdf(7, seed=2))
    chain = command(
        *(  # of different times, so that no way leads back along itself
            knots([0, 0], [0.2, 0], [0.6 + 0.05 * k, v], [1.4 + 0.05 * k, -v], [2, 0])
            for k, v in enumerate((1, 0.5, -1, 1, -1, 1, 0.5))
        )
    )
    strong = dataclasses.replace(robot, effort_limit=np.full(7, 1e9))
    plan = plan_motion(strong, chain)
    rest = np.zeros_like(plan.motion.q)
    holding = np.abs(inverse_dynamics(robot, plan.motion.q, rest, rest)).max(axis=0)
    weak = dataclasses.replace(
        robot, effort_limit=0.5 * np.abs(plan.torque).max(axis=0) + 0.5 * holding
    )
    plan = retime(weak, chain)
    assert np.all(np.abs(torques(weak, plan.motion)) <= weak.effort_limit + 1e-6)
    assert distance(plan.motion.q, dense_path(chain, 1e-4)) < 1e-4
    assert plan.longer > 0


# --- what no timing can do -------------------------------------------------------------------


def test_a_stop_on_the_path_is_refused(robot):
    stopped = dataclasses.replace(robot, position_upper=np.array([99, 99, 0.02, 99]))
    with pytest.raises(
        InputError, match=r"joint 3 'pitch' at .* s: needs position .* to 0\.02 rad"
    ):
        retime(stopped, faster(robot, 2.95))


@pytest.mark.parametrize(
    ("plan", "said"),
    [
        (plan_motion, r" at 0\.000 s needs torque {} N m, available ±3 N m"),
        (retime, r", at its command of 0\.000 s, needs torque {} N m to hold its links, "
         "available ±3 N m"),
    ],
)  # fmt: skip
def test_a_motor_that_cannot_hold_its_link_is_refused(tmp_path, plan, said):
    arm = write_robot(tmp_path, ARM, ("<effort>40", "<effort>3"))
    needed = -2 * 9.81 * 0.3  # N m: 2 kg at 0.3 m
    with pytest.raises(InputError, match=f"joint 2 'elbow'{said.format(f'{needed:g}')}"):
        plan(arm, alone(knots([0, 0], [1, 0]), joints=2))


@pytest.mark.parametrize("when, speeds", [("start", (1.0, -1.0)), ("end", (0.0, 1.0))])
def test_a_command_that_starts_or_ends_too_hard_in_motion_is_refused(robot, when, speeds):
    with pytest.raises(
        InputError, match=rf"'alone' refused: at its {when}, in motion, joint 1 .* N"
    ):
        retime(robot, alone(knots([0, speeds[0]], [1, speeds[1]])), torque_margin=0.05)


def test_a_command_many_times_too_fast_is_slowed_down(robot):
    # 50 rad/s is 16 times the speed limit; near that joint 2 needs all it has to stay. So 50 rad
    # take a ramp up to where it does, a ramp down, and that speed in between.
    centrifugal = torque_of(robot, np.zeros(4), np.array([1, 0, 0, 0]), np.zeros(4))[1]
    top, a = np.sqrt(LIMITS[1] / centrifugal), LIMITS[0] / INERTIA_1
    plan = retime(robot, alone(knots([0, 0], [1, 50], [2, 0])))
    assert plan.motion.duration == pytest.approx(50 / top + top / a, abs=0.17)
    assert plan.motion.q[-1, 0] == pytest.approx(50, abs=1e-4)
    assert np.abs(plan.motion.v[:, 0]).max() == pytest.approx(top, rel=1e-3)


@pytest.mark.parametrize(
    "course, margin",
    [
        (knots([0, 0], [5, 9000], [10, 0]), 1),  # 45000 rad at the speed limit
        # Nothing but inertia: times go with the root of the torque.
        (knots([0, 0], [0.05, 0.01], [0.1, 0]), 1e-6),
        (knots([0, 0], [5, 1], [10, 0]), 1e-300),
    ],
)
def test_what_would_last_a_hundred_times_as_long_is_refused(robot, course, margin):
    with pytest.raises(
        InputError, match=r"'alone' refused: no timing .* at most 100 times as long"
    ):
        retime(robot, alone(course), torque_margin=margin)


def test_what_would_last_more_periods_than_a_motion_may_have_is_refused(robot, monkeypatch):
    monkeypatch.setattr(retiming, "MAX_PERIODS", 840)
    assert retime(robot, SHORT, torque_margin=0.5).motion.duration < 4.2
    with pytest.raises(InputError, match=r"'short' refused: .* 1\.05 times as long .*, 4 s"):
        retime(robot, SHORT, torque_margin=0.4)


@pytest.mark.parametrize("end", [0.0, 1e-32])  # round-off of a sine
def test_what_lasts_less_than_a_hundred_times_as_long_is_not(robot, end):
    """However often its timing is corrected."""
    v = np.zeros((201, 4))
    v[:, 0] = 2 * np.sin(np.linspace(0, np.pi, 201)) ** 2
    v[-1, 0] = end
    smooth = Command.of_motion("smooth", Motion.from_speeds(0.005, np.zeros(4), v))
    plan = retime(robot, smooth, torque_margin=3e-3)
    assert 60 < plan.motion.duration < 100 and plan.peak_use(robot)[0] < 3.001e-3
