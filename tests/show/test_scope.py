"""The scope of a run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdt_drake.io.errors import InputError
from sdt_drake.run.simulate import simulate
from sdt_drake.show.figures.runs import scope
from sdt_drake.show.figures.scope import joint_columns, limits_along

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


def lines(figure, row, joint):
    axes = np.reshape(figure.axes, (4, -1))[row, joint]
    return {line.get_label(): line.get_ydata() for line in axes.get_lines()}


def test_a_column_for_each_joint_shows_what_was_recorded(run):
    design, recording = run
    figure = scope("run", recording, design)
    for k in range(4):
        speed = lines(figure, 0, k)
        np.testing.assert_array_equal(speed["reference"], recording.v_ref[:, k])
        np.testing.assert_array_equal(speed["achieved"], recording.v[:, k])
        (error,) = lines(figure, 1, k).values()
        np.testing.assert_allclose(error, recording.v[:, k] - recording.v_ref[:, k])
        (error,) = lines(figure, 2, k).values()
        np.testing.assert_allclose(np.radians(error), (recording.q - recording.q_ref)[:, k])
        np.testing.assert_array_equal(lines(figure, 3, k)["motor torque"], recording.tau[:, k])
    units = [ax.get_ylabel().split()[-1] for ax in figure.axes[::4]]
    assert "".join(units) == "[rad/s][rad/s][deg]m]"
    assert len(scope("one", recording, design, 2).axes) == len(
        scope("one", recording, None, 2).axes
    )
    np.testing.assert_array_equal(
        lines(scope("one", recording, None, 2), 0, 0)["achieved"], recording.v[:, 1]
    )
    with pytest.raises(InputError, match="joint: 5, expected 1 to 4"):
        scope("one", recording, design, 5)
    with pytest.raises(InputError, match=r"design: 4 joint\(s\), expected 1"):
        scope("other", replace(recording, q=recording.q[:, :1]), design)


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
