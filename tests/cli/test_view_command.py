"""`sdt-drake view` as a user meets it."""

import socket
from pathlib import Path

import numpy as np
import pytest
from command_line import AXIS, SHORT_MOTION

from sdt_drake.io.tables import write_table

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
def test_angles_of_a_table(desk, good, shown, other):
    write_table(desk / "recorded.csv", TIME, other)
    good("view", "recorded.csv", "--record", "a.html", "--pilot")
    (call_,) = shown
    np.testing.assert_array_equal(call_["q"], ANGLES)
    assert (call_["title"], call_["path"]) == ("recorded", (Path("a.html"),)) and call_["pilot"]


def test_scenario_shows_what_the_joints_do(desk, good, shown):
    good("view", AXIS, "--rate", "2", "--port", "7123", "--once")
    (call_,) = shown
    assert call_["q"].shape == (101, 4) and call_["time"][-1] == pytest.approx(0.5)
    # Joint 2 ramps up to 0.5 rad/s and down; the controller lags, so it is not the reference.
    assert call_["q"][-1, 1] > 0.05 and np.ptp(call_["q"][:, 2:]) < 0.01
    assert (call_["rate"], call_["port"], call_["once"], call_["pilot"]) == (2.0, 7123, True, False)


def test_port_in_use(refuse):
    with socket.socket() as busy:
        busy.bind(("127.0.0.1", 0))
        busy.listen()
        port = busy.getsockname()[1]
        refuse("view", SHORT_MOTION, "--once", f"--port={port}", saying=[f"port: {port} is in use"])
