"""Files of `sdt-drake reproduce`: written, replaced, and read again by `sdt-drake report`."""

import json
import re
import shutil
from pathlib import Path

import pytest
from command_line import AXIS, snapshot

from sdt_drake.analysis.reproduction import Stopwatch
from sdt_drake.cli.app import main
from sdt_drake.io.errors import InputError
from sdt_drake.run.scenario import load_scenario
from sdt_drake.show.documents import REPORT
from sdt_drake.show.paper_diagrams import DIAGRAMS
from sdt_drake.show.reports.paper import RECORDING, write_report
from sdt_drake.show.reports.paper_files import FILES, write_reproduction
from sdt_drake.studies.distributions import Uniform
from sdt_drake.studies.execute import run_study
from sdt_drake.studies.job import make_job
from sdt_drake.studies.study import Study, Variable


@pytest.fixture
def folder(reproduced, tmp_path):
    """What the report needs of what reproduce wrote, to change."""
    ignored = shutil.ignore_patterns("*.csv", "*.md", "*.png")
    return Path(shutil.copytree(reproduced, tmp_path / "out", ignore=ignored))


# --- writing --------------------------------------------------------------------------------------


@pytest.fixture
def quick(undrawn, monkeypatch):
    """The recording, too, costs much of the time: write few bytes instead."""
    write = "sdt_drake.show.reports.paper_files.record_html"
    monkeypatch.setattr(write, lambda robot, time, q, path, **options: path.write_text("3D"))


def test_files_are_replaced_foreign_ones_left_with_python_alone(
    reproduction, reproduced, tmp_path, quick, monkeypatch
):
    monkeypatch.setenv("PATH", str(tmp_path))
    used = tmp_path / "used"
    (used / "diagrams").mkdir(parents=True)
    for name in ("notes.txt", "diagrams/mine.dot", "report.md"):
        (used / name).write_text("old")
    write_reproduction(reproduction, used, Stopwatch(lambda line: None))

    after, fresh = snapshot(used), snapshot(reproduced)
    assert after.pop("notes.txt") == after.pop("diagrams/mine.dot") == b"old"
    assert {"diagrams", *FILES} >= set(after) == set(fresh)
    for name in fresh:  # the same study gives the same bytes
        assert after[name] == fresh[name] or not name.endswith((".csv", ".dot")), name
    report = after["report.md"].decode()
    for name in DIAGRAMS:
        assert f"(diagrams/{name}.svg)" in report
    for link in re.findall(r"\]\(([^)]+)\)", report):
        assert (used / link).is_file(), link


# --- reading again -------------------------------------------------------------------------------


def test_reproduce_ends_with_the_page_and_report_makes_the_same(folder, capsys):
    made = (folder / REPORT).read_bytes()
    (folder / REPORT).unlink()
    assert main(["report", str(folder)]) == 0
    assert capsys.readouterr().out == f"{folder / REPORT} written\n"
    assert (folder / REPORT).read_bytes() == made


def test_studies_in_the_folder_become_chapters(folder, desk, undrawn):
    base = load_scenario(AXIS)
    ratios = Variable("zeta", ["controller.zeta"], "factor", Uniform(0.8, 1.0))
    study = Study("own", draws=4, variables=[ratios])
    run_study(make_job(study, base), folder / "own")
    (folder / RECORDING).unlink()

    assert main(["report", str(folder)]) == 0
    assert b"Load the 3D recording" not in (folder / REPORT).read_bytes()
    assert "## Study own" in (folder / "report.md").read_text(encoding="utf-8")
    page = (folder / REPORT).read_text(encoding="utf-8")
    chapter = re.search(r'<section id="(\S+)"><h2>Study own</h2>.*?</section>', page, re.S)
    assert f'<a href="#{chapter[1]}">Study own</a>\n</nav>' in page
    assert "4 runs" in chapter[0] and chapter[0].count("<figure><") >= 2


def test_no_text_of_the_summary_becomes_a_tag(folder):
    evil = '<script>alert(1)</script>" onload="x'
    path = folder / "summary.json"
    summary = json.loads(path.read_text(encoding="utf-8"))
    summary["claims"][0] |= dict.fromkeys(("why", "statement", "id", "published"), evil)
    summary["versions"]["drake"] = evil
    summary["wall_time_s"] = {evil: 1.0}
    summary["beyond"][6] |= {"controller": evil, "needs": [evil], "blocks": evil}
    summary["beyond"][0]["felt"]["channels"][0] = evil
    summary["tracking"][0] |= dict.fromkeys(("controller", "plant", "algorithm"), evil)
    path.write_text(json.dumps(summary), encoding="utf-8")
    page = write_report(folder).read_text(encoding="utf-8")
    assert "alert(1)</script>" not in page and '" onload' not in page
    assert page.count("alert(1)") >= 10


@pytest.mark.parametrize(
    ("name", "old", "new", "problem"),
    [
        ("summary.json", r"$", "x", "summary.json: is not JSON"),
        ("summary.json", r'"claims"', '"claim"', "has no 'claims'"),
        ("summary.json", r'"verdict": "[^"]*"', '"verdict": "so so"', "'so so'"),
        ("figure2.svg", r"</svg>", "", "figure2.svg: is not an SVG"),
        ("diagrams/figure3.svg", None, None, "figure3.svg: is missing"),
    ],
)
def test_what_is_missing_is_named_and_the_old_report_stays(folder, name, old, new, problem):
    text = (folder / name).read_text(encoding="utf-8")
    (folder / name).unlink()
    if old:
        (folder / name).write_text(re.sub(old, new, text), encoding="utf-8")
    before = snapshot(folder)
    with pytest.raises(
        InputError, match=f"{problem}.*`sdt-drake reproduce --out {folder}`"
    ) as error:
        write_report(folder)
    assert "\n" not in str(error.value) and snapshot(folder) == before
