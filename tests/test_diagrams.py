"""The scripts in diagrams/, and what of theirs is committed."""

import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers.figures import check_same, check_same_numbers, content_of

import sdt_drake
from sdt_drake.analysis.tracking import HeadTracking
from sdt_drake.motion import load_plan, story_of
from sdt_drake.paper.diagrams import DIAGRAMS
from sdt_drake.pilot.head import head_motion_of_samples
from sdt_drake.pilot.thresholds import felt_difference
from sdt_drake.run.simulate import simulate
from sdt_drake.show.block_diagrams import fingerprint, page_of
from sdt_drake.show.diagrams import dot_text
from sdt_drake.show.figures import pilot as plots_pilot
from sdt_drake.studies.folder import load_runner
from sdt_drake.studies.results import read_study_table
from sdt_drake.studies.store import Store

FOLDER = Path(__file__).resolve().parents[1] / "diagrams"
ROWS = FOLDER / "studies"
STUDIES = ("monte_carlo", "sizing")
SCRIPT = FOLDER / "redraw.py"
REDRAW = runpy.run_path(str(SCRIPT))
NAMES, SCRIPTS = REDRAW["NAMES"], REDRAW["SCRIPTS"]
FIGURES = REDRAW["figures"](ROWS)
PERIOD = 0.005  # s
TRIED = (
    *("figure3", "coupled_loop", "controllers", "stability", "identification"),
    *("filters", "observer", "gears", "monte_carlo", "sizing", "training_post_roll"),
)
"""A figure for each function that draws; one of the training motions stands for all."""


def written(name):
    """What is committed of a figure."""
    if name == "device":
        return {"device.png"}
    files = {f"{name}_plot.png"} if name in FIGURES else set()
    files |= {f"{name}.dot", f"{name}.svg"} if name in DIAGRAMS else set()
    script = SCRIPTS.get(name)
    return files | ({f"{script}.png", f"{script}_drake.dot"} if script else set())


def main_of(script):
    return runpy.run_path(str(FOLDER / f"{script}.py"))["main"]


def shown_in(figure):
    return {"numbers": REDRAW["drawn_numbers"](figure), "texts": REDRAW["texts"](figure)}


def names_in(folder):
    return {path.name for path in folder.iterdir()}


# --- what is committed -----------------------------------------------------------------------


def test_folder_holds_the_figures_of_the_script_and_nothing_else():
    others = {"redraw.py", "README.md", "exciting.yaml", "studies", "tutorial.ipynb"}
    others |= {"page.png"} | {f"{script}.py" for script in SCRIPTS.values()}  # page: of `view`
    assert names_in(FOLDER) == others.union(*map(written, NAMES))
    assert set(NAMES) >= {*DIAGRAMS, *STUDIES}
    assert names_in(ROWS) == set(STUDIES)


@pytest.mark.documents
@pytest.mark.parametrize("name", DIAGRAMS)
def test_committed_diagrams_equal_loops_of_today(name):
    text, svg = ((FOLDER / f"{name}.{x}").read_text(encoding="utf-8") for x in ("dot", "svg"))
    page = page_of(DIAGRAMS[name](REDRAW["designed"]("coupled_pi")))
    assert dot_text(page) == text, "run redraw.py again"
    assert re.findall(r"dot sha256 [0-9a-f]+", svg) == [fingerprint(text)]
    blocks = set(re.findall(r'^  "([^"]+)" \[shape=(?:box|circle)', text, re.M))
    assert blocks and blocks <= set(re.findall(r'<g id="([^"]+)"', svg))


@pytest.mark.documents
@pytest.mark.parametrize("name", STUDIES)
def test_committed_study_rows_equal_rows_of_today(name):
    (runner, *_), table = load_runner(ROWS / name), read_study_table(ROWS / name)
    with Store(ROWS / name) as store:
        outcomes, *_ = runner.repeat(0, store.inputs(0))
        ran = store.about.versions["package"]
    assert ran.split(".")[:2] == sdt_drake.__version__.split(".")[:2]
    for (outcome, values), found in zip(table.outcomes.items(), outcomes, strict=True):
        np.testing.assert_allclose(found, values[0], rtol=1e-3, atol=1e-5, err_msg=outcome)


