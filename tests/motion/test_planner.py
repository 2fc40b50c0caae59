"""The planner: the reference motion, its torque limiter, and the motions that it refuses."""

from __future__ import annotations

import copy
import dataclasses

import numpy as np
import pytest
from test_robot import ARM, chain_sdf

from sdt_drake.dynamics import torque_groups
from sdt_drake.errors import InputError
from sdt_drake.motion import (
    Command,
    CommandProfile,
    Knots,
    Motion,
    Oscillation,
    Sampled,
    check_motion,
    load_command,
    load_profile,
    plan_motion,
    retime,
    shipped_motions,
)
from sdt_drake.motion.command import Alignment, Course, spin_geometry
from sdt_drake.motion.planner import commanded_motion, limit_accelerations
from sdt_drake.robot import load_robot

PERIOD = 0.005
REFERENCE = load_profile("package://sdt/motions/reference.yaml")
LIMITS = np.array([13655.04, 3950, 2150, 2150])


@pytest.fixture(scope="module")
def plan(robot):
    return plan_motion(robot, REFERENCE)


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


def faster(speed: float) -> CommandProfile:
    """The reference motion with another speed of joint 1 [rad/s]."""
    profile = copy.deepcopy(REFERENCE)
    for knot in profile.joints[0].knots:
        knot[1] *= speed / 2.4
    return profile


def _first(condition: np.ndarray) -> float:
    return PERIOD * np.flatnonzero(condition)[0]


def needed_torque(robot, motion: Motion) -> np.ndarray:
    """Torque of links and motors, joint side [N m]."""
    groups = torque_groups(robot, motion.q, motion.v, motion.vd)
    return groups.total + robot.gear_ratio**2 * robot.rotor_inertia * motion.vd


# --- the reference motion --------------------------------------------------------------------


def test_reference_motion_needs_no_limiter_and_follows_its_command(robot, plan):
    assert not plan.limited.any()
    np.testing.assert_array_equal(np.round(plan.peak_use(robot), 2), [0.82, 0.93, 0.30, 0.23])
    np.testing.assert_allclose(plan.motion.v, REFERENCE.speeds(plan.motion.time), atol=1e-12)
    assert plan.motion.period == PERIOD
    assert plan.motion.time[-1] == plan.motion.duration == 30
    np.testing.assert_array_equal(plan.motion.vd[-1], 0)
    np.testing.assert_allclose(plan.torque, needed_torque(robot, plan.motion), atol=1e-9)


def test_angles_of_the_reference_motion_are_those_of_the_independent_calculation(plan):
    degrees = np.rad2deg(plan.motion.q[:, 2:])
    np.testing.assert_array_equal(np.round(np.min(degrees, axis=0), 1), [-9.9, -10.5])
    np.testing.assert_array_equal(np.round(np.max(degrees, axis=0), 1), [1.6, 18.0])
    np.testing.assert_array_equal(plan.motion.q[0], 0)


def test_a_start_angle_shifts_all_angles(robot, plan):
    profile = copy.deepcopy(REFERENCE)
    profile.q0 = [3.0, 0.0, 0.0, 0.0]  # the planetary angle has no effect on the torques
    shifted = plan_motion(robot, profile)
    np.testing.assert_allclose(shifted.motion.q, plan.motion.q + profile.start(), atol=1e-12)
    np.testing.assert_allclose(shifted.torque, plan.torque, atol=1e-6)


# --- the limiter -----------------------------------------------------------------------------


