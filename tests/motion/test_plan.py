"""Plans: limits, margins, and learned references in place of planned ones."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest
from helpers.motions import LIMITS, PERIOD, alone, falling, knots, sampled

from sdt_drake.analysis.comparison import with_controller
from sdt_drake.io.errors import InputError
from sdt_drake.motion import (
    LearnedReference,
    Motion,
    checked_torque,
    commanded_motion,
    ends_in_motion,
    load_command,
    margins,
    plan_motion,
    retime,
)
from sdt_drake.motion.smooth import Oscillation
from sdt_drake.run.simulate import simulate


@pytest.fixture(scope="module")
def plan(robot):
    return plan_motion(robot, load_command("reference", robot))


# --- limits ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "field, limits, message",
    [
        # Joint 2 goes from 0 at 2 s to 1.5 rad/s at 2.5 s: 1.4 at 2.4667 s.
        ("velocity_limit", [9, 1.4, 9, 9], "2.470 s: .* speed 1.41 rad/s, .* -1.4 to 1.4 rad/s"),
        ("acceleration_limit", [9, 2.0, 9, 9], "2.000 s: .* acceleration 3 rad/s², .* -2 to 2 "),
        ("effort_limit", [2e4, 4000, 2e4, 2e4], "9.000 s: .* torque .* -3600 to 3600 N m"),
        # ... 1.5 (t - 2.25) from then on.
        ("position_lower", [-9, 0.1, -9, -9], "0.000 s: .* position 0 rad"),
        ("position_upper", [99, 1.5, 99, 99], r"3.255 s: .* position 1\.50\S* rad"),
    ],
)
def test_plan_checks_every_limit_and_torque_with_margin(robot, plan, field, limits, message):
    weak = dataclasses.replace(robot, **{"effort_limit": 2 * LIMITS, field: np.array(limits)})
    with pytest.raises(InputError, match=f"joint 2 'roll' at {message}"):
        checked_torque(weak, plan.motion, torque_margin=0.9)


@pytest.mark.parametrize("use", [checked_torque, margins, plan_motion, retime])
def test_plan_of_other_joint_count_is_refused(robot, use):
    other = alone(knots([0, 0], [1, 0]), joints=3)
    with pytest.raises(InputError, match="3 joints, robot 'sdt' has 4"):
        use(robot, sampled(other) if use in (checked_torque, margins) else other)


def test_start_or_end_in_motion_is_refused_with_joint_and_speed(robot):
    motion = sampled(alone(knots([0, 0.5], [1, 0], [2, -0.25])))
    starts, ends = ends_in_motion(robot, motion)
    assert "starts at 0.5 rad/s" in starts and "ends at -0.25 rad/s" in ends


# --- what a period can show ------------------------------------------------------------------


def swing(amplitude, period):
    """10 s of it."""
    oscillation = Oscillation(amplitude=amplitude, period=period, fade=1, end=9)
    return dataclasses.replace(knots([0, 0], [10, 0]), smooth=((0.0, oscillation),))


@pytest.mark.parametrize(
    "joint, message",
    [
        # Up to 20 rad/s and back within a period: 0.02 rad.
        (knots([0, 0], [1.001, 0], [1.002, 20], [1.003, 0], [10, 0]), r"loses 1\.15 deg"),
        # At every sample the same phase of the swing: 80 % of 10 s at 1e-4 2 pi / 0.005 s.
        (swing(1e-4, PERIOD), r"loses 57\.6 deg"),
        # Four samples of each swing see a triangle: 0.01 (1 - pi / 4) rad are lost.
        (swing(0.01, 4 * PERIOD), r"loses 0\.12\d deg"),
        (knots([0, 9e3], [200, 9e3]), r"commanded 1e\+06 rad, .* 1e\+06 rad"),
        (knots([0, 0], [10, np.nan]), "commanded nan rad/s"),
    ],
    ids=["short", "fast swing", "swing of few samples", "angle", "no number"],
)
def test_command_too_fast_for_the_period_is_refused(robot, joint, message):
    with pytest.raises(InputError, match=rf"'alone': joint 2 'roll' at .*{message}"):
        commanded_motion(robot, alone(joint, 2), PERIOD)


# --- margins ---------------------------------------------------------------------------------


def test_reference_motion_is_unlimited_with_margins_of_its_torques(robot, plan):
    motion, report = plan.motion, margins(robot, plan.motion)
    assert not plan.limited.any() and plan.loss is None
    np.testing.assert_array_equal(checked_torque(robot, motion), plan.torque)
    assert repr(motion) == "<Motion of 4 joints: 30 s in steps of 5 ms>"
    assert plan.summary().title == "of 4 joints: 30 s in steps of 5 ms"
    assert motion.plot(robot.joint_names).axes
    with pytest.raises(InputError, match=r"joint_names: 3 name\(s\), expected 4"):
        motion.plot(robot.joint_names[:3])
    np.testing.assert_array_equal(plan.peak_use(robot), report.peak_torque / LIMITS)
    np.testing.assert_allclose(plan.peak_use(robot), [0.82, 0.93, 0.30, 0.23], atol=5e-3)
    # The integral of a motion that ends at rest, of the same samples.
    power = np.sum(report.torque[:-1] ** 2, axis=0) * motion.period / motion.duration
    np.testing.assert_allclose(report.rms_torque**2, power, rtol=1e-12)
    place = report.smallest
    assert (place.joint, place.quantity, place.time) == (1, "torque", 9)
    assert place.left == 1 - plan.peak_use(robot)[1]
    np.testing.assert_array_equal(report.to_stop, np.inf)
    limits = {"velocity_limit": [2.5, 9, 9, 9], "acceleration_limit": [9, 3.1, 9, 9]}
    limits = {name: np.array(limit) for name, limit in limits.items()}
    limited = margins(dataclasses.replace(robot, **limits), motion)
    speed, acceleration = limited.tightest(0), limited.tightest(1)
    assert (speed.quantity, acceleration.quantity) == ("speed", "acceleration")
    assert (speed.share, acceleration.share) == pytest.approx((2.4 / 2.5, 3 / 3.1))


def test_position_share_is_to_both_limits_or_a_single_one(robot, plan):
    pitch, yaw = np.degrees(plan.motion.q[:, 2:]).T
    # As calculated independently.
    found = [pitch.min(), pitch.max(), yaw.min(), yaw.max()]
    np.testing.assert_allclose(found, [-9.9, 1.6, -10.5, 18.0], atol=0.05)
    lower, upper = np.full((2, 4), np.inf) * [[-1], [1]]
    lower[2], upper[2] = np.radians([-12, 4])  # the middle is -4, 8 deg to either side
    upper[3] = np.radians(20)  # from the start, at 0
    limited = dataclasses.replace(robot, position_lower=lower, position_upper=upper)
    report = margins(limited, plan.motion)
    farthest = max(-4 - pitch.min(), pitch.max() + 4) / 8
    share = report.share["position"].max(axis=0)
    np.testing.assert_allclose(share, [0, 0, farthest, yaw.max() / 20], rtol=1e-9)
    to_stop = [min(pitch.min() + 12, 4 - pitch.max()), 20 - yaw.max()]
    np.testing.assert_allclose(np.degrees(report.to_stop[2:]), to_stop)
    lower[3], upper[3] = np.radians(-20), np.inf  # that alone, from the start
    share = margins(limited, plan.motion).share["position"][:, 3].max()
    assert share == pytest.approx(-yaw.min() / 20, rel=1e-9)
    lower[3] = 0  # it starts at the limit: no margin
    below = margins(limited, plan.motion)
    assert below.share["position"][0, 3] == 1 and below.smallest.left <= 0
    lower[3], upper[3] = -np.inf, 0.1
    turning = Motion.from_speeds(PERIOD, np.zeros(4), np.ones((3, 4)))  # at the start, too
    share = margins(limited, turning).share["position"][:, 3]
    np.testing.assert_allclose(share, turning.q[:, 3] / 0.1, atol=1e-12)


def test_envelope_limits_driving_but_not_braking(robot):
    motion = sampled(alone(knots([0, 0], [2, 1], [4, 1], [6, 0])))
    report = margins(falling(robot, 0.5, 1.5), motion)
    left = np.clip(1.5 - motion.v[:, 0], 0, 1)
    np.testing.assert_allclose(report.highest[:, 0], LIMITS[0] * left)
    np.testing.assert_allclose(report.lowest[:, 0], -LIMITS[0])

    used = margins(falling(robot, 0.5, 0.8), motion).share["torque at speed"][:, 0]
    assert used[round(3 / PERIOD)] < 1e-9 and used[round(1.9 / PERIOD)] == np.inf  # no torque there
    share, plain = (report.share[name][:, 0] for name in ("torque at speed", "torque"))
    driving = report.torque[:, 0] > 0
    np.testing.assert_allclose(share, np.where(driving, plain / left, plain))
    place = report.tightest(0)
    assert place.quantity == "torque at speed" and place.time == pytest.approx(1.995)


def test_torque_margin_sees_gravity_between_samples(robot):
    # Joint 2 turns at constant speed from hanging: gravity grows within each period.
    v = np.zeros((11, 4))
    v[:, 1] = 1.0
    assert margins(robot, Motion.from_speeds(0.005, np.zeros(4), v)).growth[1] == 0
    v[-1, 1] = 1.1  # now the last period accelerates, and the last sample does not
    assert margins(robot, Motion.from_speeds(0.005, np.zeros(4), v)).growth[1] > 0


# --- learned references ----------------------------------------------------------------------


@pytest.fixture
def p_pi(designed):
    """The cascade without feedforward, 0.5 s of the reference motion."""
    base = designed("coupled_pi", start=2.0, end=2.5)
    return base.variant(with_controller(base.scenario, "p_pi"))


def with_sine(wanted: Motion, size: float) -> Motion:
    """Joint 2 swings beside its motion, at 12 Hz for 0.25 s [rad]."""
    v, time = wanted.v.copy(), wanted.time
    v[:, 1] += size * 24 * np.pi * np.sin(24 * np.pi * time) * (time < 0.25)
    return Motion.from_speeds(wanted.period, wanted.q[0], v)


def test_learned_reference_is_tracked_with_errors_against_the_plan(p_pi, tmp_path):
    swing = LearnedReference(
        with_sine(p_pi.reference.planned, 1e-3), np.zeros_like(p_pi.reference.planned.q)
    )
    swing.to_csv(tmp_path / "learned.csv", p_pi.reference.planned)
    scenario = replace(p_pi.scenario, learned=str(tmp_path / "learned.csv"))
    design = p_pi.variant(scenario)
    run = simulate(design)
    np.testing.assert_array_equal(run.q_ref, p_pi.reference.planned.q)
    # It goes where the loop takes that reference, were it planned.
    planned = simulate(replace(p_pi, planned=design.reference.tracked))
    np.testing.assert_array_equal(run.q, planned.q)
    assert np.ptp(run.position_error[:, 1]) > 1e-3
    assert design.variant(p_pi.scenario).reference.tracked is p_pi.reference.planned
    with pytest.raises(InputError, match="inverse_dynamics: online"):
        p_pi.variant(replace(scenario, inverse_dynamics="online"))


def test_learned_reference_of_a_motion_nearby_is_refused(p_pi):
    nearby = with_sine(p_pi.reference.planned, 1e-3)  # within what learning may change
    p_pi.given(LearnedReference(nearby))
    with pytest.raises(InputError, match=r"joint 2 is .* deg from the planned motion"):
        p_pi.given(LearnedReference(nearby, planned=nearby.q))


@pytest.mark.parametrize("side", [0, 1])
def test_learned_torque_may_take_all_that_the_motors_have(p_pi, side):
    motion, robot = p_pi.reference.planned, p_pi.nominal
    p_pi.given(LearnedReference(motion, robot.torque_range(motion.v)[side] / robot.gear_ratio))


@pytest.mark.parametrize(
    ("change", "torque", "message"),
    [
        (lambda m: replace(m, q=m.q[:-1], v=m.v[:-1], vd=m.vd[:-1]), 0, "101 samples of 0.005 s"),
        (lambda m: replace(m, q=m.q + np.array([0, 0, 1e-6, 0])), 0, "joint 3 starts 1e-06"),
        (lambda m: with_sine(m, 0.06), 0, "joint 2 is .* deg from the planned motion"),
        (lambda m: with_sine(m, 0.01), 0, "joint 2 'roll' at .* needs torque"),
        (lambda m: m, 1e4, "joint 1 at 0.000 s: .* 10000 N m .*203.2 N m"),
    ],
)
def test_learned_reference_of_another_motion_or_beyond_limit_is_refused(
    p_pi, change, torque, message
):
    motion = change(p_pi.reference.planned)
    with pytest.raises(InputError, match=message):
        p_pi.given(LearnedReference(motion, np.full(motion.q.shape, float(torque))))
