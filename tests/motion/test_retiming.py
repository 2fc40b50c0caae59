"""The planner that slows down, against paths, torques and times computed another way."""

from __future__ import annotations

import copy
import dataclasses
import re

import numpy as np
import pytest
from pydrake.multibody.tree import MultibodyForces
from scipy.optimize import linprog
from scipy.sparse import csr_array
from test_robot import ARM, chain_sdf

from sdt_drake.errors import InputError
from sdt_drake.motion import (
    CommandProfile,
    Knots,
    Motion,
    load_command,
    load_profile,
    plan_motion,
    retime,
)
from sdt_drake.motion.planner import commanded_motion
from sdt_drake.robot import load_robot

PERIOD = 0.005
REFERENCE = load_profile("package://sdt/motions/reference.yaml")
LIMITS = np.array([13655.04, 3950, 2150, 2150])
# What joint 1 turns at q = 0 [kg m²]: the links by the parallel-axis theorem, and its motor.
INERTIA_1 = (
    (9067.5 + 5600 * 0.4**2)
    + (95 + 535.8 + 249.749 + (300 + 340 + 370) * 2.6**2)
    + 67.2**2 * 0.1291
)


def faster(speed: float) -> CommandProfile:
    """The reference motion with another speed of joint 1 [rad/s]."""
    profile = copy.deepcopy(REFERENCE)
    for knot in profile.joints[0].knots:
        knot[1] *= speed / 2.4
    return profile


@pytest.fixture
def write_robot(tmp_path):
    def write(text: str, *changes: tuple[str, str]):
        for old, new in changes:
            assert old in text
            text = text.replace(old, new, 1)
        path = tmp_path / "robot.sdf"
        path.write_text(text, encoding="utf-8")
        return load_robot(path)

    return write


def drake_torque(robot, q, v, vd) -> np.ndarray:
    """Joint torques of one sample by Drake's recursion, with damping [N m]."""
    context, forces = robot.plant.CreateDefaultContext(), MultibodyForces(robot.plant)
    robot.plant.SetPositions(context, q)
    robot.plant.SetVelocities(context, v)
    robot.plant.CalcForceElementsContribution(context, forces)
    return robot.plant.CalcInverseDynamics(context, vd, forces)


def torques(robot, motion: Motion, later: int = 0) -> np.ndarray:
    """At the start (0) or the end (1) of every period."""
    rows = range(len(motion.q) - 1)
    return np.array(
        [drake_torque(robot, motion.q[i + later], motion.v[i + later], motion.vd[i]) for i in rows]
    )


def dense_path(command, step: float = 5e-4) -> np.ndarray:
    """The commanded path, integrated finely."""
    time = step * np.arange(round(command.duration / step) + 1)
    v = command.speeds(time)
    steps = np.cumsum((v[1:] + v[:-1]) * step / 2, axis=0)
    return command.start() + np.vstack([np.zeros_like(v[:1]), steps])


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


@pytest.mark.parametrize("margin", [1.0, 0.8])
def test_a_motion_that_the_limiter_refuses_keeps_its_path_within_the_torques(robot, margin):
    command = faster(2.95)
    with pytest.raises(InputError, match=r"joint 2 'roll' at .* needs torque"):
        plan_motion(robot, command, torque_margin=margin)
    plan = retime(robot, command, torque_margin=margin)
    motion = plan.motion
    path = dense_path(command)
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
    assert np.all(np.abs(motion.v).max(axis=0) <= [2.95, 1.5, 0.1257, 0.2093] + 1e-6 * np.ones(4))


def test_a_feasible_command_comes_back_as_it_is(robot):
    plan, limiter = retime(robot, REFERENCE), plan_motion(robot, REFERENCE)
    for name in ("q", "v", "vd"):
        np.testing.assert_array_equal(getattr(plan.motion, name), getattr(limiter.motion, name))
    np.testing.assert_array_equal(plan.torque, limiter.torque)
    assert not plan.limited.any() and plan.longer == 0


