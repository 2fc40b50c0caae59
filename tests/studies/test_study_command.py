"""`sdt-drake study` as a user meets it: what it refuses, and that nothing is ever lost."""

from __future__ import annotations

import csv
import functools
import json
import re
import shutil
import sqlite3
import subprocess
import sys

import numpy as np
import pytest
from small_studies import RUNS, rows

from sdt_drake.cli.app import main
from sdt_drake.run.simulate import Recording
from sdt_drake.show.reports import study as report
from sdt_drake.studies.results import read_study_table
from sdt_drake.studies.store import DATABASE, Store


@pytest.fixture
def refuse(refuse):
    """Run `study`, which must refuse its arguments; what it says."""
    return functools.partial(refuse, "study")


def change(folder, statement, *values):
    """Change the database of a study."""
    with sqlite3.connect(folder / DATABASE) as database:
        database.execute(statement, values)


# --- bad input -------------------------------------------------------------------------------

LABELS = "[controller]\n  distribution: !Choice {values: [pi, p_pi+id]}"
MOTIONS = "[motion]\n  distribution: !Choice {{values: [short.yaml, {}]}}"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("scenario: axis.yaml\n", "", "few.yaml: scenario: missing"),
        ("scenario: axis.yaml", "scenario: toofast.yaml", "fast.yaml: motion refused: joint 2"),
        (LABELS, MOTIONS.format("two.csv"), "two.csv: 2 joint(s), expected 4 as in the base"),
        (LABELS, MOTIONS.format("odd.yaml"), "0.501 s is not a whole multiple of the period"),
    ],
)
def test_bad_study(refuse, desk, old, new, message):
    base = (desk / "axis.yaml").read_text()
    (desk / "toofast.yaml").write_text(base.replace("short.yaml", "fast.yaml"))
    (desk / "odd.yaml").write_text((desk / "short.yaml").read_text().replace("0.5", "0.501"))
    (desk / "two.csv").write_text("time,v_ref_1,v_ref_2\n0,0,0\n0.5,0,0\n")
    text = (desk / "few.yaml").read_text()
    assert old in text
    (desk / "few.yaml").write_text(text.replace(old, new))
    assert message in refuse("few.yaml")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("nowhere.yaml", "nowhere.yaml: no such file"),
        ("axis.yaml", "axis.yaml: is a scenario, expected a study"),
        ("few.yaml --workers 0", "--workers: 0, expected a whole number >= 1"),
        ("few.yaml --workers 2 --cluster tcp://a:1", "--workers: has no effect with --cluster"),
        ("few.yaml --cluster nonsense", "--cluster nonsense: cannot be reached"),
        ("few.yaml --out few.yaml/below", "few.yaml: is a file, expected a folder"),
        ("few.yaml --out .", ".: contains other files, expected an empty folder"),
        ("few.yaml --resume", "few: no study to resume"),
        ("few.yaml --row 1", "--row: has no effect here"),
        ("show nowhere", "nowhere: contains no study"),
        ("repeat nowhere --row 1", "nowhere: contains no study"),
        ("few.yaml more.yaml", "study: 'few.yaml more.yaml', expected"),
    ],
)
def test_bad_arguments(refuse, arguments, message):
    assert message in refuse(*arguments.split())


def test_folder_of_a_study(refuse, desk, undisturbed):
    """Neither overwritten, nor taken for another study."""
    shutil.copytree(undisturbed, desk / "mc")
    assert "mc: contains this study; continue it with --resume" in refuse(
        "many.yaml", "--out", "mc"
    )
    other = "mc: contains another study, which differs in study.yaml (name, draws), scenario.yaml ("
    assert other in refuse("few.yaml", "--out", "mc")
    assert other in refuse("few.yaml", "--out", "mc", "--resume")
    motion = (desk / "short.yaml").read_text()
    (desk / "short.yaml").write_text(motion.replace("0.5], [0.5", "0.4], [0.5"))
    said = refuse("many.yaml", "--out", "mc", "--resume")
    assert "mc: contains another study, which differs in files/1/short.yaml; use" in said
    (desk / "short.yaml").write_text(motion)
    with Store(desk / "mc") as store:
        drake = store.about["versions"]["drake"]
    change(desk / "mc", "UPDATE study SET about = replace(about, ?, '1.0')", drake)
    assert f"begun with drake 1.0 (here: {drake})" in refuse("many.yaml", "--out=mc", "--resume")


