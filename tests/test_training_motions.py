"""Every shipped training motion: planned with both planners, drawn, and told."""

import runpy
from pathlib import Path

import numpy as np
import pytest
from figures import check_same_numbers, content_of

from sdt_drake.analysis.perception import canals, felt_difference
from sdt_drake.analysis.tracking import HeadTracking
from sdt_drake.motion import PLANNERS, load_plan, shipped_motions, story_of
from sdt_drake.robot.head import head_motion_of_samples
from sdt_drake.show.figures import pilot as plots_pilot

FIGURES = Path(__file__).resolve().parents[1] / "diagrams"
REDRAW = runpy.run_path(str(FIGURES / "redraw.py"))
PERIOD = 0.005


@pytest.mark.parametrize("name", shipped_motions())
def test_both_planners_leave_it_as_it_is_with_motors_to_spare(robot, name):
    # A coarse period: every sample of it is one of the motion.
    limiter, retiming = (load_plan(name, robot, period=0.05, planner=p) for p in PLANNERS)
    for plan in (limiter, retiming):
        assert not plan.limited.any() and plan.peak_use(robot).max() <= 0.9
        np.testing.assert_allclose(plan.motion.v, plan.commanded.v, atol=1e-12)
    motion = limiter.motion
    assert np.abs(motion.v).max() > 0.1 and not motion.v[0].any() and not motion.v[-1].any()


@pytest.mark.parametrize("name", ["leans", "inversion"])
def test_committed_figures_show_the_motions_of_today(robot, name):
    """All but the small errors of the run, for which it would have to be simulated."""
    motion = load_plan(name, robot, period=PERIOD).motion
    head = head_motion_of_samples(robot, PERIOD, motion.q, motion.v)
    felt = felt_difference(head, head, PERIOD)
    story = story_of(name, robot, motion)
    figure = plots_pilot.pilot(name, motion.time, HeadTracking(head, head, felt, felt), story)
    *panels, error, band = figure.axes
    count = sum(len(ax.lines) for ax in panels)
    committed = content_of(FIGURES / f"training_{name}_plot.png")
    check_same_numbers(REDRAW["drawn_numbers"](figure)[:count], committed["numbers"][:count], name)
    own = [text for text in REDRAW["texts"](figure) if text != error.get_title(loc="right")]
    assert set(own) <= set(committed["texts"]) and len(band.texts) == len(story.segments)


def test_inversion_is_told_as_a_tumble_backwards(robot):
    """At the push-over, 30 to 34 s, the canals tell nose up, and the force comes from in front."""
    motion = load_plan("inversion", robot, period=PERIOD).motion
    head = head_motion_of_samples(robot, PERIOD, motion.q, motion.v)
    push = slice(round(30.5 / PERIOD), round(33 / PERIOD))
    pitch = np.degrees(canals(head.angular_velocity, PERIOD)[:, 1])  # + is nose down
    assert pitch[push].min() < -40 and pitch[push].max() < 0
    forwards = head.specific_force[push, 0]
    assert forwards.max() > 1.2 and forwards.min() > 0