def test_a_scarcely_infeasible_command_is_scarcely_longer(robot):
    # The reference motion needs 0.928 of motor 2. Rest at start and end alone takes two periods.
    assert 2 * PERIOD <= retime(robot, REFERENCE, torque_margin=0.925).longer < 0.04


# --- closed forms ----------------------------------------------------------------------------


def spin_up() -> CommandProfile:
    """Joint 1 from 0 to 1.6 rad/s in 2 s, from 1 s on, and goes on; the others stand still."""
    ramp, still = Knots([[0, 0], [1, 0], [3, 1.6], [6, 1.6]]), Knots([[0, 0], [6, 0]])
    return CommandProfile("spin-up", duration=6, joints=[ramp, still, still, still])


def test_a_single_joint_spins_up_with_all_its_motor_has_and_ends_at_speed(robot):
    # v = a (t - 1) up to 1.6 rad/s; the path of 6.4 rad takes what is left of it at that speed.
    a = 13655.04 / INERTIA_1
    duration = 1 + 1.6 / a + (1.6 + 4.8 - 1.6**2 / (2 * a)) / 1.6
    plan = retime(robot, spin_up())
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
    slow = dataclasses.replace(robot, velocity_limit=np.array([1.2, np.inf, np.inf, np.inf]))
    plan, command = retime(slow, REFERENCE), plan_motion(robot, REFERENCE)
    # The planetary angle tells where on the path a sample is; it has its speed from 5.8 to 20 s.
    s = np.interp(plan.motion.q[:, 0], command.motion.q[:, 0], command.motion.time)
    held = np.flatnonzero((s > 6.2) & (s < 19.6))
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
        gravity = drake_torque(robot, q, np.zeros(4), np.zeros(4))
        whole = drake_torque(robot, q, v_i, vd_i)
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
            gravity = drake_torque(robot, q, rest, rest)
            inertia = (drake_torque(robot, q, rest, v) - gravity) / (2 * h)
            velocity = drake_torque(robot, q, v, vd) - gravity - robot.damping * v
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


@pytest.mark.parametrize("margin", [0.35, 0.3])
def test_a_link_that_others_swing_outwards_is_held_in_the_least_time(robot, margin):
    # Standing still takes 85 and 99 % of motor 2, at rest while joint 1 turns: s'' has no share in
    # its torque.
    command = load_command("coriolis", robot)
    plan = retime(robot, command, period=0.02, torque_margin=margin)
    expected = least_time(robot, commanded_motion(robot, command, 0.1, margin), margin)
    assert plan.motion.duration == pytest.approx(expected, rel=0.01)


def heavy(speed: float = 2) -> CommandProfile:
    """A swing from where the arm is stretched out level, down, and back up; the elbow rests."""
    swing = Knots([[0, 0], [0.4, speed], [0.8, 0], [1, 0], [1.4, -speed], [1.8, 0], [2, 0]])
    still = Knots([[0, 0], [2, 0]])
    return CommandProfile("heavy", duration=2, q0=[0, 0], joints=[swing, still])


@pytest.mark.parametrize("share", [0.8, 0.95, 0.999])
def test_a_start_where_holding_takes_most_of_the_torque_takes_the_least_time(write_robot, share):
    holding = 9.81 * (4 * 0.5 + 2 * (0.8 + 0.3))  # N m: the arm stretched out level
    arm = write_robot(ARM, ("<damping>0.7", "<damping>0"), ("<effort>90", f"<effort>{holding}"))
    arm = dataclasses.replace(arm, effort_limit=np.array([holding / share, 40]))
    plan = retime(arm, heavy())
    expected = least_time(arm, commanded_motion(arm, heavy(), 0.005, 1), 1)
    assert plan.motion.duration == pytest.approx(expected, rel=0.01)


def test_friction_where_holding_takes_nearly_all_torque_costs_little(write_robot):
    # Friction takes more of the motor than holding leaves, but not there.
    arm = write_robot(ARM)
    holding = 9.81 * (4 * 0.5 + 2 * (0.8 + 0.3))
    arm = dataclasses.replace(arm, effort_limit=np.array([holding / 0.999, 40]))
    plan = retime(arm, heavy())
    without = least_time(arm, commanded_motion(arm, heavy(), 0.005, 1), 1)
    assert without < plan.motion.duration < 1.06 * without
    for later in (0, 1):
        assert np.all(np.abs(torques(arm, plan.motion, later)) <= arm.effort_limit + 1e-6)