def test_margin_limits_joint_2_alone_and_it_gets_back_on_its_command(robot):
    plan = plan_motion(robot, REFERENCE, torque_margin=0.9)
    assert plan.torque_margin == 0.9
    np.testing.assert_array_equal(plan.limited.any(axis=0), [False, True, False, False])
    torque = needed_torque(robot, plan.motion)
    assert np.all(np.abs(torque) <= 0.9 * LIMITS + 1e-6)
    # It accelerates with all that it may use, and less than commanded.
    limited = plan.limited[:, 1]
    np.testing.assert_allclose(np.abs(torque[limited, 1]), 0.9 * 3950, atol=1e-6)
    command = REFERENCE.speeds(plan.motion.time)
    off = np.abs(plan.motion.v - command) > 1e-9
    np.testing.assert_array_equal(off.any(axis=0), [False, True, False, False])
    assert 0.01 < np.max(np.abs(plan.motion.v - command)) < 0.15
    last = np.flatnonzero(limited)[-1]
    assert not off[last + 2 :].any()
    # A sample later its wish is not what was commanded, but what takes it back.
    np.testing.assert_allclose(plan.motion.v[last + 2 :], command[last + 2 :], atol=1e-12)


def spin_up(duration: float) -> CommandProfile:
    """Joint 1 from 0 to 1.6 rad/s in 2 s, from 1 s on; the others stand still."""
    ramp = Knots([[0, 0], [1, 0], [3, 1.6]] + [[duration, 1.6]] * (duration > 3))
    still = Knots([[0, 0], [duration, 0]])
    return CommandProfile("spin-up", duration=duration, joints=[ramp, still, still, still])


# What joint 1 turns at q = 0 [kg m²]: the links by the parallel-axis theorem, and its motor.
INERTIA_1 = (
    (9067.5 + 5600 * 0.4**2)
    + (95 + 535.8 + 249.749 + (300 + 340 + 370) * 2.6**2)
    + 67.2**2 * 0.1291
)


def test_a_joint_that_cannot_accelerate_as_commanded_catches_up_later(robot):
    plan = plan_motion(robot, spin_up(6))
    time, v, limited = plan.motion.time, plan.motion.v[:, 0], plan.limited[:, 0]
    command = np.clip(0.8 * (time - 1), 0, 1.6)
    reachable = 13655.04 / INERTIA_1 * (time - 1)
    np.testing.assert_allclose(v, np.clip(reachable, 0, 1.6), atol=1e-9)
    np.testing.assert_allclose(plan.torque[limited, 0], 13655.04, atol=1e-6)
    assert (_first(limited), v[-1]) == (1.0, 1.6)
    assert np.max(command - v) > 0.1
    np.testing.assert_array_equal(plan.motion.v[:, 1:], 0)


def test_the_limiter_counts_gravity_and_viscous_friction(write_robot):
    arm = write_robot(ARM, ("<damping>0.7", "<damping>20"), ("<effort>90", "<effort>45"))
    swing = Knots([[0, 0], [0.1, 1], [0.6, 1], [1, 0]])
    profile = CommandProfile(
        "swing", duration=1, q0=[-1.5, 0.2], joints=[swing, Knots([[0, 0], [1, 0]])]
    )
    plan = plan_motion(arm, profile)
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
        vd = limit_accelerations(M, bias, wanted.copy(), available)
        torque = M @ vd + bias
        assert np.all(np.abs(torque) <= available + 1e-6)
        for k in range(n):
            if vd[k] == wanted[k]:
                seen.add("wish")
            else:
                pull = np.sign(wanted[k] - vd[k])
                seen.add(pull)
                assert torque[k] == pytest.approx(pull * available[k], abs=1e-6)
    assert seen == {"wish", -1.0, 1.0}


def test_a_chain_of_7_is_limited_on_many_joints_at_once(write_robot):
    robot = write_robot(chain_sdf(7, seed=2))
    ramps = [
        Knots([[0, 0], [0.2, 0], [0.7, v], [1.5, -v], [2, 0]]) for v in (1, 0.5, -1, 1, -1, 1, 0.5)
    ]
    profile = CommandProfile("chain", duration=2, joints=ramps)
    strong = dataclasses.replace(robot, effort_limit=np.full(7, 1e9))
    peak = np.max(np.abs(plan_motion(strong, profile).torque), axis=0)
    robot = dataclasses.replace(robot, effort_limit=0.99 * peak)
    plan = plan_motion(robot, profile)
    assert np.sum(plan.limited.any(axis=0)) >= 5
    assert np.all(np.abs(needed_torque(robot, plan.motion)) <= 0.99 * peak + 1e-6)


