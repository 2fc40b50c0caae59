"""`sdt-drake pilot` as a user meets it."""

from importlib import import_module

import numpy as np
import pytest

from sdt_drake.analysis.illusions import feel
from sdt_drake.analysis.perception import canals
from sdt_drake.analysis.tracking import track_head
from sdt_drake.io.tables import read_table
from sdt_drake.run.simulate import Recording


@pytest.fixture
def recording(good, desk):
    """A recording of the coupled plant, `run.csv` in the working directory."""
    good("simulate", "../given/coupled.yaml", "--out", "run.csv")
    return Recording.from_csv(desk / "run.csv")


def test_csv_holds_it_over_time(good, desk, recording, robot):
    done = good("pilot", "run.csv", "--out", "new/felt.csv")
    assert done.out.splitlines()[-1] == "new/felt.csv written"
    time, columns = read_table(desk / "new" / "felt.csv")

    np.testing.assert_array_equal(time, recording.time)
    head = track_head(recording, robot)
    for suffix, motion in (("_ref", head.reference), ("", head.achieved)):
        signals = {
            name: getattr(motion, name)
            for name in ("specific_force", "angular_velocity", "angular_acceleration")
        }
        signals["canals"] = canals(motion.angular_velocity, 0.005)
        felt = feel(motion, 0.005, "clark2019").columns
        for name, values in (signals | {f"felt_{x}": y for x, y in felt.items()}).items():
            np.testing.assert_array_equal(columns[name + suffix], values)
    np.testing.assert_array_equal(columns["multiple"], head.felt.multiples)


def test_that_no_illusion_is_predicted_is_told(good, recording, monkeypatch):
    monkeypatch.setattr(import_module("sdt_drake.analysis.illusions"), "illusions", lambda *_: [])
    assert "by clark2019:\n  none\n" in good("pilot", "run.csv").out