# --- other limits, other robots --------------------------------------------------------------


def test_speed_limits_of_the_sdf_are_kept_by_slowing_down(robot, write_robot):
    text = robot.path.read_text(encoding="utf-8")
    slow = write_robot(text, ("<velocity>4.7124", "<velocity>1.4"))
    plan = retime(slow, REFERENCE)
    assert np.abs(plan.motion.v[:, 1]).max() == pytest.approx(1.4, abs=1e-3)
    assert distance(plan.motion.q, dense_path(REFERENCE)) < 1e-4
    # Joint 2 moves by 44.7 rad, of which it makes some below the limit.
    assert plan.longer == pytest.approx(22.7 * (1.5 / 1.4 - 1), abs=0.2)


def test_acceleration_limits_of_the_sdf_are_kept_by_slowing_down(robot, write_robot):
    text = robot.path.read_text(encoding="utf-8")
    limit = "<velocity>4.7124</velocity>"
    calm = write_robot(text, (limit, limit + "<drake:acceleration>2</drake:acceleration>"))
    plan = retime(calm, REFERENCE)
    assert 1.99 < np.abs(plan.motion.vd[:, 1]).max() <= 2 + 1e-6
    assert distance(plan.motion.q, dense_path(REFERENCE)) < 1e-4
    assert plan.longer > 0.1


def test_viscous_friction_is_within_the_torques(write_robot):
    arm = write_robot(ARM, ("<damping>0.7", "<damping>20"), ("<effort>90", "<effort>45"))
    swing = Knots([[0, 0], [0.1, 1], [0.6, 1], [1, 0]])
    command = CommandProfile(
        "swing", duration=1, q0=[-1.5, 0.2], joints=[swing, Knots([[0, 0], [1, 0]])]
    )
    plan = retime(arm, command)
    torque = torques(arm, plan.motion)
    assert np.all(np.abs(torque) <= arm.effort_limit + 1e-6)
    assert np.abs(torque[:, 0]).max() > 0.8 * 45
    assert distance(plan.motion.q, dense_path(command)) < 1e-4
    assert plan.longer > 0


def test_a_chain_of_7_is_retimed(write_robot):
    robot = write_robot(chain_sdf(7, seed=2))
    ramps = [  # of different times, so that no way leads back along itself
        Knots([[0, 0], [0.2, 0], [0.6 + 0.05 * k, v], [1.4 + 0.05 * k, -v], [2, 0]])
        for k, v in enumerate((1, 0.5, -1, 1, -1, 1, 0.5))
    ]
    command = CommandProfile("chain", duration=2, joints=ramps)
    strong = dataclasses.replace(robot, effort_limit=np.full(7, 1e9))
    plan = plan_motion(strong, command)
    holding = np.max(
        [np.abs(drake_torque(robot, q, np.zeros(7), np.zeros(7))) for q in plan.motion.q], axis=0
    )
    weak = dataclasses.replace(
        robot, effort_limit=0.5 * np.abs(plan.torque).max(axis=0) + 0.5 * holding
    )
    plan = retime(weak, command)
    assert np.all(np.abs(torques(weak, plan.motion)) <= weak.effort_limit + 1e-6)
    assert distance(plan.motion.q, dense_path(command, 1e-4)) < 1e-4
    assert plan.longer > 0


# --- what no timing can do -------------------------------------------------------------------


def test_a_stop_on_the_path_is_refused(robot, write_robot):
    limit = "<limit><effort>2150</effort>"  # the first one is that of joint 3
    text = robot.path.read_text(encoding="utf-8")
    stopped = write_robot(text, (limit, limit + "<upper>0.02</upper>"))
    with pytest.raises(
        InputError, match=r"joint 3 'pitch' at .* s: needs position .* to 0\.02 rad"
    ):
        retime(stopped, faster(2.95))


