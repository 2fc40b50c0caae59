"""The commands `reproduce report`, `view` and `pilot`: what they write, replace and print."""

import json
import re
import shutil
import socket
from pathlib import Path

import numpy as np
import pytest
import yaml
from helpers.command_line import ENDS, REST, SHORT_MOTION

from sdt_drake.analysis.tracking import track_head
from sdt_drake.io.errors import InputError
from sdt_drake.io.tables import read_table, write_table
from sdt_drake.paper.report import write_report
from sdt_drake.pilot import illusions, reported
from sdt_drake.pilot.canals import sensed_rate
from sdt_drake.pilot.illusions import feel
from sdt_drake.pilot.orientation import CAUTION
from sdt_drake.run.recording import Recording
from sdt_drake.show.documents import REPORT

COMMANDS = Path(__file__).with_name("commands.yaml")
TINY = yaml.safe_load(COMMANDS.read_text(encoding="utf-8"))["files"]["tiny.yaml"]


@pytest.fixture
def folder(reproduced, tmp_path):
    """What the report needs of what reproduce wrote, to change."""
    ignored = shutil.ignore_patterns("*.csv", "*.md", "*.png")
    return Path(shutil.copytree(reproduced, tmp_path / "out", ignore=ignored))


# --- `sdt-drake reproduce report`: files of `reproduce` are read again ---------------------


def test_summary_text_is_escaped_in_the_report(folder):
    evil = '<script>alert(1)</script>" onload="x'
    path = folder / "summary.json"
    summary = json.loads(path.read_text(encoding="utf-8"))
    summary["claims"][0] |= dict.fromkeys(("why", "statement", "id", "published"), evil)
    summary["versions"]["drake"] = evil
    summary["wall_time_s"] = {evil: 1.0}
    summary["beyond"][6] |= {"controller": evil, "needs": [evil]}
    summary["beyond"][0]["felt"]["channels"][0] = evil
    summary["tracking"][0] |= dict.fromkeys(("controller", "plant", "algorithm"), evil)
    path.write_text(json.dumps(summary), encoding="utf-8")
    page = write_report(folder).read_text(encoding="utf-8")
    assert "alert(1)</script>" not in page and '" onload' not in page
    assert page.count("alert(1)") >= 10


def test_unsettled_response_has_a_dash(folder):
    path = folder / "summary.json"
    summary = json.loads(path.read_text(encoding="utf-8"))
    summary["step_response"]["pi"]["settling_time"] = None
    path.write_text(json.dumps(summary), encoding="utf-8")
    page = write_report(folder).read_text(encoding="utf-8")
    assert re.search(r"PI on the error</th>\s*<td[^>]*>0\.\d+</td>\s*<td[^>]*>–</td>", page)


@pytest.mark.parametrize(
    ("name", "old", "new", "problem"),
    [
        ("summary.json", "$", "x", "summary.json: is not JSON"),
        ("summary.json", '"claims"', '"claim"', "has no 'claims'"),
        ("controllers.svg", "</svg>", "", "controllers.svg: is not an SVG"),
        ("plots.json", "{", "x", "plots.json: is not JSON"),
    ],
)
def test_broken_input_is_named_and_the_old_report_stays(folder, name, old, new, problem):
    text, before = (folder / name).read_text(encoding="utf-8"), (folder / REPORT).read_bytes()
    (folder / name).write_text(re.sub(old, new, text), encoding="utf-8")
    with pytest.raises(InputError, match=f"{problem}.*recompute the paper into {folder} first"):
        write_report(folder)
    assert (folder / REPORT).read_bytes() == before


def test_studies_in_the_folder_become_report_chapters(folder, given, good, undrawn):
    good("study", "run", given("tiny.yaml", TINY), "--out", folder / "own")
    assert good("reproduce", "report", folder).out == f"{folder / REPORT} written\n"
    page = (folder / REPORT).read_text(encoding="utf-8")
    chapter = re.search("<h2>Study tiny</h2>.*?</section>", page, re.DOTALL)
    assert "2 runs" in chapter[0] and chapter[0].count("<figure><") >= 2


# --- `sdt-drake view` as a user meets it -----------------------------------------------------

TIME = np.arange(101) * 0.005  # 0.5 s
ANGLES = np.outer(TIME, [0.2, 0.4, -0.1, 0.3])