def test_an_acceleration_limit_is_a_limit_of_the_limiter_too(robot):
    # Joint 1 at 0.4 rad/s² instead of 0.8 from 1 s on, so it is at 1.6 rad/s after 4 s.
    calm = dataclasses.replace(robot, acceleration_limit=np.array([0.4, 9, 9, 9]))
    plan = plan_motion(calm, spin_up(6))
    expected = np.clip(0.4 * (plan.motion.time - 1), 0, 1.6)
    np.testing.assert_allclose(plan.motion.v[:, 0], expected, atol=1e-5)
    assert plan.limited[:, 0].sum() == pytest.approx(800, abs=2)
    # What is exactly at the limit is not limited.
    exact = dataclasses.replace(robot, acceleration_limit=np.array([0.45, 3, 9, 9]))
    assert not plan_motion(exact, REFERENCE).limited[:, 1:].any()
    with pytest.raises(
        InputError, match=r"joint 2 'roll' at 2\.000 s: needs acceleration 3 rad/s²"
    ):
        check_motion(
            dataclasses.replace(robot, acceleration_limit=np.array([9, 2.0, 9, 9])),
            plan_motion(robot, REFERENCE).motion,
        )


# --- motions that are refused ----------------------------------------------------------------


def test_a_motion_that_overpowers_joint_2_is_refused_with_its_torque(robot):
    profile = faster(2.95)
    # Joint 1 is back on its command when joint 2 fails, so the command tells what is needed.
    time = PERIOD * np.arange(6001)
    command = Motion.from_speeds(PERIOD, np.zeros(4), profile.speeds(time))
    torque = needed_torque(robot, command)[:, 1]
    i = np.flatnonzero(np.abs(torque) > 3950)[0]
    with pytest.raises(
        InputError,
        match=rf"joint 2 'roll' at {time[i]:.3f} s needs torque {torque[i]:.6g} N m, "
        r"available ±3950 N m; .* rad/s away from its command",
    ):
        plan_motion(robot, profile)


def test_a_joint_that_is_not_back_on_its_command_at_the_end_is_refused(robot):
    needed, reached = 0.8 * INERTIA_1, 2 * 13655.04 / INERTIA_1
    with pytest.raises(
        InputError,
        match=rf"joint 1 'planetary' at 1\.000 s needs torque {needed:.6g} N m, available ±13655 "
        rf"N m; .*ends at {reached:.4g} rad/s, commanded is 1\.6 rad/s",
    ):
        plan_motion(robot, spin_up(3))


def test_a_motor_that_cannot_hold_its_link_is_refused(write_robot):
    arm = write_robot(ARM, ("<effort>40", "<effort>3"))
    still = CommandProfile("still", duration=1, joints=[Knots([[0, 0], [1, 0]])] * 2)
    needed = -2 * 9.81 * 0.3  # N m: 2 kg at 0.3 m
    with pytest.raises(
        InputError,
        match=rf"joint 2 'elbow' at 0\.000 s needs torque {needed:g} N m, available ±3 N m",
    ):
        plan_motion(arm, still)


def test_a_speed_beyond_that_of_the_sdf_is_refused(robot, write_robot):
    slow = write_robot(
        robot.path.read_text(encoding="utf-8"), ("<velocity>4.7124", "<velocity>1.4")
    )
    # Joint 2 goes from 0 at 2 s to 1.5 rad/s at 2.5 s: 1.4 at 2.4667 s.
    with pytest.raises(
        InputError,
        match=r"joint 2 'roll' at 2\.470 s: needs speed 1\.41 rad/s, available -1\.4 to 1\.4 rad/s",
    ):
        plan_motion(slow, REFERENCE)


