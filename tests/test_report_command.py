"""`sdt-drake report`, and the page at the end of `sdt-drake reproduce`."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from browser import open_page

from sdt_drake.analysis.page import PAGE, RECORDING
from sdt_drake.cli import main
from sdt_drake.scenario import load_scenario
from sdt_drake.studies.execute import run_study
from sdt_drake.studies.job import make_job
from sdt_drake.studies.study import Study, Uniform, Variable


@pytest.fixture(scope="module")
def reproduced(tmp_path_factory):
    """What reproduce writes; do not change it."""
    folder = tmp_path_factory.mktemp("reproduced") / "out"
    assert main(["reproduce", "--out", str(folder)]) == 0
    return folder


@pytest.fixture
def folder(reproduced, tmp_path):
    """Of it what the page needs, to change."""
    ignored = shutil.ignore_patterns("*.csv", "*.png", "*.md")
    return Path(shutil.copytree(reproduced, tmp_path / "out", ignore=ignored))


def test_reproduce_ends_with_the_page_and_report_makes_the_same(folder, capsys):
    made = (folder / PAGE).read_bytes()
    (folder / PAGE).unlink()

    assert main(["report", str(folder)]) == 0
    assert capsys.readouterr().out == f"{folder / PAGE} written\n"
    assert (folder / PAGE).read_bytes() == made


def test_report_tells_what_it_leaves_out(folder, capsys):
    (folder / "mine.svg").write_text("<svg", encoding="utf-8")

    assert main(["report", str(folder)]) == 0
    assert capsys.readouterr().out.splitlines() == [
        f"{folder / 'mine.svg'}: is not an SVG picture, left out",
        f"{folder / PAGE} written",
    ]


def test_report_of_a_folder_without_a_recording(folder):
    (folder / RECORDING).unlink()

    assert main(["report", str(folder)]) == 0
    assert b"Load the 3D recording" not in (folder / PAGE).read_bytes()


def test_studies_in_the_folder_become_chapters(folder):
    base = load_scenario("package://sdt/scenarios/axis_pi.yaml")
    inertia = Variable("inertia", ["plant.i_eff"], "factor", Uniform(0.8, 1.1))
    study = Study("own", draws=12, variables=[inertia])
    run_study(make_job(study, base), folder / "own")

    assert main(["report", str(folder)]) == 0
    with open_page(folder / PAGE) as (tab, errors, requests):
        tab.get_by_role("link", name="Study own").click()
        chapter = tab.locator("section", has=tab.get_by_role("heading", name="Study own"))
        assert "12 runs" in chapter.inner_text() and chapter.locator("figure svg").count() >= 2
        assert (errors, requests) == ([], [])


def test_the_page_shows_the_device(reproduced):
    with open_page(reproduced / PAGE) as (tab, errors, requests):
        tab.locator(".recording button").click()
        tab.frame_locator("iframe").locator("canvas").first.wait_for(timeout=60_000)
        assert tab.locator(".recording button").count() == 0
        assert errors == [] and requests == []


@pytest.mark.parametrize("what", ["file", "file/below"])
def test_a_file_is_no_folder(tmp_path, capsys, what):
    (tmp_path / "file").write_text("x", encoding="utf-8")

    assert main(["report", str(tmp_path / what)]) == 2
    expected = f"sdt-drake: {tmp_path / 'file'}: is a file, expected a folder\n"
    assert capsys.readouterr() == ("", expected)


@pytest.mark.parametrize("what", ["nowhere", "empty"])
def test_a_folder_that_reproduce_did_not_write(tmp_path, capsys, what):
    given = tmp_path / what
    if what == "empty":
        given.mkdir()
    assert main(["report", str(given)]) == 2
    done = capsys.readouterr()
    assert done.out == "" and done.err.count("\n") == 1
    assert str(given) in done.err and "sdt-drake reproduce --out" in done.err
    assert not (given / PAGE).exists()


def test_a_spoilt_folder_keeps_its_old_page(folder, capsys):
    old = (folder / PAGE).read_bytes()
    (folder / "figure7.svg").unlink()

    assert main(["report", str(folder)]) == 2
    assert "figure7.svg: is missing" in capsys.readouterr().err
    assert (folder / PAGE).read_bytes() == old
