"""Every shipped training motion: planned with both planners, simulated, within 0.2 deg."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from figures import check_same_numbers

from sdt_drake.analysis import plots_pilot, style
from sdt_drake.analysis.tracking import track_head
from sdt_drake.design import load_plan, make_design
from sdt_drake.dynamics import torque_groups
from sdt_drake.errors import InputError
from sdt_drake.motion import PLANNERS, shipped_motions
from sdt_drake.pilot import canals, head_motion_of_samples
from sdt_drake.scenario import load_scenario
from sdt_drake.simulate import simulate

FIGURES = Path(__file__).resolve().parents[1] / "diagrams"
NAMES = shipped_motions()
PERIOD = 0.005


def test_there_are_at_least_eight():
    assert len(NAMES) >= 8 and len(set(NAMES)) == len(NAMES)


@pytest.fixture(scope="module")
def plans(robot):
    """By name and planner, each planned once."""
    made = {}

    def get(name, planner):
        if (name, planner) not in made:
            made[name, planner] = load_plan(name, robot, period=PERIOD, planner=planner)
        return made[name, planner]

    return get


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("planner", PLANNERS)
def test_both_planners_leave_it_as_it_is(robot, plans, name, planner):
    plan = plans(name, planner)
    assert not plan.limited.any()
    assert plan.peak_use(robot).max() <= 0.9
    np.testing.assert_array_equal(plan.motion.v[-1], 0)
    np.testing.assert_allclose(plan.motion.v, plans(name, "limiter").motion.v, atol=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_weaker_motors_make_it_slower_but_keep_its_path(robot, plans, name):
    """With nine tenths of the torque that it needs; no timing helps where gravity takes that."""
    free = plans(name, "limiter")
    share = 0.9 * free.peak_use(robot).max()
    rest = np.zeros_like(free.motion.q)
    gravity = np.abs(torque_groups(robot, free.motion.q, rest, rest).gravity)
    if np.any(gravity > share * robot.effort_limit):
        with pytest.raises(InputError, match=r"to hold its links.*no slower motion needs less"):
            load_plan(name, robot, period=PERIOD, planner="retiming", torque_margin=share)
        return
    slower = load_plan(name, robot, period=PERIOD, planner="retiming", torque_margin=share)
    assert slower.motion.duration > free.motion.duration
    assert np.all(np.abs(slower.torque) <= share * robot.effort_limit + 1e-6)
    # Each point of the slower motion has one near it on the path.
    dense, q = free.motion.q, slower.motion.q[::40]
    off = np.abs(q[:, None, :] - dense[None, :, :]).max(axis=2).min(axis=1)
    assert off.max() <= np.abs(np.diff(dense, axis=0)).max() / 2 + 1e-4


@pytest.mark.parametrize("name", NAMES)
def test_every_joint_stays_within_a_fifth_of_a_degree(robot, plans, name, tmp_path):
    """And the committed figure of it is that of today."""
    scenario = load_scenario("package://sdt/scenarios/training.yaml")
    assert scenario.plant.kind == "coupled"
    assert (scenario.controller.kind, scenario.controller.feedforward_in_use) == ("p_pi", "id")
    design = make_design(scenario, robot=robot, motion=plans(name, "limiter").motion)
    run = simulate(design)
    assert np.degrees(np.abs(run.position_error)).max() < 0.2
    figure = plots_pilot.pilot(name, run.time, track_head(run, robot))
    drawn = style.save(figure, tmp_path / "run.png")
    check_same_numbers(drawn, FIGURES / f"training_{name}_plot.png")


def test_inversion_is_told_as_a_tumble_backwards(robot, plans):
    """At the push-over, 30 to 34 s, the canals tell nose up, and the force comes from in front."""
    motion = plans("inversion", "limiter").motion
    head = head_motion_of_samples(robot, PERIOD, motion.q, motion.v)
    push = slice(round(30.5 / PERIOD), round(33 / PERIOD))
    pitch = np.degrees(canals(head.angular_velocity, PERIOD)[:, 1])  # + is nose down
    assert pitch[push].min() < -40 and pitch[push].max() < 0
    forwards = head.specific_force[push, 0]
    assert forwards.max() > 1.2 and forwards.min() > 0
