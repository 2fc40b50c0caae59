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
from figures import check_same_numbers

from sdt_drake.analysis.block_diagrams import DIAGRAMS, write_block_diagram
from sdt_drake.graphviz import dot_text, fingerprint, has_graphviz
from sdt_drake.motion import shipped_motions
from sdt_drake.studies.execute import run_study
from sdt_drake.studies.folder import load_runner
from sdt_drake.studies.job import make_job
from sdt_drake.studies.results import read_study_table
from sdt_drake.studies.sizing import load_sizing
from sdt_drake.studies.study import load_study

FOLDER = Path(__file__).resolve().parents[1] / "diagrams"
SCRIPTS = sorted(path.stem for path in FOLDER.glob("*.py"))
FIGURES = sorted(DIAGRAMS)
PLOTS = ("controllers", "stability")  # scripts that write a plot and no diagram
STUDIES = ("monte_carlo", "sizing")
TRAINING = {f"training_{name}_plot.png" for name in shipped_motions()}
PNG = b"\x89PNG\r\n"


def run(script, *arguments, cwd):
    """What a user types, from another folder."""
    return subprocess.run(
        [sys.executable, str(script), *map(str, arguments)],
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=120,
    )


def run_here(script, *arguments, cwd):
    """The same without a new process, which would import Drake once more; raises what it raises."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(cwd)
        patch.setattr(sys, "argv", [str(script), *map(str, arguments)])
        runpy.run_path(str(script), run_name="__main__")


def study_folders(folder):
    """Of the shipped studies, with few of their runs."""
    study, base = load_study("package://sdt/studies/monte_carlo.yaml")
    study.draws = 1
    run_study(make_job(study, base), folder / "mc", workers=2)
    sizing, base = load_sizing("package://sdt/studies/sizing.yaml")
    sizing.motors = [[ids[0]] for ids in sizing.motors]
    sizing.structure_scales, sizing.controllers = [0.8], ["pi", "pi_id"]
    sizing.motions = ["post_roll"]
    run_study(make_job(sizing.study(), base), folder / "sizing", workers=2)
    return folder / "mc", folder / "sizing"


@pytest.fixture(scope="session")
def ran(tmp_path_factory):
    """Folder of each script, run from another folder; two of them as a user runs them."""
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    folders = {name: tmp_path_factory.mktemp("figures") for name in SCRIPTS}
    for name, folder in folders.items():
        script = FOLDER / f"{name}.py"
        if name in ("device", "figure3"):  # the device is rendered: not in this process
            done = run(script, folder, cwd=elsewhere)
            assert done.returncode == 0, done.stderr
            assert "Warning" not in done.stderr
        elif name == "studies":
            of = study_folders(tmp_path_factory.mktemp("studies"))
            run_here(script, *of, folder, cwd=elsewhere)
        elif name == "training":  # one of its motions: they take seconds each
            run_here(script, folder, "--only", "post_roll", "--record", cwd=elsewhere)
        else:
            run_here(script, folder, cwd=elsewhere)
    assert list(elsewhere.iterdir()) == []
    return folders


# --- what is committed -----------------------------------------------------------------------


def test_there_is_a_script_for_every_diagram():
    assert set(SCRIPTS) >= {*DIAGRAMS, "figure3", "figure4", "figure5", "figure6"}


@pytest.mark.parametrize("name", FIGURES)
def test_committed_dot_is_up_to_date(name, design):
    committed = (FOLDER / f"{name}.dot").read_text(encoding="utf-8")

    assert committed == dot_text(DIAGRAMS[name](design)), f"run diagrams/{name}.py again"


@pytest.mark.parametrize("name", FIGURES)
def test_committed_svg_was_made_from_the_committed_dot(name):
    text = (FOLDER / f"{name}.dot").read_text(encoding="utf-8")
    svg = (FOLDER / f"{name}.svg").read_text(encoding="utf-8")

    assert re.findall(r"dot sha256 [0-9a-f]+", svg) == [fingerprint(text)]
    assert "<svg" in svg and "</svg>" in svg


@pytest.mark.parametrize("name", FIGURES)
def test_committed_svg_shows_every_block(name):
    dot = (FOLDER / f"{name}.dot").read_text(encoding="utf-8")
    svg = (FOLDER / f"{name}.svg").read_text(encoding="utf-8")

    blocks = set(re.findall(r'^  "([^"]+)" \[', dot, re.M))
    assert blocks and blocks <= set(re.findall(r"<title>([^<>]+)</title>", svg))


def test_nothing_is_committed_that_no_script_writes():
    written = {f"{name}.{suffix}" for name in FIGURES for suffix in ("dot", "svg")}
    written |= {f"{name}_plot.png" for name in (*FIGURES, *PLOTS, *STUDIES)} | {"device.png"}
    written |= TRAINING
    there = {path.name for path in FOLDER.iterdir() if path.is_file()}
    assert {path.name for path in (FOLDER / "studies").iterdir()} == set(STUDIES)

    assert there - {f"{name}.py" for name in SCRIPTS} - {"tutorial.ipynb"} == written


@pytest.mark.parametrize("name", [*FIGURES, *PLOTS])
def test_committed_plot_shows_the_numbers_of_today(ran, name):
    check_same_numbers(ran[name] / f"{name}_plot.png", FOLDER / f"{name}_plot.png")


@pytest.mark.parametrize("name", STUDIES)
def test_committed_plot_of_a_study_shows_its_committed_rows(tmp_path, name):
    folders = (FOLDER / "studies" / study for study in STUDIES)
    run_here(FOLDER / "studies.py", *folders, tmp_path, cwd=tmp_path)
    check_same_numbers(tmp_path / f"{name}_plot.png", FOLDER / f"{name}_plot.png")


@pytest.mark.parametrize(("name", "row"), [("monte_carlo", 0), ("sizing", 0), ("sizing", 40)])
def test_committed_rows_are_those_of_today(name, row):
    folder = FOLDER / "studies" / name
    (runner, _), table = load_runner(folder), read_study_table(folder)
    outcomes, _ = runner.repeat(row)
    expected = [values[row] for values in table.outcomes.values()]
    np.testing.assert_allclose(outcomes, expected, rtol=1e-3, atol=1e-5)


# --- the scripts -----------------------------------------------------------------------------


@pytest.mark.parametrize("name", FIGURES)
def test_script_writes_the_committed_dot_and_a_plot(ran, name):
    folder = ran[name]

    expected = {f"{name}.dot", f"{name}_plot.png"} | ({f"{name}.svg"} if has_graphviz() else set())
    assert {path.name for path in folder.iterdir()} == expected
    assert (folder / f"{name}.dot").read_bytes() == (FOLDER / f"{name}.dot").read_bytes()
    plot = (folder / f"{name}_plot.png").read_bytes()
    assert plot.startswith(PNG) and len(plot) > 10_000


@pytest.mark.parametrize("name", FIGURES)
def test_script_writes_a_picture_of_the_diagram(ran, name):
    if shutil.which("dot") is None:
        pytest.skip("needs Graphviz")
    folder = ran[name]
    dot = (folder / f"{name}.dot").read_text(encoding="utf-8")

    assert fingerprint(dot) in (folder / f"{name}.svg").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", PLOTS)
def test_script_writes_a_plot(ran, name):
    (plot,) = ran[name].iterdir()
    assert plot.name == f"{name}_plot.png"
    assert plot.read_bytes().startswith(PNG) and plot.stat().st_size > 10_000


def test_a_training_motion_gets_a_plot_and_a_recording(ran):
    page, plot = sorted(ran["training"].iterdir())
    assert (page.name, plot.name) == ("training_post_roll.html", "training_post_roll_plot.png")
    assert plot.read_bytes().startswith(PNG) and plot.stat().st_size > 10_000
    assert "Post-roll" in page.read_text(encoding="utf-8")


def test_studies_are_drawn(ran):
    plots = sorted(ran["studies"].iterdir())
    assert [plot.name for plot in plots] == [f"{name}_plot.png" for name in STUDIES]
    for plot in plots:
        assert plot.read_bytes().startswith(PNG) and plot.stat().st_size > 10_000


def test_device_is_drawn(ran):
    (picture,) = ran["device"].iterdir()
    assert picture.name == "device.png"
    assert picture.read_bytes().startswith(PNG) and picture.stat().st_size > 10_000


@pytest.mark.parametrize("name", SCRIPTS)
def test_usage_of_a_script_names_what_it_writes(ran, name):
    usage = ast.get_docstring(ast.parse((FOLDER / f"{name}.py").read_text(encoding="utf-8")))
    folder = ran[name]

    assert f"python diagrams/{name}.py" in usage
    for path in folder.iterdir():
        assert path.name in usage or (path.suffix == ".html" and "training_NAME.html" in usage)


def test_without_a_folder_a_script_writes_beside_itself(tmp_path):
    here, elsewhere = tmp_path / "diagrams", tmp_path / "elsewhere"
    here.mkdir()
    elsewhere.mkdir()
    shutil.copy(FOLDER / "figure5.py", here)
    run_here(here / "figure5.py", cwd=elsewhere)

    assert {"figure5.dot", "figure5_plot.png"} <= {path.name for path in here.iterdir()}
    assert list(elsewhere.iterdir()) == []


@pytest.mark.parametrize("name", ["figure5", "device"])
def test_a_script_makes_its_folder(tmp_path, name):
    folder = tmp_path / "not" / "yet"
    if name == "device":
        assert run(FOLDER / "device.py", folder, cwd=tmp_path).returncode == 0
    else:
        run_here(FOLDER / f"{name}.py", folder, cwd=tmp_path)

    assert any(folder.iterdir())


def test_without_graphviz_a_script_writes_the_dot_and_the_plot(tmp_path, monkeypatch):
    empty = tmp_path / "bin"
    empty.mkdir()
    monkeypatch.setenv("PATH", str(empty))
    run_here(FOLDER / "figure5.py", tmp_path / "out", cwd=tmp_path)

    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"figure5.dot", "figure5_plot.png"}


def test_the_study_writes_the_same_diagrams(design, tmp_path):
    """`sdt-drake reproduce` and the scripts share one function."""
    for name in FIGURES:
        dot = write_block_diagram(name, design, tmp_path)[0]
        assert dot.read_bytes() == (FOLDER / dot.name).read_bytes()
