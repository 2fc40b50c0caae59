"""The script in diagrams/, and what of its is committed."""

from __future__ import annotations

import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from figures import check_same

import sdt_drake
from sdt_drake.show.block_diagrams import fingerprint
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
TRAINING = [name for name in NAMES if name.startswith("training_")]
# One of the training motions stands for all.
TRIED = [name for name in NAMES if name not in TRAINING or name == "training_post_roll"]


def written(name):
    """What is committed of a figure."""
    if name == "device":
        return {"device.png"}
    diagram = {f"{name}.dot", f"{name}.svg"} if name in DIAGRAMS else set()
    return diagram | {f"{name}_plot.png"}


def run_here(script, *arguments, cwd):
    """What a user types, without a new process, which would import Drake once more."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(cwd)
        patch.setattr(sys, "argv", [str(script), *map(str, arguments)])
        runpy.run_path(str(script), run_name="__main__")


def files_in(folder):
    return {path.name: path for path in folder.iterdir()}


@pytest.fixture
def ran(tmp_path):
    """Folder with a figure that is drawn from elsewhere."""
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()

    def run(name):
        arguments = [tmp_path / "new", "--only", name, "--record"]
        if name == "device":  # it is rendered, not in this process
            subprocess.run([sys.executable, SCRIPT, *arguments], cwd=elsewhere, check=True)
        else:
            run_here(SCRIPT, *arguments, cwd=elsewhere)
        assert not any(elsewhere.iterdir())
        return tmp_path / "new"

    return run


# --- what is committed -----------------------------------------------------------------------


def test_every_figure_is_drawn_by_the_script_and_nothing_else_is_committed():
    others = {"redraw.py", "README.md", "exciting.yaml", "studies", "tutorial.ipynb"}
    others |= {"page.png"}  # `view` in a browser
    assert set(files_in(FOLDER)) == others.union(*map(written, NAMES))
    assert set(NAMES) >= {*DIAGRAMS, *STUDIES}
    assert set(files_in(ROWS)) == set(STUDIES)


@pytest.mark.parametrize("name", DIAGRAMS)
def test_committed_svg_was_made_from_the_committed_dot(name):
    text = (FOLDER / f"{name}.dot").read_text(encoding="utf-8")
    svg = (FOLDER / f"{name}.svg").read_text(encoding="utf-8")
    assert re.findall(r"dot sha256 [0-9a-f]+", svg) == [fingerprint(text)]
    blocks = set(re.findall(r'^  "([^"]+)" \[shape=(?:box|circle)', text, re.M))
    assert blocks and blocks <= set(re.findall(r'<g id="([^"]+)"', svg))


@pytest.mark.parametrize("name", STUDIES)
def test_committed_rows_are_of_this_minor_version(name):
    with Store(ROWS / name) as store:
        ran = store.about["versions"]["package"]
    assert ran.split(".")[:2] == sdt_drake.__version__.split(".")[:2]


@pytest.mark.parametrize(("name", "row"), [("monte_carlo", 0), ("sizing", 0)])
def test_committed_rows_are_those_of_today(name, row):
    (runner, *_), table = load_runner(ROWS / name), read_study_table(ROWS / name)
    with Store(ROWS / name) as store:
        outcomes, *_ = runner.repeat(row, store.inputs(row))
    for (outcome, values), found in zip(table.outcomes.items(), outcomes, strict=True):
        np.testing.assert_allclose(found, values[row], rtol=1e-3, atol=1e-5, err_msg=outcome)


# --- the script ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", TRIED)
def test_what_is_committed_is_what_the_script_writes_today(ran, name):
    """Diagrams to the last letter, plots by the numbers in them."""
    files = files_in(ran(name))
    assert set(files) == written(name) | ({f"{name}.html"} if name in TRAINING else set())
    for file in files.values():
        assert file.stat().st_size > (1000 if file.suffix == ".dot" else 10_000)
        if file.suffix == ".dot":
            assert file.read_bytes() == (FOLDER / file.name).read_bytes(), "run redraw.py again"
        elif file.suffix == ".html":
            assert "Post-roll" in file.read_text(encoding="utf-8")
        elif name != "device" and file.suffix == ".png":
            check_same(file, FOLDER / file.name)


def test_without_arguments_it_draws_all_beside_itself_with_python_alone(tmp_path, monkeypatch):
    shutil.copy(SCRIPT, tmp_path)
    monkeypatch.setenv("PATH", str(tmp_path))
    run_here(tmp_path / "redraw.py", "--only", "figure5", cwd=tmp_path.parent)
    assert set(files_in(tmp_path)) == {"redraw.py", *written("figure5")}
    drawn, main = [], REDRAW["main"]
    monkeypatch.setitem(main.__globals__, "draw", lambda *what, record: drawn.append(what))
    monkeypatch.setattr(sys, "argv", [str(SCRIPT), str(tmp_path)])
    main()
    assert drawn == [(name, tmp_path, ROWS) for name in NAMES]