def test_a_motor_that_cannot_hold_its_link_is_refused(write_robot):
    arm = write_robot(ARM, ("<effort>40", "<effort>3"))
    still = CommandProfile("still", duration=1, joints=[Knots([[0, 0], [1, 0]])] * 2)
    needed = -2 * 9.81 * 0.3  # N m: 2 kg at 0.3 m
    with pytest.raises(
        InputError,
        match=rf"joint 2 'elbow', where it is commanded at 0\.000 s, needs torque {needed:g} N m "
        r"to hold its links, available ±3 N m",
    ):
        retime(arm, still)


def test_a_command_that_starts_too_hard_in_motion_is_refused(robot):
    still = Knots([[0, 0], [1, 0]])
    joints = [Knots([[0, 1.0], [1, -1.0]]), still, still, still]
    with pytest.raises(
        InputError, match=r"'brake' refused: its start is commanded in motion, there joint 1 .* N m"
    ):
        retime(robot, CommandProfile("brake", duration=1, joints=joints))


def test_another_number_of_joints_and_a_bad_margin_are_refused(robot):
    three = CommandProfile("three", duration=30, joints=REFERENCE.joints[:3])
    with pytest.raises(InputError, match="motion 'three': 3 joints, robot 'sdt' has 4"):
        retime(robot, three)
    with pytest.raises(InputError, match=r"margin: 0.*\(0, 1\]"):
        retime(robot, REFERENCE, torque_margin=0)


def alone(knots, duration=10) -> CommandProfile:
    """Joint 1 as given, the others at rest."""
    still = Knots([[0, 0], [duration, 0]])
    return CommandProfile("alone", duration=duration, joints=[Knots(knots), still, still, still])


def test_a_command_many_times_too_fast_is_slowed_down(robot):
    # 50 rad/s is 16 times the speed limit; near that joint 2 needs all it has to stay. So 250 rad
    # take a ramp up to where it does, a ramp down, and that speed in between.
    centrifugal = drake_torque(robot, np.zeros(4), np.array([1, 0, 0, 0]), np.zeros(4))[1]
    top, a = np.sqrt(LIMITS[1] / centrifugal), LIMITS[0] / INERTIA_1
    plan = retime(robot, alone([[0, 0], [5, 50], [10, 0]]))
    assert plan.motion.duration == pytest.approx(250 / top + top / a, rel=2e-3)
    assert plan.motion.q[-1, 0] == pytest.approx(250, abs=1e-4)
    assert np.abs(plan.motion.v[:, 0]).max() == pytest.approx(top, rel=1e-3)


def test_what_would_last_a_hundred_times_as_long_is_refused_at_once(robot):
    # 45000 rad at the speed limit.
    shortest = re.escape(f"{45000 / robot.velocity_limit[0]:.4g}")
    with pytest.raises(
        InputError, match=rf"refused: it would last {shortest} s or longer, .* 100 times .* 10 s"
    ):
        retime(robot, alone([[0, 0], [5, 9000], [10, 0]]))


def test_what_the_torques_slow_down_a_hundred_times_is_refused(robot):
    # Nothing but inertia: times go with the root of the torque.
    command = alone([[0, 0], [0.05, 0.01], [0.1, 0]], duration=0.1)
    with pytest.raises(InputError, match=r"'alone' refused: it would last .* or longer"):
        retime(robot, command, torque_margin=1e-6)


@pytest.mark.parametrize("margin", [1e-12, 1e-300])
def test_next_to_no_torque_is_refused_too(robot, margin):
    with pytest.raises(InputError, match="'alone' refused: "):
        retime(robot, alone([[0, 0], [5, 1], [10, 0]]), torque_margin=margin)


def test_the_refusal_names_the_speed_and_not_gravity_where_that_is_the_reason(robot):
    # 300 times too fast for a moment only; joints 2 to 4 hang straight.
    spike = alone([[0, 0], [1, 0], [1.05, 900], [1.1, 0], [10, 0]])
    with pytest.raises(InputError, match="'alone' refused: ") as error:
        retime(robot, spike, torque_margin=0.02)
    assert "stand still" not in str(error.value) and "in motion" not in str(error.value)
    assert "times its largest speed" in str(error.value)
