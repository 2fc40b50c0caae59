"""`sdt-drake report`, and the page at the end of `sdt-drake reproduce`."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from browser import open_page

from sdt_drake.analysis.report import RECORDING, REPORT
from sdt_drake.cli import main
from sdt_drake.scenario import load_scenario
from sdt_drake.studies.distributions import Uniform
from sdt_drake.studies.execute import run_study
from sdt_drake.studies.job import make_job
from sdt_drake.studies.study import Study, Variable


@pytest.fixture
def folder(reproduced, tmp_path):
    """What the report needs of what reproduce wrote, to change."""
    ignored = shutil.ignore_patterns("*.csv", "*.md")
    return Path(shutil.copytree(reproduced, tmp_path / "out", ignore=ignored))


def test_reproduce_ends_with_the_page_and_report_makes_the_same(folder, capsys):
    made = (folder / REPORT).read_bytes()
    (folder / REPORT).unlink()
    (folder / "mine.svg").write_text("<svg", encoding="utf-8")

    assert main(["report", str(folder)]) == 0
    assert capsys.readouterr().out.splitlines() == [
        f"{folder / 'mine.svg'}: is not an SVG picture, left out",
        f"{folder / REPORT} written",
    ]
    assert (folder / REPORT).read_bytes() == made


def test_studies_in_the_folder_become_chapters(folder):
    base = load_scenario("package://sdt/scenarios/axis_pi.yaml")
    inertia = Variable("inertia", ["plant.i_eff"], "factor", Uniform(0.8, 1.1))
    study = Study("own", draws=4, variables=[inertia])
    run_study(make_job(study, base), folder / "own")
    (folder / RECORDING).unlink()

    assert main(["report", str(folder)]) == 0
    assert b"Load the 3D recording" not in (folder / REPORT).read_bytes()
    assert "## Study own" in (folder / "report.md").read_text(encoding="utf-8")
    with open_page(folder / REPORT) as (tab, errors, requests):
        tab.get_by_role("link", name="Study own").click()
        chapter = tab.locator("section", has=tab.get_by_role("heading", name="Study own"))
        assert "4 runs" in chapter.inner_text() and chapter.locator("figure img").count() >= 2
        assert (errors, requests) == ([], [])


def test_the_page_shows_the_device(reproduced):
    with open_page(reproduced / REPORT) as (tab, errors, requests):
        tab.locator(".recording button").click()
        tab.frame_locator("iframe").locator("canvas").first.wait_for(timeout=60_000)
        assert tab.locator(".recording button").count() == 0
        assert errors == [] and requests == []


@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("file", "file: is a file, expected a folder"),
        ("file/below", "file: is a file, expected a folder"),
        ("nowhere", "nowhere: no such folder; run `sdt-drake reproduce --out"),
        ("empty", "summary.json: is missing; run `sdt-drake reproduce --out"),
    ],
)
def test_a_folder_that_reproduce_did_not_write(tmp_path, capsys, what, said):
    (tmp_path / "file").write_text("x", encoding="utf-8")
    (tmp_path / "empty").mkdir()

    assert main(["report", str(tmp_path / what)]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and said in err
    assert list((tmp_path / "empty").iterdir()) == []
