"""The gallery: what figures show and what reports say, committed; `--regen-all` renews it."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.figures import check_same_text, described
from helpers.gallery_inputs import COLUMNS, FAMILIES, NAMES, ROBOT, SIZING, Inputs

from sdt_drake.io.errors import InputError
from sdt_drake.machine.identify.model import identified_robot
from sdt_drake.motion import Story, TimedSegment
from sdt_drake.pilot.illusions import feel
from sdt_drake.robot.dynamics import Loads
from sdt_drake.show.figures import (
    fly,
    fronts,
    identification,
    learning,
    motions,
    pilot,
    runs,
    scope,
    studies,
)
from sdt_drake.show.figures.coupled_loop import coupled_loop
from sdt_drake.show.figures.replay import replay_figure
from sdt_drake.show.panels import Plots, picture
from sdt_drake.show.reports import fly as fly_report
from sdt_drake.show.reports import identification as identification_report
from sdt_drake.show.reports import learning as learning_report
from sdt_drake.show.reports import replay as replay_report
from sdt_drake.show.reports import run as run_report
from sdt_drake.show.reports import sizing as sizing_report
from sdt_drake.show.reports import study as study_report
from sdt_drake.show.view3d import viewer


@pytest.fixture(scope="module")
def inputs(designed, robot):
    return Inputs(designed, robot)


# --- figures ---------------------------------------------------------------------------------

STORY = Story(
    "Spin",
    "It stops.",
    (
        TimedSegment("yaw", 0, 2, "to 1 deg/s, cosine"),
        TimedSegment("yaw", 2, 7, "hold"),
        TimedSegment("roll", 3, 3.1, "to 1.5 G"),
    ),
)


def _torques(x):
    rows = np.ones_like(x.motion.v)
    loads = Loads(load_torque=rows, alleviating_torque=rows * [1.0, -2.0, 0.0])
    return runs.torques("torques", x.runs["pi"], loads, ROBOT)


def _inertia(x):
    t = x.motion.time[:, None]
    i_eff = np.hstack([4 + np.sin(t), 100 - 10 * t, np.full_like(t, 7.0)])
    return runs.effective_inertia("inertia", x.motion.time, i_eff, NAMES, [5.5, 101, 8])


def _percept(x):
    _, head = x.head
    return pilot.percept("felt", feel(head.achieved, 0.02, "clark2019"))


def _of_report(report):
    """The plots of a report, one below the other."""
    blocks = [block for section in report.sections for block in section.blocks]
    plots = [x.content for x in blocks if isinstance(getattr(x, "content", None), Plots)]
    panels = [panel for one in plots for column in one.columns for panel in column]
    return picture("of the report", [panels])


def _page(x):
    design, run = x.ran
    return _of_report(run_report.run_report(design, run, Path("x.html"), [1]))


FIGURES = {
    "trajectories": lambda x: runs.trajectories("motion", x.motion, NAMES),
    "step_responses": lambda x: runs.step_responses("steps", x.steps),
    "loop_step": lambda x: runs.loop_step(x.stepped),
    "speeds": lambda x: runs.speeds("speeds", x.runs, NAMES),
    "speed_errors": lambda x: runs.speed_errors("errors", x.runs, NAMES, x.motion),
    "torques": _torques,
    "effective_inertia": _inertia,
    "error_budget": lambda x: runs.error_budget("budget", x.budget, NAMES),
    "bode": lambda x: runs.bode("bode", x.response, NAMES),
    "coupled_loop": lambda x: coupled_loop("coupled loop", x.response, NAMES),
    "stability": lambda x: runs.stability("stability", x.sweeps, NAMES),
    "comparison": lambda x: runs.comparison("comparison", x.compared((1.0, 0.1, 0.004))),
    "nothing_to_compare": lambda x: runs.comparison("none", x.compared((0, 0, 0), head=False)),
    "scope": lambda x: scope.scope("run", *reversed(x.ran)),
    "run_page": _page,
    "pilot": lambda x: pilot.pilot("run", *x.head, STORY),
    "percept": _percept,
    "plan": lambda x: motions.plan("a plan", *x.planned),
    "distributions": lambda x: studies.distributions("study", x.table, FAMILIES),
    "tornado": lambda x: studies.tornado_figure("study", x.table, FAMILIES[1]),
    "scatter": lambda x: studies.scatter_matrix("study", x.table, COLUMNS[2:], FAMILIES[1:3]),
    "pareto": lambda x: fronts.pareto_figure("study", x.table, FAMILIES[2], FAMILIES[1]),
    "sizing_front": lambda x: fronts.sizing_front("motors", x.verdicts),
    "replay": lambda x: replay_figure(x.replay),
    "identified_torques": lambda x: identification.torques_figure(x.found),
    "friction": lambda x: identification.residuals_figure(x.found, x.found.plant_friction),
    "convergence": lambda x: learning.checks(
        "checks", x.learned[2], x.learned[1], x.robot.joint_names
    ),
    "flights": lambda x: learning.flights("flights", x.learned[3].trials, x.robot.joint_names),
    "errors_of_flights": lambda x: learning.errors(
        "errors", x.learned[0].reference.planned.time, x.learned[3].trials[:2], x.robot.joint_names
    ),
    "fly_front": lambda x: fly.front(x.flown),
    "fly_page": lambda x: _of_report(fly_report.fly_report(x.flown)),
}


@pytest.mark.parametrize("name", FIGURES)
def test_figure_shows_as_committed(name, inputs, no_3d, file_regression):
    file_regression.check(
        described(FIGURES[name](inputs)), basename=name, encoding="utf-8", check_fn=check_same_text
    )


@pytest.mark.parametrize("order", (1, -1))
def test_unsettled_response_is_shown_whole_in_any_order(inputs, order):
    short, long = inputs.steps.values()
    never = replace(long, metrics=replace(long.metrics, settling_time=np.nan, rise_time=np.nan))
    steps = dict(list({"pi": short, "p_in_feedback": never}.items())[::order])
    (ax,) = runs.step_responses("steps", steps).axes
    assert ax.get_xlim() == (0, never.time[-1])
    (label,) = (line.get_label() for line in ax.lines if "I-P" in line.get_label())
    assert "rise – s, settling – s" in label


# --- reports ---------------------------------------------------------------------------------


@pytest.fixture
def no_3d(monkeypatch):
    """Recordings in 3D have their own tests."""

    def recorded_page(robot, time, q, **options):
        if len(time) > 50:
            raise InputError("lasts 9000 s, expected at most 3600 s to show")
        return ""

    monkeypatch.setattr(viewer, "recorded_page", recorded_page)


def _written(write):
    def text(x, folder):
        write(x, folder)
        return (folder / "report.md").read_text(encoding="utf-8")

    return text


def _run(name):
    def text(x, folder):
        design, run = getattr(x, name)
        return run_report.run_report(design, run, folder / "x.md", range(4)).markdown()

    return text


def _identified(x, folder):
    robot = identified_robot(x.found)
    files = x.found.plant_friction
    identification_report.write_identification_report(x.found, robot, files, folder, ["a note"])
    page = (folder / "report.md").read_text(encoding="utf-8")  # five digits of an optimum
    page = re.sub(r"(?<=\| )-?\d+\.?\d*(?= \|)", lambda x: f"{float(x[0]):.3g}", page)
    (folder / "report.md").write_text(page, encoding="utf-8")


REPORTS = {
    "report_of_a_run": _run("ran"),
    "report_of_a_calm_run": _run("calm"),
    "report_of_a_study": lambda x, folder: study_report.make_study_report(x.table, folder)[
        0
    ].markdown(),
    "report_of_a_sizing": lambda x, folder: sizing_report.sizing_report(
        SIZING, x.verdicts, "2 of 16 runs failed"
    ).markdown(),
    "report_of_a_replay": _written(lambda x, folder: replay_report.write_replay(x.replay, folder)),
    "report_of_an_identification": _written(_identified),
    "report_of_a_learning": _written(
        lambda x, folder: learning_report.write_learning_report(folder, *x.learned)
    ),
    "report_of_a_flight": lambda x, folder: fly_report.fly_report(x.flown).markdown(),
}


def normalised(text, folder):
    """A text without what differs from machine to machine: versions, wall times, paths."""
    text = text.replace(str(folder), "FOLDER").partition("|  | wall time [s] |")[0]
    text = re.sub(r"(sdt_drake|drake) \d[\w.]*\d", r"\1 VERSION", text)
    return re.sub(r"(?m)^\| (package|drake|numpy|scipy|python) \| .*$", r"| \1 | VERSION |", text)


@pytest.mark.parametrize("name", REPORTS)
def test_report_says_as_committed(name, inputs, no_3d, undrawn, tmp_path, file_regression):
    text = normalised(REPORTS[name](inputs, tmp_path), tmp_path)
    file_regression.check(
        text, basename=name, extension=".md", encoding="utf-8", check_fn=check_same_text
    )


def test_report_of_the_paper_says_as_committed(reproduced, file_regression):
    text = normalised((reproduced / "report.md").read_text(encoding="utf-8"), reproduced)
    as_committed = {"extension": ".md", "encoding": "utf-8", "check_fn": check_same_text}
    file_regression.check(text, basename="report_of_the_paper", **as_committed)
