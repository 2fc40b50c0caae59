"""`sdt-drake study` as a user meets it: what it refuses, what it shows, and nothing is lost."""

import csv
import json
import re
import shutil
import sqlite3
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.small_studies import rows

from sdt_drake.cli.app import main
from sdt_drake.cli.study import Progress
from sdt_drake.run.recording import Recording
from sdt_drake.studies.results import read_study_table, write_results
from sdt_drake.studies.sizing import first_look, load_sizing
from sdt_drake.studies.store import DATABASE, Store
from sdt_drake.studies.study import load_study, shortened


def change(folder, statement, *values):
    """Change the database of a study."""
    with sqlite3.connect(folder / DATABASE) as database:
        database.execute(statement, values)


# --- bad input -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("run none.yaml", "none.yaml: scenario: missing"),
        ("run two.yaml", "two.csv: 2 joint(s), expected 4 as in the base"),
        ("run axis.yaml", "axis.yaml: is a scenario, expected a study"),
        ("run few.yaml --workers 0", "--workers: 0, expected a whole number >= 1"),
        ("run few.yaml --cluster nonsense", "--cluster: nonsense: cannot be reached"),
        ("run few.yaml --out .", ".: contains other files, expected an empty folder"),
        ("run few.yaml --resume", "few: no study to resume"),
        ("show nowhere", "nowhere: contains no study"),
        ("repeat mc --row 16", "--row: 16, expected 0 to 15"),
        ("run many.yaml --out mc", "mc: contains this study; continue it with --resume"),
        (
            "run few.yaml --out mc",
            "mc: contains another study, which differs in study.yaml (name, ",
        ),
    ],
)
def test_bad_arguments_of_study_are_one_line(refuse, desk, undisturbed, arguments, message):
    few = (desk / "few.yaml").read_text()
    choice = "[motion]\n  distribution: !Choice {values: [short.yaml, two.csv]}"
    for name, text in {
        "none.yaml": few.replace("scenario: axis.yaml\n", ""),
        "two.yaml": re.sub(r"\[controller\]\n.*", choice, few),
        "two.csv": "time,v_ref_1,v_ref_2\n0,0,0\n0.5,0,0\n",
    }.items():
        (desk / name).write_text(text)
    shutil.copytree(undisturbed, desk / "mc")
    assert message in refuse("study", *arguments.split())


def test_resume_with_other_files_or_versions_is_refused(refuse, desk, copied):
    motion = (desk / "short.yaml").read_text()
    (desk / "short.yaml").write_text(motion.replace("0.5], [0.5", "0.4], [0.5"))
    said = refuse("study", "run", "many.yaml", "--out", copied, "--resume")
    assert "contains another study, which differs in files/1/short.yaml; use" in said
    (desk / "short.yaml").write_text(motion)
    with Store(copied) as store:
        drake = store.about.versions["drake"]
    change(copied, "UPDATE study SET about = replace(about, ?, '1.0')", drake)
    said = refuse("study", "run", "many.yaml", "--out", copied, "--resume")
    assert f"begun with drake 1.0 (here: {drake})" in said


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("study.sqlite", "SQLite", "\0\xff", "study.sqlite: cannot be used"),
        ("study.yaml", "high: 0.3", "high: 0.4", "study.yaml (variables[1].distribution.high)"),
        ("scenario.yaml", "0.98", "0.97", "scenario.yaml (controller.zeta[2]) changed since the"),
    ],
)
def test_study_files_changed_after_its_runs_are_refused(refuse, copied, file, old, new, message):
    content = (copied / file).read_bytes()
    (copied / file).write_bytes(content.replace(old.encode(), new.encode("latin-1")))
    assert message in refuse("study", "show", copied)
    assert message in refuse("study", "repeat", copied, "--row", "1")


def test_resume_with_longer_timeout_is_accepted(copied, desk, capfd, undrawn):
    """And to resume a study puts back its files."""
    text = (copied / "study.yaml").read_text()
    (copied / "study.yaml").write_text(text.replace("timeout: 300.0", "timeout: 30.0"))
    assert main(["study", "show", f"{copied}"]) == 0
    (desk / "many.yaml").write_text((desk / "many.yaml").read_text() + "timeout: 60\n")
    assert main(["study", "run", "many.yaml", "--out", f"{copied}", "--resume"]) == 0
    assert (copied / "study.yaml").read_text() == text.replace("timeout: 300.0", "timeout: 60.0")