@pytest.mark.parametrize(
    "stop, joint, lower, upper",
    [("<lower>-0.1</lower>", 2, -0.1, np.inf), ("<upper>0.02</upper>", 2, -np.inf, 0.02)],
)
def test_an_angle_beyond_the_stops_of_the_sdf_is_refused(
    robot, write_robot, plan, stop, joint, lower, upper
):
    limit = "<limit><effort>2150</effort>"  # the first one is that of joint 3
    stopped = write_robot(robot.path.read_text(encoding="utf-8"), (limit, limit + stop))
    time = PERIOD * np.arange(6001)
    v = REFERENCE.speeds(time)[:, joint]
    q = np.concatenate([[0], np.cumsum((v[1:] + v[:-1]) / 2 * PERIOD)])
    i = np.flatnonzero((q < lower) | (q > upper))[0]
    with pytest.raises(
        InputError,
        match=rf"joint 3 'pitch' at {time[i]:.3f} s: needs position {q[i]:.6g} rad, "
        rf"available {lower:g} to {upper:g} rad",
    ):
        plan_motion(stopped, REFERENCE)


def test_check_motion_gives_the_torques_or_refuses_by_joint_time_and_numbers(robot, plan):
    np.testing.assert_allclose(check_motion(robot, plan.motion), plan.torque, rtol=1e-12)
    peak = np.max(np.abs(plan.torque), axis=0) / LIMITS
    k = int(np.argmax(peak))
    margin = 0.99 * peak[k]
    i = np.flatnonzero(np.abs(plan.torque[:, k]) > margin * LIMITS[k])[0]
    bound = f"{margin * LIMITS[k]:.6g}"
    with pytest.raises(
        InputError,
        match=rf"joint {k + 1} 'roll' at {i * PERIOD:.3f} s: needs torque "
        rf"{plan.torque[i, k]:.6g} N m, available -{bound} to {bound} N m",
    ):
        check_motion(robot, plan.motion, torque_margin=margin)


def test_another_number_of_joints_is_refused(robot):
    three = CommandProfile("three", duration=30, joints=REFERENCE.joints[:3])
    with pytest.raises(InputError, match="motion 'three': 3 joints, robot 'sdt' has 4"):
        plan_motion(robot, three)
    motion = Motion.from_speeds(PERIOD, np.zeros(3), np.zeros((5, 3)))
    with pytest.raises(InputError, match="3 joints, robot 'sdt' has 4"):
        check_motion(robot, motion)


@pytest.mark.parametrize("margin", [0, 1.5, -0.5, np.nan])
def test_a_margin_that_is_no_share_is_refused(robot, margin):
    with pytest.raises(InputError, match=rf"margin: {margin}.*\(0, 1\]"):
        plan_motion(robot, REFERENCE, torque_margin=margin)


@pytest.mark.parametrize(
    "period, message",
    [
        (0.007, "30 s is not a whole multiple of the period 0.007 s"),
        (31.0, "30 s is not a whole multiple of the period 31 s"),
        (-0.005, "period: -0.005, expected a finite number > 0"),
        (0.0, "period: 0.0, "),
        (np.nan, "period: nan, "),
        (np.inf, "period: inf, "),
        (1e-310, "period"),
    ],
)
def test_a_period_that_does_not_divide_the_duration_is_refused(robot, period, message):
    with pytest.raises(InputError, match=message):
        plan_motion(robot, REFERENCE, period=period)


def test_other_periods_and_samples_are_planned(robot, plan):
    coarse = plan_motion(robot, REFERENCE, period=0.05)
    assert coarse.motion.q.shape == (601, 4)
    np.testing.assert_allclose(coarse.motion.v, plan.motion.v[::10], atol=1e-12)
    samples = [Sampled(0.05, column.tolist()) for column in coarse.motion.v.T]
    again = plan_motion(robot, CommandProfile("again", duration=30, joints=samples), period=0.05)
    np.testing.assert_allclose(again.motion.q, coarse.motion.q, atol=1e-12)


# --- what a period can show ------------------------------------------------------------------


def alone(joint, duration=10):
    """Joint 2 as given, the others at rest."""
    still = Knots([[0, 0], [duration, 0]])
    return CommandProfile("alone", duration=duration, joints=[still, joint, still, still])


