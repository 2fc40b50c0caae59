"""`sdt-drake view` as a user meets it."""

from pathlib import Path

import numpy as np
import pytest

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