@pytest.fixture
def shown(monkeypatch):
    """What `view` would show, instead of showing it."""
    calls = []

    def note(robot, time, q, *path, **options):
        calls.append({"robot": robot, "time": time, "q": q, "path": path, **options})

    for name in ("play", "record_html"):
        monkeypatch.setattr(f"sdt_drake.show.view3d.viewer.{name}", note)
    return calls


@pytest.mark.parametrize("other", [{"q_ref": 0 * ANGLES, "q": ANGLES}, {"q_ref": ANGLES}])
def test_pilot_takes_angles_of_a_table(desk, good, shown, other):
    write_table(desk / "recorded.csv", TIME, other)
    good("view", "recorded.csv", "--out", "a.html", "--pilot")
    (call_,) = shown
    np.testing.assert_array_equal(call_["q"], ANGLES)
    assert (call_["title"], call_["path"]) == ("recorded", (Path("a.html"),)) and call_["pilot"]


def test_port_in_use_is_one_line(refuse):
    with socket.socket() as busy:
        busy.bind(("127.0.0.1", 0))
        busy.listen()
        port = busy.getsockname()[1]
        refuse("view", SHORT_MOTION, "--once", f"--port={port}", saying=[f"port: {port} is in use"])


# --- `sdt-drake pilot` as a user meets it ----------------------------------------------------


@pytest.fixture
def recording(good, desk):
    """A recording of the coupled plant, `run.csv` in the working directory."""
    good("simulate", "../given/coupled.yaml", "--out", "run.csv")
    return Recording.load(desk / "run.csv")


def test_pilot_csv_holds_felt_motion_over_time(good, desk, recording, robot):
    done = good("pilot", "run.csv", "--out", "new/felt.csv")
    assert done.out.splitlines()[-1] == "new/felt.csv written"
    time, columns = read_table(desk / "new" / "felt.csv")

    np.testing.assert_array_equal(time, recording.time)
    head = track_head(recording, robot)
    for suffix, motion in (("_ref", head.reference), ("", head.achieved)):
        names = ("specific_force", "angular_velocity", "angular_acceleration")
        signals = {name: getattr(motion, name) for name in names}
        signals["canals"] = sensed_rate(motion.angular_velocity, 0.005)
        felt = feel(motion, 0.005, "clark2019").columns
        for name, values in (signals | {f"felt_{x}": y for x, y in felt.items()}).items():
            np.testing.assert_array_equal(columns[name + suffix], values)
    np.testing.assert_array_equal(columns["multiple"], head.felt.multiples)


def test_pilot_tells_that_no_illusion_is_predicted(good, given):
    """Of a gondola that stands upright."""
    given("still.yaml", f"name: still\nduration: 0.5\njoints:\n{4 * REST}")
    scenario = given("still_run.yaml", ENDS["coupled"].replace("motion.yaml", "still.yaml"))
    assert "by clark2019:\n  none\n" in good("pilot", scenario).out


def test_pilot_of_a_motion_begins_with_its_illusion_and_knows_no_controller(good, desk, robot):
    done = good("pilot", "post_roll", "--model", "slow_yaw", "--out", "felt.csv")
    meant = illusions.intended_illusion("post_roll", robot, ["slow_yaw"])
    assert done.out.startswith(f"Intended illusion: {meant.sentence('slow_yaw')}\n")
    assert "planned" in done.out and "controller" not in done.out
    time, columns = read_table(desk / "felt.csv")
    head = illusions.planned_head("post_roll", robot)
    felt = feel(head, illusions.PERIOD, "slow_yaw")
    np.testing.assert_array_equal(columns["felt_rate"], felt.rate)
    assert len(time) == len(felt.time) and "multiple" not in columns


def test_validate_begins_with_the_verdict(good, monkeypatch, robot, reproduction):
    """Of one training motion: all of them take long."""
    own = reproduction.reported.result()
    one = illusions.intended_illusion("post_roll", robot, ["slow_yaw"])
    monkeypatch.setattr(reported, "validate", lambda: own)
    monkeypatch.setattr(illusions, "intended_illusions", lambda robot: [one])
    out = " ".join(good("pilot", "validate").out.split())
    assert out.startswith(" ".join(reported.verdict_of_all(own).split()))
    assert "yaw_start" in out and out.endswith(" ".join(CAUTION.split()))
