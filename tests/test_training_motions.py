"""Every shipped training motion: planned with both planners, drawn, and told."""

import runpy
from pathlib import Path

import pytest
from helpers.figures import check_same_numbers, content_of

from sdt_drake.analysis.tracking import HeadTracking
from sdt_drake.motion import load_plan, story_of
from sdt_drake.pilot.head import head_motion_of_samples
from sdt_drake.pilot.thresholds import felt_difference
from sdt_drake.show.figures import pilot as plots_pilot

FIGURES = Path(__file__).resolve().parents[1] / "diagrams"
REDRAW = runpy.run_path(str(FIGURES / "redraw.py"))
PERIOD = 0.005


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
