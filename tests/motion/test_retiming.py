"""The retiming planner against closed forms and least times, and refused paths."""

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
    falling,
    faster,
    knots,
)
from robots import ARM, loaded

from sdt_drake.io.errors import InputError
from sdt_drake.motion import plan_motion, retime
from sdt_drake.motion import retiming as module

A_1 = LIMITS[0] / INERTIA_1  # rad/s²; what joint 1 can do alone


# --- closed forms ----------------------------------------------------------------------------


def test_torque_that_falls_with_speed_makes_the_fastest_timing_an_exponential(robot):
    """Of a path from rest to rest: v' = a (n0 - v) / (n0 - n1) up, and braking with all of a."""
    n1, n0 = 0.5, 1.7
    tau, angle, h = (n0 - n1) / A_1, 5.0, 1e-5
    v, q, up = 0.0, 0.0, 0.0
    while q + v**2 / (2 * A_1) < angle:
        v += h * min(A_1, (n0 - v) / tau)
        q, up = q + h * v, up + h
    least = up + v / A_1
    plan = retime(falling(robot, n1, n0), alone(knots([0, 0], [1, 2.5], [2, 2.5], [3, 0])))
    assert plan.motion.q[-1, 0] == pytest.approx(angle, abs=1e-4)
    assert least <= plan.motion.duration <= 1.005 * least + 3 * PERIOD
    left = 13655.04 * np.clip((n0 - plan.motion.v[:, 0]) / (n0 - n1), 0, 1)
    driving = plan.torque[:, 0] > 0
    assert np.all((plan.torque[:, 0] <= left + 1e-6)[driving])
    assert np.quantile((plan.torque[:, 0] / left)[driving], 0.1) > 0.99


def test_a_single_joint_spins_up_with_all_its_torque_and_ends_at_speed(robot):
    # v = a (t - 1) up to 1.6 rad/s; the path of 6.4 rad takes what is left of it at that speed.
    duration = 1 + 1.6 / A_1 + (1.6 + 4.8 - 1.6**2 / (2 * A_1)) / 1.6
    motion = retime(robot, alone(knots([0, 0], [1, 0], [3, 1.6], [6, 1.6]))).motion
    # A period of rest at the start, another to make the duration whole, a third for the grid.
    assert duration <= motion.duration <= duration + 3 * PERIOD
    assert motion.v[-1, 0] == pytest.approx(1.6, abs=1e-6)
    expected = np.clip(A_1 * (motion.time - (motion.duration - duration) - 1), 0, 1.6)
    np.testing.assert_allclose(motion.v[:, 0], expected, atol=A_1 * 2 * PERIOD)
    # At the end of the path it is where the command would be a little later, at its speed.
    assert 6.4 - 1e-6 <= motion.q[-1, 0] <= 6.4 + 1.6 * (motion.duration - duration)


def test_viscous_friction_slows_down_only_where_it_takes_the_torque():
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


# --- refused paths ---------------------------------------------------------------------------


def test_a_position_limit_on_the_path_is_refused(robot):
    limited = dataclasses.replace(robot, position_upper=np.array([99, 99, 0.02, 99]))
    with pytest.raises(InputError, match=r"joint 3 'pitch' at .* s: .*position .* 0\.02 rad"):
        retime(limited, faster(robot, 2.95))


@pytest.mark.parametrize("planner", [plan_motion, retime])
def test_a_motor_that_cannot_hold_its_link_is_refused(planner):
    arm = loaded(ARM.replace("<effort>40", "<effort>3"))
    needed = -2 * 9.81 * 0.3  # N m: 2 kg at 0.3 m
    with pytest.raises(InputError, match=rf"joint 2 'elbow'.* 0\.000 s.* {needed:g} N m.*±3 N m"):
        planner(arm, alone(knots([0, 0], [1, 0]), joints=2))


@pytest.mark.parametrize("when, speeds", [("start", (1.0, -1.0)), ("end", (0.0, 1.0))])
def test_an_end_in_motion_beyond_the_torque_is_refused(robot, when, speeds):
    with pytest.raises(InputError, match=rf"'alone' refused: .*{when}.* joint 1 .* N m"):
        retime(robot, alone(knots([0, speeds[0]], [1, speeds[1]])), torque_margin=0.05)


# 45000 rad at the speed limit; nothing but inertia: times go with the root of the torque.
@pytest.mark.parametrize("speed, margin", [(9000, 1), (0.05, 1e-6), (1, 1e-300)])
def test_a_hundred_times_the_duration_is_refused(robot, speed, margin):
    with pytest.raises(InputError, match=r"'alone' refused: .* most 100 times as long"):
        retime(robot, alone(knots([0, 0], [5, speed], [10, 0])), torque_margin=margin)


def test_more_periods_than_a_motion_may_have_are_refused(robot, monkeypatch):
    monkeypatch.setattr(module, "MAX_PERIODS", 840)
    assert retime(robot, SHORT, torque_margin=0.5).motion.duration < 4.2
    with pytest.raises(InputError, match=r"'short' refused: .* 1\.05 times as long .*, 4 s"):
        retime(robot, SHORT, torque_margin=0.4)
