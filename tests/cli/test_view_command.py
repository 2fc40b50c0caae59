"""`sdt-drake view` as a user meets it."""

from __future__ import annotations

import socket
from pathlib import Path

import numpy as np
import pytest
from command_line import MOTION, SCENARIO, refused

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


def test_scenario_shows_what_the_joints_do(desk, good, shown):
    good("view", "run.yaml", "--rate", "2", "--port", "7123", "--once")
    (call_,) = shown
    assert call_["q"].shape == (251, 4) and call_["time"][-1] == pytest.approx(1.25)
    # Joint 2 ramps up to 0.5 rad/s and down; the controller lags, so it is not the reference.
    assert call_["q"][-1, 1] > 0.1 and np.ptp(call_["q"][:, 2:]) < 0.01
    assert (call_["rate"], call_["port"], call_["once"], call_["pilot"]) == (2.0, 7123, True, False)


def test_port_in_use(desk, call):
    with socket.socket() as busy:
        busy.bind(("127.0.0.1", 0))
        busy.listen()
        port = busy.getsockname()[1]
        refused(
            call("view", "motion.csv", "--once", "--port", str(port)), f"port: {port} is in use"
        )
