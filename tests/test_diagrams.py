"""The scripts in diagrams/, and the exports of theirs that are committed."""

from __future__ import annotations

import ast
import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import sharing
from figures import check_same

from sdt_drake.analysis.block_diagrams import DIAGRAMS
from sdt_drake.graphviz import fingerprint, has_graphviz
from sdt_drake.motion import shipped_motions
from sdt_drake.studies.folder import load_runner
from sdt_drake.studies.results import read_study_table

FOLDER = Path(__file__).resolve().parents[1] / "diagrams"
ROWS = FOLDER / "studies"
STUDIES = ("monte_carlo", "sizing")
REDRAW = runpy.run_path(str(FOLDER / "redraw.py"))
WRITTEN = {
    **{name: [f"{name}.dot", f"{name}_plot.png"] for name in DIAGRAMS},
    "controllers": ["controllers_plot.png"],
    "stability": ["stability_plot.png"],
    "studies": [f"{name}_plot.png" for name in STUDIES],
    "training": ["training_post_roll.html", "training_post_roll_plot.png"],
    "device": ["device.png"],
    "identification": ["identification_plot.png"],
}
SCRIPTS = pytest.mark.parametrize("name", WRITTEN)


def run_here(script, *arguments, cwd):
    """What a user types, without a new process, which would import Drake once more."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(cwd)
        patch.setattr(sys, "argv", [str(script), *map(str, arguments)])
        runpy.run_path(str(script), run_name="__main__")


def files_in(folder):
    return {path.name: path for path in folder.iterdir()}


@pytest.fixture(scope="session")
def ran(tmp_path_factory):
    """Folder of a script, which is run once, from elsewhere."""
    elsewhere = tmp_path_factory.mktemp("elsewhere")

    def run(name):
        script, folder = FOLDER / f"{name}.py", sharing.folder / f"diagrams_{name}" / "new"
        arguments = [*REDRAW["BEFORE"].get(name, []), folder]
        if name == "training":
            arguments += ["--only", "post_roll", "--record"]

        def make():
            if name == "device":  # it is rendered, not in this process
                subprocess.run([sys.executable, script, folder], cwd=elsewhere, check=True)
            else:
                run_here(script, *arguments, cwd=elsewhere)
            return True

        sharing.once(f"diagrams_{name}", make)
        assert not any(elsewhere.iterdir())
        return folder

    return run


# --- what is committed -----------------------------------------------------------------------


def test_every_script_is_tried_and_nothing_else_is_committed():
    scripts = {f"{name}.py" for name in (*WRITTEN, "redraw")}
    written = {name for names in WRITTEN.values() for name in names if not name.endswith(".html")}
    written |= {f"{name}.svg" for name in DIAGRAMS}
    written |= {f"training_{name}_plot.png" for name in shipped_motions()}
    others = {"README.md", "exciting.yaml", "studies", "tutorial.ipynb"}
    others |= {"page.png"}  # `view` in a browser
    assert set(files_in(FOLDER)) == scripts | written | others
    assert set(files_in(ROWS)) == set(STUDIES)


@pytest.mark.parametrize("name", DIAGRAMS)
def test_committed_svg_was_made_from_the_committed_dot(name):
    text = (FOLDER / f"{name}.dot").read_text(encoding="utf-8")
    svg = (FOLDER / f"{name}.svg").read_text(encoding="utf-8")
    assert re.findall(r"dot sha256 [0-9a-f]+", svg) == [fingerprint(text)]
    blocks = set(re.findall(r'^  "([^"]+)" \[', text, re.M))
    assert blocks and blocks <= set(re.findall(r"<title>([^<>]+)</title>", svg))


@pytest.mark.parametrize(("name", "row"), [("monte_carlo", 0), ("sizing", 0)])
def test_committed_rows_are_those_of_today(name, row):
    (runner, _), table = load_runner(ROWS / name), read_study_table(ROWS / name)
    outcomes, _ = runner.repeat(row)
    expected = [values[row] for values in table.outcomes.values()]
    np.testing.assert_allclose(outcomes, expected, rtol=1e-3, atol=1e-5)


# --- the scripts -----------------------------------------------------------------------------


@SCRIPTS
def test_script_writes_what_it_says_into_a_new_folder(ran, name):
    expected = {*WRITTEN[name]}
    if name in DIAGRAMS and has_graphviz():
        expected.add(f"{name}.svg")
    files = files_in(ran(name))
    assert set(files) == expected
    usage = ast.get_docstring(ast.parse((FOLDER / f"{name}.py").read_text(encoding="utf-8")))
    assert f"python diagrams/{name}.py" in usage
    for file, path in files.items():
        assert file in usage or "training_NAME.html" in usage
        assert path.stat().st_size > (1000 if path.suffix == ".dot" else 10_000)
    if name == "training":
        assert "Post-roll" in files["training_post_roll.html"].read_text(encoding="utf-8")


@SCRIPTS
def test_what_is_committed_is_what_a_script_writes_today(ran, name):
    """Diagrams to the last letter, plots by the numbers in them."""
    for file in ran(name).iterdir():
        committed = FOLDER / file.name
        if file.suffix == ".dot":
            assert file.read_bytes() == committed.read_bytes(), f"run diagrams/{name}.py again"
        elif name != "device" and file.suffix == ".png":
            check_same(file, committed)


def test_one_command_runs_them_all(monkeypatch, tmp_path):
    commands = []
    monkeypatch.setattr(subprocess, "run", lambda command, check: commands.append(command))
    REDRAW["main"](tmp_path)
    assert [Path(command[1]).stem for command in commands] == sorted(WRITTEN)
    assert {command[-1] for command in commands} == {tmp_path}


def test_without_a_folder_and_graphviz_a_script_writes_the_rest_beside_itself(
    tmp_path, monkeypatch
):
    here, elsewhere = tmp_path / "diagrams", tmp_path / "elsewhere"
    here.mkdir()
    elsewhere.mkdir()
    shutil.copy(FOLDER / "figure5.py", here)
    monkeypatch.setenv("PATH", str(elsewhere))
    run_here(here / "figure5.py", cwd=elsewhere)
    assert set(files_in(here)) == {"figure5.py", "figure5.dot", "figure5_plot.png"}
    assert not any(elsewhere.iterdir())