@pytest.mark.documents
@pytest.mark.parametrize("name", ["leans", "inversion"])
def test_committed_training_figures_show_motions_of_today(robot, name):
    """All but the small errors of the run, for which it would have to be simulated."""
    motion = load_plan(name, robot, period=PERIOD).motion
    head = head_motion_of_samples(robot, PERIOD, motion.q, motion.v)
    felt = felt_difference(head, head, PERIOD)
    story = story_of(name, robot, motion)
    figure = plots_pilot.pilot(name, motion.time, HeadTracking(head, head, felt, felt), story)
    *panels, error, band = figure.axes
    illusion = figure.axes[0]
    assert story.illusion.quantity in illusion.get_title("left")
    shaded = illusion.collections[0].get_paths()[0].vertices[:, 0]
    ends = [shaded.min(), shaded.max()]
    np.testing.assert_allclose(ends, [story.illusion.start, story.illusion.end], atol=2 * PERIOD)
    count = sum(len(ax.lines) for ax in panels)
    committed = content_of(FOLDER / f"training_{name}_plot.png")
    check_same_numbers(REDRAW["drawn_numbers"](figure)[:count], committed["numbers"][:count], name)
    own = [text for text in REDRAW["texts"](figure) if text != error.get_title(loc="right")]
    assert set(own) <= set(committed["texts"]) and len(band.texts) == len(story.segments)


# --- the script ------------------------------------------------------------------------------


@pytest.mark.documents
@pytest.mark.parametrize("name", TRIED)
def test_committed_plots_equal_plots_of_today(name, request, monkeypatch):
    """By the numbers and texts in it."""
    if name == "controllers":  # its runs are those of other tests
        runs = request.getfixturevalue("on_exact_model")
        own = REDRAW["main"].__globals__
        monkeypatch.setitem(own, "compare", lambda _, labels: [runs[label] for label in labels])
    check_same(shown_in(FIGURES[name]()), FOLDER / f"{name}_plot.png")
    if name == "training_post_roll":
        _, run, _ = REDRAW["flown"]("post_roll")
        assert np.degrees(np.abs(run.position_error)).max() < 0.03  # as is told of all of them


@pytest.mark.documents
def test_redraw_needs_no_program_but_python(tmp_path):
    command = [sys.executable, SCRIPT, "new", "--only", "figure5", "device"]
    subprocess.run(command, cwd=tmp_path, env=os.environ | {"PATH": ""}, check=True)
    assert names_in(tmp_path / "new") == written("figure5") | written("device")
    check_same(content_of(tmp_path / "new/figure5_axis_pi.png"), FOLDER / "figure5_axis_pi.png")


# --- the loops that are wired in the open ----------------------------------------------------


@pytest.mark.documents
@pytest.mark.parametrize(
    ("script", "scenario", "fields"),
    [
        ("figure5_axis_pi", "axis_pi", {}),
        ("figure6_axis_ctc", "axis_pi_ctc", {}),
        ("coupled_loop", "coupled_pi_ctc", {"disturbance.amplitude": 0.05}),
    ],
)
def test_script_loop_equals_loop_of_its_scenario(
    script, scenario, fields, designed, tmp_path, capsys
):
    """A loop of 0.16 to 0.9 rad/s of error is met to 1e-9 rad/s at every sample of 30 s."""
    _, error = main_of(script)(tmp_path)
    expected = simulate(designed(scenario, fields)).speed_error
    np.testing.assert_allclose(error, expected, rtol=0, atol=1e-9)
    printed = [float(x) for x in capsys.readouterr().out.partition(":")[2].split()]
    assert printed == pytest.approx(np.abs(expected).max(axis=0), abs=5.1e-5)


@pytest.mark.parametrize("script", SCRIPTS.values())
def test_script_is_short_and_wires_its_loop_itself(script):
    text = (FOLDER / f"{script}.py").read_text(encoding="utf-8")
    assert 40 <= len(text.splitlines()) <= 80
    assert not re.search(r"make_loop|make_step_loop|sdt\.loop", text)


@pytest.mark.documents
@pytest.mark.parametrize("script", SCRIPTS.values())
def test_committed_script_files_equal_files_of_today(script, tmp_path):
    figure, _ = main_of(script)(tmp_path)
    check_same(shown_in(figure), FOLDER / f"{script}.png")
    dot = f"{script}_drake.dot"
    assert (tmp_path / dot).read_text() == (FOLDER / dot).read_text(), "run redraw.py again"
