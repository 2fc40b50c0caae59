"""`sdt-drake view` as a user meets it."""

from __future__ import annotations

import re
import socket
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from command_line import MOTION, SCENARIO, refused
from owners import RATE_TABLE

from sdt_drake.io.tables import write_table

TIME = np.arange(101) * 0.005  # 0.5 s
ANGLES = np.outer(TIME, [0.2, 0.4, -0.1, 0.3])


@pytest.fixture
def desk(tmp_path, monkeypatch):
    """A working directory with a scenario, its motion and tables of angles."""
    (tmp_path / "motion.yaml").write_text(MOTION, encoding="utf-8")
    (tmp_path / "run.yaml").write_text(SCENARIO, encoding="utf-8")
    write_table(tmp_path / "recording.csv", TIME, {"q_ref": 0 * ANGLES, "q": ANGLES})
    write_table(tmp_path / "motion.csv", TIME, {"q_ref": ANGLES})
    write_table(tmp_path / "speeds.csv", TIME, {"v": ANGLES})
    write_table(tmp_path / "three.csv", TIME, {"q": ANGLES[:, :3]})
    write_table(tmp_path / "long.csv", np.array([0, 1800.5, 3601]), {"q": ANGLES[:3]})
    rest = MOTION.replace("duration: 1.25", "duration: 3601").replace("[1.25,", "[3601,")
    (tmp_path / "rest.yaml").write_text(rest, encoding="utf-8")
    long = SCENARIO.replace("motion.yaml", "rest.yaml") + "period: 0.5\n"
    (tmp_path / "long.yaml").write_text(long, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def shown(monkeypatch):
    """What `view` would show, instead of showing it."""
    import sdt_drake.show.view3d.viewer

    calls = []

    def note(robot, time, q, *path, **options):
        calls.append({"robot": robot, "time": time, "q": q, "path": path, **options})

    monkeypatch.setattr(sdt_drake.show.view3d.viewer, "play", note)
    monkeypatch.setattr(sdt_drake.show.view3d.viewer, "record_html", note)
    return calls


@pytest.mark.parametrize("name", ["recording", "motion"])
def test_angles_of_a_table(desk, good, shown, name):
    good("view", f"{name}.csv", "--record", "a.html", "--pilot")
    (call_,) = shown
    np.testing.assert_array_equal(call_["q"], ANGLES)
    np.testing.assert_array_equal(call_["time"], TIME)
    assert call_["title"] == name and call_["pilot"] is True
    assert call_["path"] == (Path("a.html"),)


@pytest.mark.parametrize("name", ["--out", "--record"])
def test_a_robot_by_itself(desk, good, name):
    (desk / "own.urdf").write_text(RATE_TABLE, encoding="utf-8")
    out = good("view", "own.urdf", name, "own.html").out
    assert out.startswith("rate_table: 3 joints turn 325 kg; own.html written\n")
    assert "outer_axis" in (desk / "own.html").read_text(encoding="utf-8")


def test_a_robot_live(desk, good):
    out = good("view", "sdt", "--once").out
    assert out.startswith("sdt: 4 joints turn 6610 kg.\n") and "\nsdt: http://localhost:" in out
    assert re.search(r"^1 planetary +continuous +any +178.6 +13655 ", out, re.MULTILINE)


def test_a_robot_has_no_motion(desk, call):
    refused(call("view", "sdt", "--pilot"), "--pilot: has no effect on a robot")
    refused(call("view", "sdt", "--robot", "sdt"), "--robot: has no effect on a robot")
    refused(call("view", "none.urdf"), "none.urdf: no such file")


def test_live_says_that_what_is_felt_is_a_prediction(desk, good):
    assert (
        "The violet head is the attitude as it is felt. Predicted by a model"
        in good("view", "motion.csv", "--once", "--rate", "1000").out
    )


def test_scenario_shows_what_the_joints_do(desk, good, shown):
    good("view", "run.yaml", "--rate", "2", "--port", "7123", "--once")
    (call_,) = shown
    assert call_["q"].shape == (251, 4) and call_["time"][-1] == pytest.approx(1.25)
    # Joint 2 ramps up to 0.5 rad/s and down; the controller lags, so it is not the reference.
    assert call_["q"][-1, 1] > 0.1 and np.ptp(call_["q"][:, 2:]) < 0.01
    assert (call_["rate"], call_["port"], call_["once"], call_["pilot"]) == (2.0, 7123, True, False)


def test_a_motion_is_planned(desk, good, shown):
    good("view", "motion.yaml", "--record", "a.html")
    (call_,) = shown
    assert call_["title"] == "motion" and call_["time"][-1] == pytest.approx(1.25)
    assert np.ptp(call_["q"][:, 1]) > 0.1 and np.ptp(call_["q"][:, 2:]) == 0


def test_a_scenario_that_is_too_long_is_not_run(desk, call, monkeypatch):
    def simulate(design):
        raise AssertionError("computed in vain")

    monkeypatch.setattr(import_module("sdt_drake.run.simulate"), "simulate", simulate)
    refused(call("view", "long.yaml", "--record", "a.html"), "long.yaml: lasts 3601 s")


def test_record_writes_a_page(desk, good):
    assert good("view", "motion.csv", "--record", "a.html").out == "a.html written\n"
    assert "<title>motion</title>" in (desk / "a.html").read_text(encoding="utf-8")


def test_plays_once_and_says_where(desk, good):
    out = good("view", "motion.csv", "--once", "--rate", "10").out
    assert out.startswith("motion: http://localhost:") and "Ctrl-C" not in out


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (("run.yaml", "--record", "a.htm"), "a.htm: unknown kind of file, expected .html"),
        (("run.yaml", "--record", "."), "is a folder"),
        (
            ("run.yaml", "--rate", "0.0099"),
            '"0.0099" for --rate. Expected a number >= 0.01 and <= 1000',
        ),
        (
            ("run.yaml", "--rate", "1000.5"),
            '"1000.5" for --rate. Expected a number >= 0.01 and <= 1000',
        ),
        (("run.yaml", "--record", "run.yaml/a.html"), "run.yaml: is a file, expected a folder"),
        (("run.yaml", "--port", "80"), '"80" for --port. Expected a number >= 1024 and <= 65535'),
        (("run.yaml", "--robot", "other.sdf"), "names the robot, expected --set robot=other.sdf"),
        (("run.yaml", "--record", "a.html", "--once"), "--once: has no effect with --record"),
        (("run.yaml", "--record", "a.html", "--port", "7100"), "--port: has no effect"),
        (("run.yaml", "--record", "a.html", "--rate", "2"), "--rate: has no effect"),
        (("none.yaml",), "none.yaml"),
        (("speeds.csv",), "speeds.csv: no columns q_1"),
        (("three.csv",), "three.csv: angles of 3 joint(s), robot 'sdt' has 4; --robot"),
        (("run.png",), "run.png: expected a"),
        (("no_such_motion",), "no_such_motion"),
        (("long.csv", "--record", "a.html"), "long.csv: lasts 3601 s, expected at most 3600 s"),
        (("long.yaml", "--record", "a.html"), "long.yaml: lasts 3601 s, expected at most 3600 s"),
    ],
)
def test_bad_input_is_one_line(desk, call, shown, arguments, part):
    refused(call("view", *arguments), part)
    assert shown == [] and not list(desk.glob("*.htm*"))


def test_port_in_use(desk, call):
    with socket.socket() as busy:
        busy.bind(("127.0.0.1", 0))
        busy.listen()
        port = busy.getsockname()[1]
        refused(
            call("view", "motion.csv", "--once", "--port", str(port)), f"port: {port} is in use"
        )