@pytest.mark.parametrize("version", ["0.3", "0.4"])
def test_finished_study_is_shown_and_repeated_without_database(
    version, copied, undisturbed, capfd, undrawn
):
    """Version 0.3 wrote versions and files beside the export of the rows, and no contents."""
    (copied / DATABASE).unlink()
    if version == "0.3":
        old = {"versions": {"package": "0.3.0"}, "files": {"short.yaml": "files/1/short.yaml"}}
        (copied / "state.json").write_text(json.dumps(old | {"contents": {}}))
    found, whole = (read_study_table(folder).to_pandas() for folder in (copied, undisturbed))
    assert found.equals(whole)
    line = {"0.3": ["repeat", f"{copied}", "--row", "5"], "0.4": ["show", f"{copied}"]}[version]
    assert main(["study", *line]) == 0
    assert ("run with package 0.3.0" in capfd.readouterr().out) == (version == "0.3")


# --- how long it takes -------------------------------------------------------------------------


def test_fewer_draws_are_the_first_of_the_study_and_a_quick_look_has_two():
    study = replace(load_study("monte_carlo")[0], sampling="random")
    for short, draws in ((shortened(study, 3), 3), (shortened(study, quick=True), 2)):
        assert len(short) == draws * study.per_draw and short.folder == study.folder
        assert all(short.inputs(row) == study.inputs(row) for row in range(len(short)))
    quick = first_look(load_sizing("sizing")[0])
    assert (len(quick.motions), len(quick.controllers), quick.accuracy) == (1, 1, 0.01)


def test_study_tells_its_runs_and_their_time_before_and_while_it_runs(monkeypatch, capfd):
    """One run takes 3 s, 40 of them on two processes a minute; 20 are done after 10 s."""
    clock = SimpleNamespace(
        perf_counter=iter([0.0, 3.0]).__next__, monotonic=iter([0.0, 10.0]).__next__
    )
    monkeypatch.setattr("sdt_drake.cli.study.time", clock)
    runner = SimpleNamespace(run=lambda row: None)
    monkeypatch.setattr("sdt_drake.studies.runs.Runner", lambda *_: runner)
    progress = Progress(SimpleNamespace(study=SimpleNamespace(name="many"), base=None), 2)
    progress(0, 0, 40)
    progress(20, 0, 40)
    assert capfd.readouterr().out.splitlines() == [
        "many: 40 runs, about 60 s with 2 at once", "0 of 40 runs",
        "20 of 40 runs, 2 per second, 10 s left",
    ]  # fmt: skip


# --- results ---------------------------------------------------------------------------------


def test_rows_in_csv_without_pyarrow_are_the_same(copied, monkeypatch):
    with Store(copied) as store, monkeypatch.context() as without:
        without.setitem(sys.modules, "pyarrow", None)
        path, runs = write_results(store, copied), store.runs()
    assert path.name == "results.csv"
    with path.open() as file:
        read = [row | {"row": int(row["row"])} for row in csv.DictReader(file)]
    texts = {"row", "controller", "status", "reason"}
    numbers = [{x: y if x in texts else float(y or "nan") for x, y in row.items()} for row in read]
    np.testing.assert_equal(numbers, runs.reset_index().to_dict("records"))


def test_repeat_works_in_a_moved_folder(copied, desk, capfd, monkeypatch):
    (desk / "short.yaml").unlink()
    command = ["study", "repeat", f"{copied}", "--row", "5", "--out", "row.csv"]
    assert main(command) == 0
    lines = (re.split(r"\s{2,}", line) for line in capfd.readouterr().out.splitlines())
    printed = {name: cells for name, *cells in lines}
    expected = rows(copied).slice(5, 1).to_pylist()[0]
    assert printed["controller"] == [expected["controller"]]
    degrees = np.degrees(expected["max_abs_position_error_2"])
    assert printed["largest position error [deg]"][1] == f"{degrees:.3f}"
    error = np.abs(Recording.load(desk / "row.csv").speed_error).max(axis=0)
    assert error[1] == expected["max_abs_speed_error_2"] > 0

    monkeypatch.setattr("sdt_drake.studies.runs.stops_passed", lambda *_: ["roll, 2 deg", "yaw"])
    assert main(command) == 0
    assert "many, row 5: the run failed: roll, 2 deg; yaw\ninput " in capfd.readouterr().out
