"""The script in diagrams/, and what of its is committed."""

import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from figures import check_same, content_of

import sdt_drake
from sdt_drake.show.block_diagrams import fingerprint, page_of
from sdt_drake.show.diagrams import dot_text
from sdt_drake.show.paper_diagrams import DIAGRAMS
from sdt_drake.studies.folder import load_runner
from sdt_drake.studies.results import read_study_table
from sdt_drake.studies.store import Store

FOLDER = Path(__file__).resolve().parents[1] / "diagrams"
ROWS = FOLDER / "studies"
STUDIES = ("monte_carlo", "sizing")
SCRIPT = FOLDER / "redraw.py"
REDRAW = runpy.run_path(str(SCRIPT))
NAMES = REDRAW["NAMES"]
TRIED = (
    *("figure3", "figure4", "coupled_loop", "controllers", "stability", "monte_carlo", "sizing"),
    "training_post_roll",
)
"""A figure for each function that draws; one of the training motions stands for all."""


def written(name):
    """What is committed of a figure."""
    if name == "device":
        return {"device.png"}
    diagram = {f"{name}.dot", f"{name}.svg"} if name in DIAGRAMS else set()
    return diagram | {f"{name}_plot.png"}


def names_in(folder):
    return {path.name for path in folder.iterdir()}


# --- what is committed -----------------------------------------------------------------------


def test_every_figure_is_drawn_by_the_script_and_nothing_else_is_committed():
    others = {"redraw.py", "README.md", "exciting.yaml", "studies", "tutorial.ipynb"}
    others |= {"page.png"}  # `view` in a browser
    assert names_in(FOLDER) == others.union(*map(written, NAMES))
    assert set(NAMES) >= {*DIAGRAMS, *STUDIES}
    assert names_in(ROWS) == set(STUDIES)


@pytest.mark.documents
@pytest.mark.parametrize("name", DIAGRAMS)
def test_committed_diagrams_are_those_of_the_loops_of_today(name):
    text, svg = ((FOLDER / f"{name}.{x}").read_text(encoding="utf-8") for x in ("dot", "svg"))
    page = page_of(DIAGRAMS[name](REDRAW["designed"]("coupled_pi")))
    assert dot_text(page) == text, "run redraw.py again"
    assert re.findall(r"dot sha256 [0-9a-f]+", svg) == [fingerprint(text)]
    blocks = set(re.findall(r'^  "([^"]+)" \[shape=(?:box|circle)', text, re.M))
    assert blocks and blocks <= set(re.findall(r'<g id="([^"]+)"', svg))


@pytest.mark.parametrize("name", STUDIES)
def test_committed_rows_are_those_of_today(name):
    (runner, *_), table = load_runner(ROWS / name), read_study_table(ROWS / name)
    with Store(ROWS / name) as store:
        outcomes, *_ = runner.repeat(0, store.inputs(0))
        ran = store.about["versions"]["package"]
    assert ran.split(".")[:2] == sdt_drake.__version__.split(".")[:2]
    for (outcome, values), found in zip(table.outcomes.items(), outcomes, strict=True):
        np.testing.assert_allclose(found, values[0], rtol=1e-3, atol=1e-5, err_msg=outcome)


# --- the script ------------------------------------------------------------------------------


@pytest.mark.documents
@pytest.mark.parametrize("name", TRIED)
def test_what_is_committed_is_what_the_script_draws_today(name, request, monkeypatch):
    """By the numbers and texts in it."""
    if name == "controllers":  # its runs are those of other tests
        runs = request.getfixturevalue("on_exact_model")
        own = REDRAW["main"].__globals__
        monkeypatch.setitem(own, "compare", lambda _, labels: [runs[label] for label in labels])
    drawn = REDRAW["figures"](ROWS)[name]()
    shown = {"numbers": REDRAW["drawn_numbers"](drawn), "texts": REDRAW["texts"](drawn)}
    check_same(shown, FOLDER / f"{name}_plot.png")
    if name == "training_post_roll":
        _, run, _ = REDRAW["flown"]("post_roll")
        assert np.degrees(np.abs(run.position_error)).max() < 0.03  # as is told of all of them


@pytest.mark.documents
def test_it_writes_all_of_a_figure_with_python_alone(tmp_path):
    command = [sys.executable, SCRIPT, "new", "--only", "figure5", "device"]
    subprocess.run(command, cwd=tmp_path, env=os.environ | {"PATH": ""}, check=True)
    assert names_in(tmp_path / "new") == written("figure5") | written("device")
    check_same(content_of(tmp_path / "new/figure5_plot.png"), FOLDER / "figure5_plot.png")