@pytest.mark.parametrize(
    "joint, lost",
    [
        # Up to 20 rad/s and back within a period: an area of 0.02 rad.
        (Knots([[0, 0], [1.001, 0], [1.002, 20], [1.003, 0], [10, 0]]), 0.02),
        # At every sample the same phase of the swing: what is seen is a steady speed.
        (Oscillation(amplitude=1e-4, period=PERIOD, fade=1, end=9), 1e-4 * 2 * np.pi / PERIOD * 8),
        # A millisecond of noise, of which every fifth value is taken.
        (Sampled(0.001, [0.0, *([1.0, 0, 0, 0, 0] * 1999), *[0.0] * 5]), 1999 * 0.001),
    ],
    ids=["short", "fast swing", "fine samples"],
)
def test_what_is_too_short_for_the_period_is_refused_with_the_angle_that_is_lost(
    robot, joint, lost
):
    with pytest.raises(
        InputError, match=r"'alone': joint 2 'roll' at .* a period of 0\.005 s loses .* deg"
    ) as error:
        plan_motion(robot, alone(joint))
    told = float(str(error.value).partition("loses ")[2].split()[0])
    assert told == pytest.approx(np.degrees(lost), rel=0.02)


def test_a_short_alignment_is_refused_though_its_speed_is_0_at_both_ends(robot):
    ramp = Course(np.array([0, 1.001, 1.004, 2]), np.array([0, 0, 1.0, 1.0]), np.array([True] * 3))
    rest = Course.at_rest(2)
    geometry = spin_geometry(robot, "planetary", "roll", "here")
    command = Command(
        "align", 2, np.zeros(4), (rest, rest, rest, rest), Alignment(1, ramp, geometry)
    )
    # The piece of the spin is one of the command too.
    command = dataclasses.replace(command, joints=(ramp, rest, rest, rest))
    with pytest.raises(InputError, match=r"joint 2 'roll' .* loses"):
        commanded_motion(robot, command, PERIOD, 1.0)


@pytest.mark.parametrize("period", [0.001, 0.005, 0.02, 0.05, 0.1])
def test_every_shipped_motion_can_be_shown_by_any_sensible_period(robot, period):
    for name in [*shipped_motions(), "reference"]:
        commanded_motion(robot, load_command(name, robot), period, 1.0)


@pytest.mark.parametrize(
    "joint, told",
    [
        (Knots([[0, 0], [5, 1e300], [10, 0]]), "e\\+297 rad/s, expected at most 10000 rad/s"),
        (Knots([[0, 0], [5, 0], [5.005, 9e3], [10, 0]]), "1.8e\\+06 rad/s², expected at most 1e"),
        (Knots([[0, 0], [5, 0], [5.001, 4e4], [5.002, 0], [10, 0]]), "2e\\+04 rad/s, expected"),
        (Oscillation(amplitude=1e308, period=0.001, fade=1, end=9), "nan rad/s, expected"),
    ],
    ids=["speed", "acceleration", "between samples", "no number"],
)
@pytest.mark.parametrize("planner", [plan_motion, retime])
def test_a_command_beyond_any_machine_is_refused(robot, planner, joint, told):
    with pytest.raises(InputError, match=rf"'alone': joint 2 'roll' at .* commanded .*{told}"):
        planner(robot, alone(joint))


def test_a_start_beyond_any_machine_is_refused(robot):
    profile = alone(Knots([[0, 0], [10, 0]]))
    profile.q0 = [0, 0, 1e300, 0]
    with pytest.raises(InputError, match=r"joint 3 'pitch' .* expected at most 1e\+06 rad"):
        plan_motion(robot, profile)


def test_a_plan_tells_the_angle_that_the_limiter_loses(robot):
    plan = plan_motion(robot, spin_up(6))
    v, period = plan.motion.v - plan.commanded.v, plan.motion.period
    lost = abs(np.sum(v[1:] + v[:-1], axis=0) * period / 2)
    assert lost[0] > 0.1
    np.testing.assert_allclose(plan.angle_lost, lost, atol=1e-9)