@pytest.mark.parametrize(
    ("file", "text", "message"),
    [
        ("study.sqlite", "\0\xff", "study.sqlite: cannot be used"),
        ("study.yaml", "", "study.yaml: empty"),
        ("scenario.yaml", "5", "scenario.yaml changed since the study was begun"),
    ],
)
def test_nonsense_in_a_folder(refuse, desk, undisturbed, file, text, message):
    shutil.copytree(undisturbed, desk / "mc")
    (desk / "mc" / file).write_text(text, encoding="latin-1")
    assert message in refuse("show", "mc")
    assert message in refuse("repeat", "mc", "--row", "1")


def test_inputs_that_were_changed_do_not_go_with_old_outcomes(refuse, desk, undisturbed, undrawn):
    """But for how long a run may take; to resume the study puts them back."""
    folder = shutil.copytree(undisturbed, desk / "mc")
    texts = {name: (folder / name).read_text() for name in ("study.yaml", "scenario.yaml")}
    (folder / "study.yaml").write_text(texts["study.yaml"].replace("t: 300.0", "t: 30.0"))
    assert main(["report", "mc"]) == 0
    (folder / "scenario.yaml").write_text(texts["scenario.yaml"].replace("0.98", "0.97"))
    line = "mc: scenario.yaml (controller.zeta[2]) changed since the study was begun; restore"
    assert line in refuse("show", "mc") and line in refuse("repeat", "mc", "--row", "1")
    assert main(["report", "mc"]) == 2
    assert main(["study", "many.yaml", "--out", "mc", "--resume"]) == 0
    assert texts == {name: (folder / name).read_text() for name in texts}


def test_an_unfinished_study_of_an_older_version_is_refused(refuse, desk):
    (desk / "few").mkdir()
    (desk / "few" / "rows.jsonl").write_text("{}")
    line = "few: contains an unfinished study of version 0.3 or older (rows.jsonl)"
    for command in (["show", "few"], ["few.yaml"], ["few.yaml", "--resume"]):
        assert line in refuse(*command)
    assert main(["report", "few"]) == 2
    assert [path.name for path in (desk / "few").iterdir()] == ["rows.jsonl"]


def test_a_finished_study_of_an_older_version_is_shown_and_repeated(copied, undisturbed, capfd):
    """Its rows and inputs come from results.parquet."""
    with Store(copied) as store:
        names = ("fingerprint", "outcomes", "files", "versions")
        state = {name: store.about[name] for name in names}
    state["versions"]["package"] = "0.1.0"
    (copied / "state.json").write_text(json.dumps(state))
    (copied / DATABASE).rename(copied / "rows.jsonl")
    found, whole = map(read_study_table, (copied, undisturbed))
    np.testing.assert_equal(vars(found), vars(whole))
    assert main(["study", "repeat", f"{copied}", "--row", "5"]) == 0
    assert "The study was run with package 0.1.0" in capfd.readouterr().out


def test_bad_repeat(refuse, undisturbed):
    assert "--row 16, expected 0 to 15" in refuse("repeat", undisturbed, "--row", "16")
    said = refuse("repeat", undisturbed, "--row", "1", "--out", "x.png")
    assert "x.png: unknown kind of file, expected .csv" in said


# --- the same, bit for bit -------------------------------------------------------------------


def test_resumed_by_more_processes(desk, undisturbed, capfd):
    """What is there may be any of the rows. The caller has closed all streams: their numbers must
    not go to pipes and files of the processes."""
    where = shutil.copytree(undisturbed, desk / "some" / "where")
    (where / "results.parquet").unlink()
    change(where, "DELETE FROM rows WHERE row IN (1, 2) OR row > 12")
    command = ["study", "many.yaml", "--resume", "--workers", "2", "--out", "some/where"]
    closed = ["sh", "-c", '"$@" <&- >&- 2>&-', "sh", sys.executable, "-m", "sdt_drake", *command]
    done = subprocess.run(closed, capture_output=True)
    assert (done.returncode, done.stderr) == (0, b"")
    assert rows(where).equals(rows(undisturbed))
    assert main(command) == 0  # nothing is left to do
    out, err = capfd.readouterr()
    assert err == "" and out.startswith(f"{RUNS} of {RUNS} runs\n")
    assert "some/where/results.parquet written" in out


