"""The scope of a run."""

from dataclasses import replace

import numpy as np
import pytest

from sdt_drake.run.simulate import simulate
from sdt_drake.show.figures.scope import joint_columns, limits_along
from sdt_drake.show.panels import Plots

DRIVE = {
    "drive.n1": [150.0, 0.5, 0.05, 0.05],
    "drive.n0": [300.0, 4.0, 0.5, 0.5],
    "drive.reference_delay": 0.0075,
}


@pytest.fixture(scope="module")
def run(designed):
    """Of joints that are asked to move at once, and saturate: design and recording."""
    design = designed("axis_pi", DRIVE, start=8.9, end=9.5, rest=20)
    return design, simulate(design)


def test_limits_are_those_of_the_saturation_in_the_loop(run):
    """Its Drake block has the envelope, the help of the other motors, and the late reference."""
    design, recording = run
    lower, upper = limits_along(recording, design)
    asked, given = recording.tau_cmd, recording.tau_limited
    assert np.sum(asked > given + 1) > 100 and np.sum(asked < given - 1) > 100
    np.testing.assert_allclose(np.clip(asked, lower, upper), given, rtol=1e-9, atol=1e-6)
    assert np.ptp(upper, axis=0).max() > 1000


def test_a_single_period_in_saturation_is_seen(run):
    design, recording = run
    once = np.zeros_like(recording.saturated)
    once[5, 1] = 0.1  # in the period that ends there
    _, (speed, *_), *_ = joint_columns(replace(recording, saturated=once), design)
    assert speed.spans() == [(recording.time[4], recording.time[5])]
    (sent,) = Plots([[speed]]).data()["panels"]
    assert sent["marked"] == speed.spans() and sent["title"] == speed.title