def test_repeat_from_a_folder_that_was_moved_and_files_that_are_gone(desk, undisturbed, capfd):
    shutil.copytree(undisturbed, desk / "elsewhere")
    for file in desk.glob("*.yaml"):
        file.unlink()
    assert main(["study", "repeat", "elsewhere", "--row", "5", "--out", "row.csv"]) == 0
    lines = (re.split(r"\s{2,}", line) for line in capfd.readouterr().out.splitlines())
    printed = {name: cells for name, *cells in lines}
    expected = rows(undisturbed).slice(5, 1).to_pylist()[0]
    assert printed["controller"] == [expected["controller"]]
    assert printed["disturbance.amplitude"] == [f"{expected['disturbance.amplitude']:.4g}"]
    degrees = np.degrees(expected["max_abs_position_error_2"])
    assert printed["largest position error [deg]"][1] == f"{degrees:.3f}"
    torque, felt = 100 * expected["peak_torque_share_2"], 100 * expected["felt_share"]
    assert printed["peak torque [% of the motor]"][1] == f"{torque:.1f}"
    assert printed["error that can be felt [% of time]"] == [f"{felt:.1f}"]
    error = np.abs(Recording.from_csv(desk / "row.csv").speed_error).max(axis=0)
    assert error[1] == expected["max_abs_speed_error_2"] > 0


def test_repeat_says_what_failed(undisturbed, capfd, monkeypatch):
    monkeypatch.setattr("sdt_drake.studies.runs.stops_passed", lambda *_: ["roll, 2 deg", "yaw"])
    assert main(["study", "repeat", str(undisturbed), "--row", "5"]) == 0
    assert capfd.readouterr().out.startswith(
        "many, row 5: the run failed: roll, 2 deg; yaw\ninput "
    )


def test_shows_what_is_done(copied, capfd, undrawn):
    change(copied, "DELETE FROM rows WHERE row > 4")
    assert len(read_study_table(copied)) == 5
    assert main(["study", "show", f"{copied}"]) == 0
    assert capfd.readouterr().out.startswith(
        f"many: 5 of {RUNS} runs have a result; {RUNS - 5} of {RUNS} runs are not finished\n"
    )
    assert f"{RUNS - 5} of {RUNS} runs are not finished." in (copied / "report.html").read_text()


def test_a_csv_where_there_is_no_pyarrow(desk, undisturbed, monkeypatch, capfd):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert main(["study", "few.yaml", "--out", "few"]) == 0
    assert "few/results.csv written" in capfd.readouterr().out
    names, *lines = csv.reader((desk / "few" / "results.csv").open())
    table = read_study_table(desk / "few")
    columns = dict(zip(names, zip(*lines, strict=True), strict=True))
    assert [*map(int, columns["row"])] == [*range(6)] and columns["controller"][1] == "p_pi+id"
    assert [*map(float, columns["felt_share"])] == table.outcomes["felt_share"].tolist()
    assert set(columns["constant_speed_error_1"]) == {""}  # nothing is that long


@pytest.mark.parametrize(
    ("kept", "code", "said"),
    [
        (10, 0, "6 of 16 runs failed: no link 'payload' (row 10)"),
        (0, 1, "16 of 16 runs failed: no link 'payload' (row 0)"),
    ],
)
def test_failed_runs_are_said_first(copied, files, capfd, monkeypatch, kept, code, said):
    """A study of failed runs alone ends with 1."""
    failed = "status = 'failed', reason = ?"
    change(copied, f"UPDATE rows SET {failed} WHERE row >= ?", "no link 'payload'", kept)

    assert main(["study", str(files / "many.yaml"), "--out", str(copied), "--resume"]) == code
    assert capfd.readouterr().out.splitlines()[1].endswith(f"; {said}")
    monkeypatch.setattr(report, "write_study_report", lambda _, out: (out / "it", []))
    assert main(["study", "show", str(copied), "--out", "page"]) == 0
    out = capfd.readouterr().out
    assert out.splitlines()[0].endswith(f"; {said}") and "\npage/it written\n" in out
